"""Numbers that are plausible in another unit: angles in degrees, times in milliseconds, heights in millimetres.

Gravity tells them. The period of a pendulum grows with its amplitude as pi / 2K(sin(A/2)) shrinks, where A is in
radians: that fixes the scale of the angle whatever the length is. A body that falls slowly feels gravity alone, and
drag never makes it faster.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from scipy.special import ellipk

from discovery.declarations.units import quoted, si_factor
from discovery.foundation.arrays import FloatArray
from discovery.foundation.errors import InputError
from discovery.foundation.sampling import median_step
from discovery.recordings.file_signals import Signals
from discovery.recordings.flags import Flag
from discovery.recordings.running_on import DRIVEN, falls_upwards, runs_on, way_of
from discovery.rigs.rig import Rig

Motion = tuple[FloatArray, FloatArray]

_ANGLES = ("turn", "rad", "deg", "mrad")
_LENGTHS = ("m", "ft", "inch", "cm", "mm")
#: Periods in one stretch whose amplitude and frequency are measured, and stretches that are needed.
_PERIODS, _FEWEST = 2.0, 4
_ASIDE = 0.4  # half turns from where a pendulum hangs, about which none swings
#: Another unit must leave less than this share of what the declared one leaves.
_SHARE = 0.04
#: Frequencies are known to this part at best: a stretch decays, other effects act.
_FLOOR = 5e-4
#: Declared, they change the period with the amplitude as well as the sine does.
_BENDING = frozenset({"quadratic_stiffness", "cubic_stiffness", "quintic_stiffness"})
#: Beyond it a pendulum turns over [rad].
_LARGEST = 3.0
#: Share of the largest speed up to which a fall is slow, and samples that it needs.
_SLOW, _SAMPLES = 0.5, 8
#: Between these shares of gravity a slow fall begins, buoyancy and drag included.
_SLOWEST, _FASTEST = 0.5, 1.1
#: Standard deviations beyond which something is sure.
_SURE = 4.0
_FULL_TURN = 2.0 * np.pi
_WHITE = 1.2  # difference of neighbours over that from the middle: 1.4 for white noise, little for a swing
_SHORTEST, _LONGEST = 2e-3, 70.0  # lengths of pendulums in laboratories and churches [m]
_LENGTH_MARGIN = 4.0  # ratio of a fitted to a stated length: an extended body swings slower
_CLOCKS = ("s", "ms", "us")  # units in which times are written
_GRAVITY_MARGIN = 10.0  # a slow fall has more than a tenth of gravity, buoyancy and drag included


def angle_doubt(rig: Rig, motions: Sequence[Motion]) -> Flag | None:
    """Return a doubt about the unit of the angle of a pendulum that swings freely; None where there is none.

    Motions are times [s] and angles [rad] of one pendulum; NaN are gaps. A declared law that bends the period leaves no
    doubt: the sine is not alone then.
    """
    if _BENDING.intersection(rig.declared):
        return None
    measured = [row for time, angle in motions for row in _stretches(time, angle)]
    if len(measured) < _FEWEST:
        return None
    amplitude, frequency, sd = np.array(measured).T
    declared = si_factor(rig.columns.output.unit)
    # A period that hardly grows may be that of a pendulum with a spring: only larger units say something.
    larger = [unit for unit in _ANGLES if si_factor(unit) > 2.0 * declared]
    left = {unit: _misfit(amplitude * si_factor(unit) / declared, frequency, sd) for unit in larger}
    stated = _misfit(amplitude, frequency, sd)
    unit = min(left, key=lambda name: left[name], default="")
    if not unit or not left[unit] < _SHARE * stated or stated < _SURE**2 * len(measured):
        return None
    far = float(amplitude.max())
    slower, due = (float(_slowing(np.array(a))) for a in (far * si_factor(unit) / declared, far))
    sizes = {"right": unit, "slower": 100 * slower, "due": 100 * due, "amplitude": far}
    return Flag("angle_unit", unit=rig.columns.output.unit, numbers=sizes)


def _slowing(amplitude: FloatArray) -> FloatArray:
    """Return by which part the period is longer than that of small swings."""
    return ellipk(np.sin(0.5 * amplitude) ** 2) / (0.5 * np.pi) - 1.0


def _misfit(amplitude: FloatArray, frequency: FloatArray, sd: FloatArray) -> float:
    """Return the chi-square of frequencies against the sine's law, the length being free."""
    if amplitude.max() > _LARGEST:
        return np.inf
    law = 1.0 / (1.0 + _slowing(amplitude))
    weight = 1.0 / (sd**2 + (_FLOOR * frequency) ** 2)
    small = np.sum(weight * law * frequency) / np.sum(weight * law**2)
    return float(np.sum(weight * (frequency - small * law) ** 2))


