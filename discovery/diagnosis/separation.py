"""The manoeuvre that tells rival effects apart: the predicted tips made as different as the motor's limits allow.

Rivals fit the same recordings equally well. The manoeuvre maximises the chi-square by which the right one will win,
see `discovery.diagnosis.rival_distance`, the smallest over all ordered pairs: optimal design for discrimination (Hunter
and Reiner, Technometrics 7 (1965) 307).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from discovery.declarations.effect import ARM
from discovery.diagnosis.manoeuvre_design import NUMBERS, MotorLimits, Move, hub_drive, moves_from_unit
from discovery.diagnosis.motor_limits import allowed_limits, demonstrated_limits, known_part
from discovery.diagnosis.rival_distance import Distance, Trial, distance_on_given
from discovery.estimation.fit import Fit
from discovery.foundation.errors import InputError
from discovery.screening.likeness import similarity
from discovery.selection.simplicity import simplicity

__all__ = ["Separation", "separate", "similarity_matrix"]

FloatArray = NDArray[np.float64]
#: Share of the trials that are drawn at random; the others improve on the best of those.
_RANDOM = 0.6
#: Standard deviation of a random step from the best, in each direction of the unit cube.
_STEP = 0.1
#: Chi-square by which the right rival must be expected to win: less may be chance.
_DECIDES = 10.0


@dataclass(frozen=True)
class Separation:
    """The manoeuvre that separates rivals.

    Parameters
    ----------
    rivals : tuple of str
        Names of the rivals, physically simplest first.
    similarities : ndarray, shape (r, r)
        See `similarity_matrix`, in the same order; NaN where a rival has no sensitivity of its own.
    limits : MotorLimits
        What the motor was allowed.
    moves : tuple of Move
        The manoeuvre.
    table : ndarray, shape (n, 2)
        Time [s] and motor angle [rad], at the rate of the given recordings.
    given, designed : Distance
        Of the nearest pair on the given recordings, where parameters are as free as they can be, and on the manoeuvre;
        zero there where every manoeuvre that was tried exceeds the deflection that is allowed.
    deflection : float
        Largest deflection that a rival predicts [rad].
    evaluations : int
        Manoeuvres tried.
    """

    rivals: tuple[str, ...]
    similarities: FloatArray
    limits: MotorLimits
    moves: tuple[Move, ...]
    table: FloatArray
    given: Distance
    designed: Distance
    deflection: float
    evaluations: int

    @property
    def decides(self) -> bool:
        """Whether the manoeuvre can be expected to tell the rivals apart."""
        return self.designed.chi2 >= _DECIDES

    def csv(self) -> str:
        """Return the motor's course as a CSV file with the columns ``time_s, motor_angle_rad``."""
        return "".join(("time_s,motor_angle_rad\n", *(f"{t:.6f},{a:.9f}\n" for t, a in self.table.tolist())))

    def summary(self) -> dict[str, Any]:
        """Return a JSON-ready description, the table left out."""
        return {
            "rivals": list(self.rivals),
            "similarity": [[v if np.isfinite(v) else None for v in row] for row in self.similarities.tolist()],
            "limits": asdict(self.limits),
            "moves": [asdict(m) for m in self.moves],
            "given": asdict(self.given),
            "designed": asdict(self.designed),
            "deflection": self.deflection,
            "evaluations": self.evaluations,
            "decides": self.decides,
            "decides_from": _DECIDES,
        }


