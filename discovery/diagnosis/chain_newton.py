"""Newton's method on a chain: the motion, its initial state, and the coefficients of a force, all at once."""

from __future__ import annotations

import numpy as np

from discovery.diagnosis.multiple_shooting import Chain, Linearised
from discovery.diagnosis.slow_model import Law
from discovery.foundation.arrays import FloatArray
from discovery.foundation.errors import ComputationError

#: Rounds of Newton's method.
ROUNDS = 12
#: Derivatives beyond this are those of a motion that nothing holds.
_LARGE = 1e9


def _propagate(chain: Chain, lin: Linearised, first: FloatArray, basis: FloatArray, gap: FloatArray) -> FloatArray:
    """Return how every cut changes with initial state, coefficients and defects, shape (m + 1, 2, 2 + k + 1).

    `first` (2, 2) and `gap` (2,) belong to the first cut, `basis` (m + 1, k) gives the force at the cuts.
    """
    k = basis.shape[1]
    found = np.zeros((chain.time.size, 2, 3 + k))
    found[0, :, :2], found[0, :, -1] = first, gap
    for i in range(chain.time.size - 1):
        following = lin.transition[i] @ found[i]
        following[:, 2:-1] += np.outer(lin.force[0, i], basis[i]) + np.outer(lin.force[1, i], basis[i + 1])
        following[:, -1] += lin.defect[i]
        found[i + 1] = following
    return found


class Newton:
    """Newton's method on the states of a chain, its initial state, and the coefficients of a force."""

    def __init__(self, chain: Chain, basis: FloatArray, law: Law | None = None) -> None:
        self.chain, self.basis, self.law = chain, basis, law
        self.start, self.coefficients = np.zeros(2), np.zeros(basis.shape[1])
        self.states = chain.run.copy()
        self.weights = chain.experiment.weights()
        self.used = self.weights > 0
        self._scale = chain.slow.units.coordinate / np.array([1.0, chain.slow.units.time])

    def linearise(self) -> None:
        """Compute the whitened residual (n,) and its derivatives by initial state (n, 2) and coefficients (n, k)."""
        chain = self.chain
        here = chain.initial(self.start)
        moves = 1e-6 * np.diag(self._scale)
        first = np.stack([(chain.initial(self.start + d) - here) / d.sum() for d in moves], axis=1)
        with np.errstate(over="ignore", invalid="ignore"):
            lin = chain.linearise(self.states, self.basis @ self.coefficients, self.law, pushed=self.basis.size > 0)
            self.change = _propagate(chain, lin, first, self.basis, here - self.states[:, 0])
            seen = np.einsum("ncs,nsk->nck", chain.sensitivity(self.states), self.change[chain.at])
        if not np.abs(seen).max() < _LARGE:
            raise ComputationError("The motion beside the fitted run grows beyond all bounds.")
        missing = (chain.experiment.recording.output - chain.channels(self.states) - seen[:, :, -1]) * self.weights
        columns = (seen[:, :, :-1] * self.weights[:, :, None])[self.used]
        self.residual, self.by_start, self.by_force = missing[self.used], columns[:, :2], columns[:, 2:]

    def move(self, coefficients: FloatArray) -> float:
        """Take these coefficients with the initial state that suits them; return the largest change of the motion."""
        step = coefficients - self.coefficients
        start = np.linalg.lstsq(self.by_start, self.residual - self.by_force @ step, rcond=None)[0]
        moved = self.change @ np.concatenate([start, step, [1.0]])
        self.states = self.states + moved.T
        self.start, self.coefficients = self.start + start, coefficients
        return float(np.abs(moved / self._scale).max())

    def settle(self) -> bool:
        """Close the chain with the coefficients held; return whether that succeeds."""
        try:
            for _ in range(ROUNDS):
                self.linearise()
                if self.move(self.coefficients) < 1e-6:
                    return True
        except ComputationError:
            pass
        return False


def close(chain: Chain, law: Law | None) -> FloatArray:
    """Return what the instrument reports of a free run under a law (n, c), the initial state fitted.

    Raises
    ------
    ComputationError
        If Newton's method does not close the chain, even where the law grows by quarters.
    """
    newton = Newton(chain, np.zeros((chain.time.size, 0)), law)
    if newton.settle():
        return chain.channels(newton.states)
    newton = Newton(chain, newton.basis)
    for share in (0.25, 0.5, 0.75, 1.0):
        newton.law = law and law.scaled(share)
        if not newton.settle():
            raise ComputationError("No motion of the model with this law was found beside the fitted run.")
    return chain.channels(newton.states)
