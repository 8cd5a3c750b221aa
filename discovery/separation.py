"""The manoeuvre that tells rival effects apart: the predicted tips made as different as the motor's limits allow.

Rivals fit the same recordings equally well. The manoeuvre maximises the chi-square by which the right one will win,
see `discovery.rival_distance`, the smallest over all ordered pairs: optimal design for discrimination (Hunter and
Reiner, Technometrics 7 (1965) 307).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from discovery.effect import ARM
from discovery.errors import InputError
from discovery.experiment import Experiment, largest_deflection
from discovery.fit import Fit
from discovery.likeness import similarity
from discovery.manoeuvre_design import NUMBERS, MotorLimits, Move, hub_drive, moves_from_unit
from discovery.rival_distance import Distance, Trial, distance_on_given
from discovery.simplicity import simplicity

__all__ = ["Separation", "demonstrated_limits", "separate", "similarity_matrix"]

FloatArray = NDArray[np.float64]
#: Share of the trials that are drawn at random; the others improve on the best of those.
_RANDOM = 0.6
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
        Of the nearest pair on the given recordings, where parameters are as free as they can be, and on the manoeuvre.
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

    @property
    def sentence(self) -> str:
        """What the manoeuvre promises, in words."""
        if not self.decides:
            most = self.limits
            return (
                f"No manoeuvre within the safe limits ({most.angle:.3g} rad, {most.speed:.3g} rad/s, "
                f"{most.acceleration:.3g} rad/s^2, {most.duration:.3g} s, tip deflected by {most.deflection:.3g} rad) "
                f"tells {', '.join(self.rivals)} apart: of {self.evaluations} tried, the best lets the right one win "
                f"by an expected chi-square of {self.designed.chi2:.2g}, and less than {_DECIDES:g} may be chance. A "
                "camera with less noise, or wider limits if they are safe, would help."
            )
        turns = "; ".join(
            f"at {m.start:.2f} s turn {m.angle:+.2f} rad at {m.speed:.2f} rad/s, ramps {m.ramp * m.duration:.2f} s"
            for m in self.moves
        )
        return (
            f"To tell {', '.join(self.rivals)} apart: {turns}. With their parameters readjusted, the predictions then "
            f"differ by {self.designed.projected:.2g} noise sds rms ({self.given.projected:.2g} on the given "
            f"recordings), and the right one is expected to win by a chi-square of {self.designed.chi2:.3g}."
        )

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
            "sentence": self.sentence,
        }


def demonstrated_limits(experiments: Sequence[Experiment], *, moves: int = 3) -> MotorLimits:
    """Return what the motor and the arm have done in recordings: limits that are known to be safe.

    Raises
    ------
    InputError
        If the recordings are not those of an arm whose motor moves.
    """
    if not all(e.is_arm and e.drive is not None for e in experiments):
        raise InputError("A manoeuvre can only be designed for an arm with a motor.")
    sizes = []
    for e in experiments:
        assert e.drive is not None
        time = e.recording.time
        angle, rate, acceleration = e.drive.evaluate(np.linspace(time[0], time[-1], 4000))
        sizes.append([np.abs(angle - angle[0]).max(), np.abs(rate).max(), np.abs(acceleration).max(), np.ptp(time)])
    angle, speed, acceleration, duration = np.max(sizes, axis=0).tolist()
    return MotorLimits(angle, speed, acceleration, duration, 1.1 * largest_deflection(experiments), moves)


def similarity_matrix(fits: Sequence[Fit]) -> FloatArray:
    """Return how alike the rivals' own effects act on the recordings that they were fitted to.

    Parameters
    ----------
    fits : sequence of Fit
        On the same recordings.

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
        What the motor allows; by default what it has shown, see `demonstrated_limits`.
    evaluations : int
        Manoeuvres to try: the first ones at random, the others by the simplex of Nelder and Mead (Computer Journal 7
        (1965) 308) from the best.
    on_progress : callable, optional
        Called after every trial with their number and the best chi-square difference so far.

    Returns
    -------
    Separation

    Raises
    ------
    InputError
        If there are fewer than two rivals, on different recordings or of another system than an arm with a motor, or if
        no manoeuvre within the limits keeps the deflection.
    ComputationError
        If a model has no rest position where the hub starts.
    """
    names = tuple(sorted(rivals, key=lambda n: simplicity(n, ARM)))
    fits = [rivals[n] for n in names]
    if len(fits) < 2 or len({tuple(e.recording.name for e in f.problem.bench.experiments) for f in fits}) != 1:
        raise InputError("Rivals to be separated are at least two fits to the same recordings.")
    experiments = fits[0].problem.bench.experiments
    shown = demonstrated_limits(experiments)
    limits = limits or shown
    trial = Trial(fits, limits.duration)
    best: tuple[float, FloatArray] = (-np.inf, np.empty(0))
    tried = 0

    def loss(unit: FloatArray) -> float:
        nonlocal best, tried
        tried += 1
        moves = moves_from_unit(unit, limits)
        merit = -1.0
        if moves:
            distance, deflection = trial.compare(moves)
            # Beyond the allowed deflection, the less the better.
            merit = (
                float(np.log1p(distance.chi2))
                if deflection <= limits.deflection
                else limits.deflection / deflection - 1
            )
        if merit > best[0]:
            best = (merit, unit.copy())
        if on_progress is not None:
            on_progress(tried, float(np.expm1(max(best[0], 0.0))))
        return -merit

    for i in range(int(_RANDOM * evaluations)):
        loss(rng.random(NUMBERS * (1 + i % limits.moves)))
    if tried < evaluations:
        centre = best[1]
        corners = np.concatenate([centre[None], np.where(np.eye(centre.size) > 0, (centre + 0.15) % 1.0, centre)])
        minimize(
            loss,
            centre,
            method="Nelder-Mead",
            bounds=[(0.0, 1.0)] * centre.size,
            options={"maxfev": evaluations - tried, "initial_simplex": corners, "xatol": 1e-3, "fatol": 1e-3},
        )
    moves = moves_from_unit(best[1], limits)
    if best[0] < 0:
        raise InputError(
            f"No manoeuvre within {limits.angle:.3g} rad, {limits.speed:.3g} rad/s and {limits.acceleration:.3g} "
            f"rad/s^2 keeps the deflection below {limits.deflection:.3g} rad; lower the limits of the motor."
        )
    distance, deflection = trial.compare(moves)
    time = trial.gap * np.arange(trial.count)
    table = np.column_stack([time, hub_drive(moves, trial.angle).evaluate(time)[0]])
    return Separation(
        rivals=names,
        similarities=similarity_matrix(fits),
        limits=limits,
        moves=moves,
        table=table,
        given=distance_on_given(fits),
        designed=distance,
        deflection=deflection,
        evaluations=tried,
    )