def similarity_matrix(fits: Sequence[Fit]) -> FloatArray:
    """Return how alike the rivals' own effects act on the recordings that they were fitted to.

    Returns
    -------
    ndarray, shape (r, r)
        Largest principal cosine between the sensitivities of what each fit has beyond the parameters common to all,
        with what the common ones, as far as the rig leaves them free, and the initial states absorb projected out; NaN
        for a fit that has nothing more.
    """
    common = set.intersection(*(set(f.problem.names) for f in fits))
    # With the rows of the priors: what the rig knows cannot absorb at will.
    most = max(len(f.minimum.jacobian) for f in fits)
    own = []
    for f in fits:
        rows = np.pad(f.minimum.jacobian, ((0, most - len(f.minimum.jacobian)), (0, 0)))
        shared = np.array([n in common for n in f.problem.names])
        known, _ = np.linalg.qr(rows[:, shared])
        left = rows[:, ~shared] - known @ (known.T @ rows[:, ~shared])
        size = np.linalg.norm(left, axis=0)
        seen = size > 1e-9 * np.linalg.norm(rows[:, ~shared], axis=0)
        own.append(left[:, seen] / size[seen])
    matrix = np.full((len(fits), len(fits)), np.nan)
    for i, first in enumerate(own):
        for j, second in enumerate(own):
            if first.size and second.size:
                matrix[i, j] = 1.0 if i == j else similarity(first, second)
    return matrix


class _Search:
    """The best of the manoeuvres tried within limits, as a point of the unit cube."""

    def __init__(self, trial: Trial, limits: MotorLimits, tell: Callable[[], None]) -> None:
        self._trial, self._limits, self._tell = trial, limits, tell
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
        self._tell()
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


def separate(
    rivals: Mapping[str, Fit],
    rng: np.random.Generator,
    *,
    limits: MotorLimits | None = None,
    evaluations: int = 400,
    on_progress: Callable[[int, float], None] | None = None,
) -> Separation:
    """Design the hub manoeuvre that separates rival effects.

    Parameters
    ----------
    rivals : mapping of str to Fit
        Fits of the rivals to the same recordings, by catalogue id; two or more. They may be on different bases.
    rng : numpy.random.Generator
        Source of the manoeuvres that are tried at random: the same state gives the same design.
    limits : MotorLimits, optional
        What the motor allows; by default what the rig file states and the recordings show, see `allowed_limits`.
    evaluations : int
        Manoeuvres to try: the first ones at random, the others from the best of those, by the simplex of Nelder and
        Mead (Computer Journal 7 (1965) 308) or, where its corners would take most of them, by random steps. So many
        within what the recordings show to be safe, and as many more where the limits are others.
    on_progress : callable, optional
        Called after every trial with their number and the best chi-square difference so far.

    Raises
    ------
    InputError
        If there are fewer than two rivals, on different recordings or of another system than an arm with a motor.
    ComputationError
        If a model has no rest position where the hub starts.
    """
    names = tuple(sorted(rivals, key=lambda n: simplicity(n, ARM)))
    fits = [rivals[n] for n in names]
    if len(fits) < 2 or len({tuple(e.recording.name for e in f.problem.bench.experiments) for f in fits}) != 1:
        raise InputError("Rivals to be separated are at least two fits to the same recordings.")
    experiments = fits[0].problem.bench.experiments
    shown = demonstrated_limits(experiments)
    limits = limits or allowed_limits(experiments)
    trial = Trial(fits, limits.duration)
    searches: list[_Search] = []

    def tell() -> None:
        if on_progress is not None:
            on_progress(sum(s.count for s in searches), float(np.expm1(max(0.0, *(s.merit for s in searches)))))

    # Wider limits are no reason to find less than without them.
    for within in dict.fromkeys((known_part(limits, shown), limits)):
        searches.append(_Search(trial, within, tell))
        searches[-1].run(evaluations, rng)
    best = max(searches, key=lambda s: s.merit)
    distance, deflection = trial.compare(best.moves)
    if deflection > limits.deflection:
        distance = Distance(0.0, 0.0, 0.0)
    time = trial.gap * np.arange(trial.count)
    table = np.column_stack([time, hub_drive(best.moves, trial.angle).evaluate(time)[0]])
    return Separation(
        rivals=names,
        similarities=similarity_matrix(fits),
        limits=limits,
        moves=best.moves,
        table=table,
        given=distance_on_given(fits),
        designed=distance,
        deflection=deflection,
        evaluations=sum(s.count for s in searches),
    )