def _stretches(time: FloatArray, angle: FloatArray) -> list[tuple[float, float, float]]:
    """Return amplitude, frequency [rad/s] and its standard deviation in stretches of a few periods."""
    good = np.isfinite(angle)
    if not good.any():
        return []
    t, x = time[good], angle[good] - np.median(angle[good])
    crossings = np.flatnonzero(np.diff(np.signbit(x)))
    if crossings.size < 4 or np.ptp(t) <= 0:
        return []
    first = np.pi / median_step(t[crossings])
    edges = np.arange(t[0], t[-1], _PERIODS * 2.0 * np.pi / first)
    found = []
    for start, stop in pairwise(np.searchsorted(t, edges).tolist()):
        # A coarse encoder may read one value at the end of a decay.
        if stop - start >= 8 * _PERIODS and np.ptp(x[start:stop]) > 0:
            row = _sine(t[start:stop], x[start:stop], first)
            # What noise makes of a stretch says nothing.
            found += [row] if 0.0 < row[2] < 0.02 * row[1] else []
    return found


def _sine(t: FloatArray, x: FloatArray, guess: float) -> tuple[float, float, float]:
    """Fit a decaying sine about a free centre: amplitude in the middle, frequency and its standard deviation."""
    from scipy.optimize import least_squares

    s = t - t.mean()

    def shape(p: FloatArray) -> FloatArray:
        phase = p[0] * s
        swing = (p[1] * np.cos(phase) + p[2] * np.sin(phase)) * (1.0 + p[3] * s)
        return swing + p[4] - x

    scale = np.sqrt(2.0) * np.std(x)
    start = [np.mean(x * f(guess * s)) * 2.0 for f in (np.cos, np.sin)]
    fit = least_squares(shape, [guess, *start, 0.0, 0.0], x_scale=[guess, scale, scale, guess, scale], max_nfev=50)
    slopes = np.asarray(fit.jac, np.float64)
    try:
        covariance = np.linalg.inv(slopes.T @ slopes) * 2.0 * fit.cost / max(t.size - 5, 1)
    except np.linalg.LinAlgError:
        return 0.0, guess, np.inf
    return float(np.hypot(fit.x[1], fit.x[2])), float(abs(fit.x[0])), float(np.sqrt(abs(covariance[0, 0])))


def fall_doubt(rig: Rig, motion: Motion) -> Flag | None:
    """Return a doubt about the units of a fall, times [s] and heights [m]; None where there is none. NaN are gaps."""
    gravity = rig.gravity.value if rig.gravity else np.nan
    good = np.isfinite(motion[1])
    found = slow_fall(motion[0][good], motion[1][good])
    if found is None:
        return None
    fall, sd, slow, rises = found
    # What slows down does not tell of gravity. On the way up drag adds to it.
    too_slow = slow and 0.0 < fall + _SURE * sd < _SLOWEST * gravity
    if not too_slow and (rises or not fall - _SURE * sd > _FASTEST * gravity):
        return None
    declared = si_factor(rig.columns.output.unit)
    fits = [u for u in _LENGTHS if 0.85 < fall * si_factor(u) / declared / gravity < 1.1]
    return Flag("fall_rate", numbers={"found": fall, "gravity": gravity, "right": fits[0] if fits else ""})


