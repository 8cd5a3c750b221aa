"""The best course of an input: moves tried at random within limits, and improved."""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize

from discovery.diagnosis.manoeuvre_design import NUMBERS, MotorLimits, Move, moves_from_unit
from discovery.diagnosis.rival_distance import Trial
from discovery.foundation.arrays import FloatArray

#: Share of the trials that are drawn at random; the others improve on the best of those.
_RANDOM = 0.6
#: Standard deviation of a random step from the best, in each direction of the unit cube.
_STEP = 0.1


class MoveSearch:
    """The best of the manoeuvres tried within limits, as a point of the unit cube."""

    def __init__(self, trial: Trial, limits: MotorLimits) -> None:
        self._trial, self._limits = trial, limits
        self._best: FloatArray = np.empty(0)
        self.merit, self.count = -np.inf, 0

    @property
    def moves(self) -> tuple[Move, ...]:
        """The best manoeuvre; where none keeps the deflection, that which exceeds it least."""
        return moves_from_unit(self._best, self._limits)

    def run(self, evaluations: int, rng: np.random.Generator) -> None:
        """Try so many manoeuvres, the first of them at random, the others from the best of those."""
        for i in range(max(1, int(_RANDOM * evaluations))):
            self._loss(rng.random(NUMBERS * (1 + i % self._limits.moves)))
        left = evaluations - self.count
        # With fewer steps than corners a simplex finds less than single steps do.
        if left >= 2 * (self._best.size + 1):
            self._simplex(left)
        else:
            self._steps(left, rng)

    def _loss(self, unit: FloatArray) -> float:
        """Try a manoeuvre: return a number that is the smaller, the better it is."""
        self.count += 1
        moves, merit, most = moves_from_unit(unit, self._limits), -2.0, self._limits.deflection
        if moves:
            distance, deflection = self._trial.compare(moves)
            # Beyond the allowed deflection, the less the better.
            merit = float(np.log1p(distance.chi2)) if deflection <= most else most / deflection - 1
        if merit > self.merit:
            self.merit, self._best = merit, unit.copy()
        return -merit

    def _simplex(self, count: int) -> None:
        centre = self._best
        corners = np.concatenate([centre[None], np.where(np.eye(centre.size) > 0, (centre + 0.15) % 1.0, centre)])
        minimize(
            self._loss,
            centre,
            method="Nelder-Mead",
            bounds=[(0.0, 1.0)] * centre.size,
            options={"maxfev": count, "initial_simplex": corners, "xatol": 1e-3, "fatol": 1e-3},
        )

    def _steps(self, count: int, rng: np.random.Generator) -> None:
        for _ in range(count):
            self._loss(np.clip(self._best + _STEP * rng.standard_normal(self._best.size), 0.0, 1.0))
