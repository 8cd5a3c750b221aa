"""Moves of emcee on whole arrays of walkers: no Python loop over walkers, so that ensembles may be large.

The proposals are emcee's own; they are accepted for all walkers of a group at once, and the log density is called
without a copy of its values one by one.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import emcee
import numpy as np
from numpy.random import RandomState

from discovery.foundation.arrays import BoolArray, FloatArray, IntArray
from discovery.foundation.workers import single_algebra

#: Degrees of freedom; tails heavier than those of the posterior keep walkers from sticking there.
_DOF = 30.0
#: One component is so many times as wide as all others together, with this weight: it finds what they miss.
_WIDE, _WIDE_WEIGHT = 4.0, 0.03
# Components, each of so many different points a dimension; no more points than are of use.
_COMPONENTS, _POINTS_A_DIMENSION, _POINTS = (2, 8), 30, 3000
_LEAST_WEIGHT = 0.005
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


@dataclass(frozen=True)
class StudentMixture:
    """A mixture of multivariate Student t distributions: a proposal that covers posteriors of any shape.

    Its m components have `weights` (m,), `centres` (m, d), and scale matrices with lower Cholesky `factors` (m, d, d).
    """

    weights: FloatArray
    centres: FloatArray
    factors: FloatArray

    @classmethod
    def standard(cls, dimension: int, scale: float = 1.0) -> StudentMixture:
        """Return a round distribution around the origin, for coordinates that a fit has whitened."""
        return cls._with_wide(np.ones(1), np.zeros((1, dimension)), scale * np.eye(dimension)[None])

    @classmethod
    def of_points(cls, points: FloatArray, seed: int) -> StudentMixture:
        """Return the mixture that points (k, d) look drawn from; a Bayesian fit chooses the number of components."""
        # Only hardly accepted proposals need it, and its import takes long.
        from sklearn.exceptions import ConvergenceWarning
        from sklearn.mixture import BayesianGaussianMixture

        points = points[:: -(-len(points) // _POINTS)]
        d = points.shape[1]
        covariance = np.cov(points, rowvar=False).reshape(d, d)
        centre, factor = np.mean(points, axis=0), np.linalg.cholesky(covariance)
        # Walkers that rejected a proposal are the same point once more, and tell nothing new.
        different = len(np.unique(points[:, 0]))
        most = int(np.clip(different // (_POINTS_A_DIMENSION * d), *_COMPONENTS))
        fit = BayesianGaussianMixture(n_components=most, max_iter=100, random_state=seed)
        with warnings.catch_warnings(), single_algebra():
            # An unfinished fit is a good proposal all the same.
            warnings.simplefilter("ignore", ConvergenceWarning)
            fit.fit(np.linalg.solve(factor, (points - centre).T).T)
        kept = fit.weights_ > _LEAST_WEIGHT
        return cls._with_wide(
            fit.weights_[kept] / fit.weights_[kept].sum(),
            centre + fit.means_[kept] @ factor.T,
            np.asarray(factor @ np.linalg.cholesky(fit.covariances_[kept]), np.float64),
        )

    @classmethod
    def _with_wide(cls, weights: FloatArray, centres: FloatArray, factors: FloatArray) -> StudentMixture:
        centre = weights @ centres
        away = centres - centre
        covariance = np.einsum("m,mij,mkj->ik", weights, factors, factors) + (weights[:, None] * away).T @ away
        return cls(
            np.append((1 - _WIDE_WEIGHT) * weights, _WIDE_WEIGHT),
            np.concatenate([centres, centre[None]]),
            np.concatenate([factors, _WIDE * np.linalg.cholesky(covariance)[None]]),
        )

    @cached_property
    def _inverses(self) -> FloatArray:
        return np.asarray(np.linalg.inv(self.factors), np.float64)

    @cached_property
    def _log_scales(self) -> FloatArray:
        return np.log(self.weights) - np.log(np.diagonal(self.factors, axis1=1, axis2=2)).sum(axis=1)

    def draw(self, random: RandomState, count: int) -> FloatArray:
        """Return independent draws, shape (count, d)."""
        z = random.standard_normal((count, self.centres.shape[1]))
        z /= np.sqrt(random.chisquare(_DOF, count) / _DOF)[:, None]
        ends = np.cumsum(random.multinomial(count, self.weights))
        points = np.empty_like(z)
        starts = np.append(0, ends[:-1])
        for first, last, centre, factor in zip(starts, ends, self.centres, self.factors, strict=True):
            points[first:last] = centre + np.einsum("kj,ij->ki", z[first:last], factor)
        # Which walker gets a draw of which component is left to chance.
        return points[random.permutation(count)]

    def log_density(self, points: FloatArray) -> FloatArray:
        """Return the log density (k,) at points (k, d), up to a constant."""
        d = points.shape[1]
        parts = np.empty((len(self.weights), len(points)))
        # Not by BLAS here and above: its threads would spin for these few numbers.
        for part, centre, inverse, log_scale in zip(parts, self.centres, self._inverses, self._log_scales, strict=True):
            z = np.einsum("kj,ij->ki", points - centre, inverse)
            part[:] = log_scale - 0.5 * (_DOF + d) * np.log1p(np.einsum("kd,kd->k", z, z) / _DOF)
        return np.logaddexp.reduce(parts)


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