def slow_fall(t: FloatArray, height: FloatArray) -> tuple[float, float, bool, bool] | None:
    """Return what acceleration a fall has where it is slow, as at its beginning or at the top of a throw.

    Times [s] and heights [m] are finite. None where they are too few.

    Returned: downwards, with its standard deviation [m/s^2], whether the fall is slow anywhere; where it is not, of its
    first samples; and whether the body rises there.
    """
    if t.size < _SAMPLES:
        return None
    speed = np.abs(np.gradient(height, t))
    # The first run of slow samples: it ends where drag counts, and a bounce later is no fall.
    steps = np.diff((speed <= _SLOW * np.quantile(speed, 0.95)).astype(int), prepend=0, append=0)
    runs = zip(np.flatnonzero(steps > 0).tolist(), np.flatnonzero(steps < 0).tolist(), strict=True)
    first, last = next((run for run in runs if run[1] - run[0] >= _SAMPLES), (0, 0))
    part = slice(first, max(last, _SAMPLES))
    s = t[part] - t[first]
    basis = np.vander(s, 3)
    solution, *_ = np.linalg.lstsq(basis, height[part], rcond=None)
    rest = height[part] - basis @ solution
    variance = np.sum(rest**2) / max(s.size - 3, 1) * np.linalg.inv(basis.T @ basis)[0, 0]
    rises = bool(height[part][-1] > height[first])
    return -2.0 * float(solution[0]), 2.0 * float(np.sqrt(variance)), last > 0, rises


def check_units(found: Signals, rig: Rig) -> None:
    """Refuse a motion that gravity cannot have made; only pendulums and falling bodies are held against it.

    Refused is a pendulum that swings through more than a turn and back or comes to rest upright, and what swings or
    falls as in another gravity by a factor that only a wrong unit explains.
    """
    if rig.gravity is None or rig.view is not None:
        return
    output = found.outputs["output"]
    good = np.isfinite(output)
    t, y = found.time[good], output[good]
    if rig.traits.hangs and found.inputs is None:
        _check_swing(found.at("output"), rig, y, float(np.nanmax(np.abs(found.table.numbers(found.names["output"])))))
        # Too slow or too fast is more often the time's fault than the angle's.
        _check_pace(found.at("time") if "time" in found.names else str(found.table.path), rig, t, y)
    elif rig.traits.falls:
        _check_fall(found.at("output"), rig.gravity.value, t, y)


