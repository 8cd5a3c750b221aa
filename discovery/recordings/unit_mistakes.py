"""Numbers that are plausible in another unit: angles in degrees, times in milliseconds, heights in millimetres."""

from __future__ import annotations

import numpy as np

from discovery.declarations.units import quoted, si_factor
from discovery.foundation.arrays import FloatArray
from discovery.foundation.errors import InputError
from discovery.recordings.file_signals import Signals
from discovery.recordings.gravity_scale import slow_fall
from discovery.recordings.running_on import DRIVEN, runs_on
from discovery.rigs.rig import Rig

_FULL_TURN = 2.0 * np.pi
_WHITE = 1.2  # difference of neighbours over that from the middle: 1.4 for white noise, little for a swing
_SMALLEST, _LARGEST = 2e-3, 70.0  # lengths of pendulums in laboratories and churches [m]
_LENGTH_MARGIN = 4.0  # ratio of a fitted to a stated length: an extended body swings slower
_CLOCKS = ("s", "ms", "us")  # units in which times are written
_GRAVITY_MARGIN = 10.0  # a slow fall has more than a tenth of gravity, buoyancy and drag included
_SURE = 4.0  # standard deviations beyond which something is sure


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
    if abs(float(np.median(later))) > 0.5 * np.pi:
        given = rig.columns.output
        upright = given.zero + np.pi / (given.scale * si_factor(unit))
        raise InputError(
            f"{where}: the pendulum would swing about {quoted(float(np.median(later)), unit, 4)}, that is upright. If "
            f"the angle is counted from upright, set zero = {upright:.9g} (in the unit of the column) "
            f"for the output in the rig file.{driven}"
        )
    scatter = float(np.median(np.abs(angle - np.median(angle))))
    # Of a swing that lasts for a small part of the record, medians see only the noise after it. The rms sees only a few
    # wild readings.
    if float(np.median(np.abs(np.diff(angle)))) > _WHITE * scatter and _rms_of_steps(angle) > _WHITE:
        raise InputError(
            f"{where}: nothing swings. The readings scatter by {quoted(1.48 * scatter, unit)}, each independent of the "
            "one before. Record a swing, or sample it more often than twice a period."
        )


def _rms_of_steps(values: FloatArray) -> float:
    """Return the rms difference of neighbours over the standard deviation."""
    return float(np.sqrt(np.mean(np.diff(values) ** 2)) / max(float(np.std(values)), np.finfo(float).tiny))


def _check_pace(where: str, rig: Rig, t: FloatArray, angle: FloatArray) -> None:
    """Refuse a swing that is too slow or too fast for gravity."""
    assert rig.gravity is not None  # `check_units` asked
    frequency = _frequency(t, angle)
    if frequency is None:
        return
    length = rig.gravity.value / (2.0 * np.pi * frequency) ** 2
    stated = rig.length.value if rig.length is not None else None
    shortest, longest = (_SMALLEST, _LARGEST) if stated is None else (stated / _LENGTH_MARGIN, stated * _LENGTH_MARGIN)
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


def _frequency(t: FloatArray, x: FloatArray) -> float | None:
    """Frequency of a swing from the median time between its upward crossings of the median [Hz]."""
    level = x - np.median(x)
    # Crossings count only between excursions that noise does not reach.
    far = 0.3 * float(np.quantile(np.abs(level), 0.9))
    sign = np.where(level > far, 1, np.where(level < -far, -1, 0))
    marked = np.flatnonzero(sign)
    up = marked[1:][np.diff(sign[marked]) > 0]
    return float(1.0 / np.median(np.diff(t[up]))) if up.size > 3 else None


def _check_fall(where: str, gravity: float, t: FloatArray, height: FloatArray) -> None:
    parabola = np.polynomial.Polynomial.fit(t, height, 2)
    fall = -float(parabola.deriv(2)(t[0]))
    # What is thrown down faster than it falls in the end slows down, but keeps falling.
    if fall < -0.02 * gravity and parabola.deriv()(t[-1]) > 0.0:
        raise InputError(
            f"{where}: the body would fall upwards. The output is the height: set scale = -1 for it in the rig file if "
            "the column holds the depth."
        )
    if fall < gravity / _GRAVITY_MARGIN and (slow := slow_fall(t, height)) is not None:
        # At terminal speed it falls without acceleration; only where it is slow, or begins, does gravity show.
        acceleration, sd, seen = slow
        first, last = parabola.deriv()(t[[0, -1]])
        steady = not seen and first < 0.5 * last < 0.0
        fall = gravity if steady else acceleration + _SURE * sd
    if not gravity / _GRAVITY_MARGIN < fall < gravity * _GRAVITY_MARGIN:
        raise InputError(
            f"{where}: the body would fall with {fall:.4g} m/s^2 where gravity is {gravity:.4g} m/s^2. Correct the "
            "unit of the time or of the height in the rig file."
        )
