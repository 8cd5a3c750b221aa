"""Moves of ensembles beside emcee's own: independent proposals, and counts of what is accepted."""

from __future__ import annotations

from typing import Any

import emcee
from numpy.random import RandomState

from discovery.estimation.proposal import Proposal
from discovery.foundation.arrays import BoolArray, FloatArray


class IndependenceMove(emcee.moves.MHMove):
    """Metropolis-Hastings with a proposal that ignores where the walker is.

    In coordinates whitened by a fit a multivariate Student t is nearly the posterior itself, and most steps are then
    new independent draws; where it is not, the acceptance corrects it (L. Tierney, Annals of Statistics 22 (1994)
    1701). Another proposal may be set between steps, which must then count as burn-in.
    """

    def __init__(self, proposal: Proposal) -> None:
        super().__init__(self._drawn)
        self.proposal = proposal

    def _drawn(self, coords: FloatArray, random: RandomState) -> tuple[FloatArray, FloatArray]:
        """Return proposals for walkers (k, d), and the logarithms of their factors (k,)."""
        points, log_density = self.proposal.draw(random, len(coords))
        return points, self.proposal.log_density(coords) - log_density


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
