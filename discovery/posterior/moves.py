"""Moves of emcee on whole arrays of walkers: no Python loop over walkers, so that ensembles may be large.

The proposals are emcee's own; they are accepted for all walkers of a group at once, and the log density is called
without a copy of its values one by one.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import emcee
import numpy as np
from numpy.random import RandomState

from discovery.foundation.arrays import BoolArray, FloatArray, IntArray
from discovery.posterior.student_mixture import StudentMixture

#: Part of the steps of differential evolution that go from one peak of a posterior to another.
_JUMPS = 0.3


def _accept(model: Any, state: emcee.State, which: IntArray, points: FloatArray, factors: FloatArray) -> BoolArray:
    """Move the walkers `which` to points (k, d) with the probability of Metropolis and Hastings; tell which moved."""
    log_prob = model.log_prob_fn(points)
    gain = factors + log_prob - state.log_prob[which]
    accepted = np.asarray(-model.random.standard_exponential(len(which)) < gain)
    moved = which[accepted]
    state.coords[moved], state.log_prob[moved] = points[accepted], log_prob[accepted]
    return accepted


class IndependenceMove(emcee.moves.Move):
    """Metropolis-Hastings with a proposal that ignores where the walker is.

    In coordinates whitened by a fit a multivariate Student t is nearly the posterior itself, and most steps are then
    new independent draws; where it is not, the acceptance corrects it (L. Tierney, Annals of Statistics 22 (1994)
    1701). Another proposal may be set between steps, which must then count as burn-in.
    """

    def __init__(self, proposal: StudentMixture) -> None:
        self.proposal = proposal

    def propose(self, model: Any, state: emcee.State) -> tuple[emcee.State, BoolArray]:
        """Propose and accept for all walkers at once."""
        walkers = len(state.coords)
        points = self.proposal.draw(model.random, walkers)
        factors = self.proposal.log_density(state.coords) - self.proposal.log_density(points)
        return state, _accept(model, state, np.arange(walkers), points, factors)


class _ByGroups:
    """Moves that update one random group of walkers after the other, each from where the others are."""

    nsplits: int

    def propose(self, model: Any, state: emcee.State) -> tuple[emcee.State, BoolArray]:
        walkers = len(state.coords)
        accepted = np.zeros(walkers, bool)
        self.setup(state.coords)  # type: ignore[attr-defined]
        groups = np.array_split(model.random.permutation(walkers), self.nsplits)
        for i, group in enumerate(groups):
            others = [state.coords[g] for j, g in enumerate(groups) if j != i]
            points, factors = self.get_proposal(state.coords[group], others, model.random)  # type: ignore[attr-defined]
            accepted[group] = _accept(model, state, group, points, factors)
        return state, accepted


class Stretch(_ByGroups, emcee.moves.StretchMove):
    """The stretch move of Goodman and Weare."""


class DifferentialEvolution(_ByGroups, emcee.moves.DEMove):
    """Differential evolution, with some steps as long as the distance of two walkers: from one peak to another.

    C. ter Braak, Statistics and Computing 16 (2006) 239.
    """

    def get_proposal(
        self, s: FloatArray, c: Sequence[FloatArray], random: RandomState
    ) -> tuple[FloatArray, FloatArray]:
        """Return proposals for walkers s (k, d) from the others, and the logarithms of their factors."""
        others, k = np.concatenate(c), len(s)
        first = random.randint(len(others), size=k)
        # Any other than the first: drawn here, not from a table of all pairs, which grows with their square.
        second = (first + random.randint(1, len(others), size=k)) % len(others)
        length = self.g0 * (1 + self.sigma * random.standard_normal(k))
        length[random.random_sample(k) < _JUMPS] = 1.0
        return s + length[:, None] * (others[first] - others[second]), np.zeros(k)


class Snooker(_ByGroups, emcee.moves.DESnookerMove):
    """The snooker move of ter Braak and Vrugt: along the line through another walker."""

    def get_proposal(
        self, s: FloatArray, c: Sequence[FloatArray], random: RandomState
    ) -> tuple[FloatArray, FloatArray]:
        """Return proposals for walkers s (k, d) from the others, and the logarithms of their factors."""
        k, d = s.shape
        anchor, first, second = (group[random.randint(len(group), size=k)] for group in c)
        away = s - anchor
        norm = np.linalg.norm(away, axis=1)
        along = np.einsum("kd,kd->k", away, first - second) / norm**2
        points = s + self.gammas * along[:, None] * away
        return points, (d - 1.0) * np.log(np.linalg.norm(points - anchor, axis=1) / norm)


class Counted(emcee.moves.Move):
    """A move that counts how many of its proposals are accepted."""

    def __init__(self, move: emcee.moves.Move) -> None:
        self.move, self.proposed, self.accepted = move, 0, 0

    def propose(self, model: Any, state: emcee.State) -> tuple[emcee.State, BoolArray]:
        """Propose with the move, and count."""
        state, accepted = self.move.propose(model, state)
        self.proposed += accepted.size
        self.accepted += int(accepted.sum())
        return state, accepted