def _check_swing(where: str, rig: Rig, angle: FloatArray, largest: float) -> None:
    """Refuse a swing that gravity cannot have made; `largest` is the largest reading as it stands in the column."""
    unit = rig.columns.output.unit
    driven = f" The motion runs on in one direction. {DRIVEN}" if runs_on(angle, "1") else ""
    swing = float(np.quantile(angle, 0.98) - np.quantile(angle, 0.02))
    # One that first turns over does so in one sense: its later half tells.
    later = angle[angle.size // 2 :]
    later_swing = float(np.quantile(later, 0.98) - np.quantile(later, 0.02))
    if min(swing, later_swing) > _FULL_TURN:
        remedy = 'If the angle is in degrees, set unit = "deg" for the output in the rig file.'
        if unit == "deg":
            remedy = "Correct the unit of the output in the rig file, or leave out what is no swing with samples."
        raise InputError(
            f"{where}: the pendulum would swing to and fro by more than a full turn, and the largest reading would be "
            f"{largest:.4g} {unit}. {remedy}{driven}"
        )
    middle = float(np.median(later))
    if abs(middle) > _ASIDE * np.pi:
        given, quarters = rig.columns.output, round(middle / (0.5 * np.pi))
        zero = given.zero + quarters * 0.5 * np.pi / (given.scale * si_factor(unit))
        place = "upright" if quarters % 2 == 0 else "the horizontal"
        raise InputError(
            f"{where}: the pendulum would swing about {quoted(middle, unit, 4)}, far from where it hangs. If the "
            f"angle is counted from {place}, set zero = {zero:.9g} (in the unit of the column) for the output in the "
            f"rig file, else to what is read at rest.{driven}"
        )
    scatter = float(np.median(np.abs(angle - np.median(angle))))
    # Of a swing that lasts for a small part of the record, medians see only the noise after it. The rms sees only a few
    # wild readings.
    of_steps = float(np.sqrt(np.mean(np.diff(angle) ** 2)) / max(float(np.std(angle)), np.finfo(float).tiny))
    if float(np.median(np.abs(np.diff(angle)))) > _WHITE * scatter and of_steps > _WHITE:
        raise InputError(
            f"{where}: nothing swings. The readings scatter by {quoted(1.48 * scatter, unit)}, each independent of the "
            "one before. Record a swing, or sample it more often than twice a period."
        )


def _check_pace(where: str, rig: Rig, t: FloatArray, angle: FloatArray) -> None:
    """Refuse a swing that is too slow or too fast for gravity."""
    assert rig.gravity is not None  # `check_units` asked
    # From the median time between upward crossings of the median; they count only between excursions that noise does
    # not reach.
    level = angle - np.median(angle)
    far = 0.3 * float(np.quantile(np.abs(level), 0.9))
    sign = np.where(level > far, 1, np.where(level < -far, -1, 0))
    marked = np.flatnonzero(sign)
    up = marked[1:][np.diff(sign[marked]) > 0]
    if up.size <= 3:
        return
    frequency = float(1.0 / np.median(np.diff(t[up])))
    length = rig.gravity.value / (2.0 * np.pi * frequency) ** 2
    stated = rig.length.value if rig.length is not None else None
    shortest, longest = (_SHORTEST, _LONGEST) if stated is None else (stated / _LENGTH_MARGIN, stated * _LENGTH_MARGIN)
    if not shortest < length < longest:
        known = "" if stated is None else f", and the rig file states {stated:.4g} m"
        # A pendulum of a thousandth of the period has a millionth of the length.
        scale = si_factor(rig.columns.time.unit)
        right = next((u for u in _CLOCKS if shortest < (si_factor(u) / scale) ** 2 * length < longest), None)
        hint = "Correct"
        if right is not None and rig.columns.time.rate is None:
            hint = f'If the times are in {right}, set unit = "{right}" for the time in the rig file; else correct'
        raise InputError(
            f"{where}: the pendulum would swing once in {1.0 / frequency:.4g} s, as if it were {length:.4g} m long"
            f"{known}. {hint} the unit of the time or its rate, or the length, in the rig file."
        )


def _check_fall(where: str, gravity: float, t: FloatArray, height: FloatArray) -> None:
    parabola = np.polynomial.Polynomial.fit(t, height, 2)
    fall = -float(parabola.deriv(2)(t[0]))
    # What is thrown down faster than it falls in the end slows down, but keeps falling.
    way = way_of(height)
    if falls_upwards(gravity, t, height):
        raise InputError(
            f"{where}: the body would fall upwards. The output is the height: set scale = -1 for it in the rig file if "
            "the column holds the depth."
        )
    if fall < gravity / _GRAVITY_MARGIN and (slow := slow_fall(t, height)) is not None:
        # At terminal speed it falls without acceleration; only where it is slow, or begins, does gravity show.
        acceleration, sd, seen, _ = slow
        # Nor where it only slows down, as under a parachute that opens.
        most, mean = acceleration + _SURE * sd, way / float(np.ptp(t))
        steady = (not seen and parabola.deriv()(t[0]) < 0.5 * mean < 0.0) or most < 0.0 > way
        fall = gravity if steady else min(most, gravity)
    if not gravity / _GRAVITY_MARGIN < fall < gravity * _GRAVITY_MARGIN:
        raise InputError(
            f"{where}: the body would fall with {fall:.4g} m/s^2 where gravity is {gravity:.4g} m/s^2. Correct the "
            "unit of the time or of the height in the rig file."
        )
