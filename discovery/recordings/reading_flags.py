"""What people should know of a recording before they trust what is found in it, as flags."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from discovery.foundation.arrays import BoolArray, FloatArray, within_half_a_turn
from discovery.foundation.sampling import are_uneven, gaps, median_step
from discovery.recordings.flags import MISREAD, Flag
from discovery.recordings.range_ends import cut_off
from discovery.recordings.rounding import quantum
from discovery.recordings.sensor_faults import drift, flat_runs, lost, spikes
from discovery.rigs.rig import TimeColumn

_JITTER = 0.05  # of a step
_RARE, _MOST = 0.1, 0.9  # share of the steps
_BURSTS = 2.0  # mean over median step
_SLOW, _FAST = 1.0, 1e-6  # steps of mechanical recordings [s]
_COARSE = 0.3  # of the noise
_BENT = 0.9  # rms deflection of a rod [rad]
_STRETCHES = 6  # of an arm's record, each with some swings
_ASIDE = 0.2  # rms of their mean deflections [rad]
_STRAIGHTER = 0.5  # of that, where a column is not what it is called
_WHOLE = 0.95  # swings that count as one
_SOME = 3.0  # swings
_SINE = 0.12  # of the standard deviation, what a sine may leave of a part of a swing
_ENOUGH = 300  # samples of a part of a swing


def time_flags(time: FloatArray, column: TimeColumn, *, marks: bool = False) -> list[Flag]:
    """Tell what is unusual about sample times [s], strictly increasing, of a column.

    Those at which `marks` passed come as the motion brings them.
    """
    if column.assumed:
        return [Flag("rate_unknown")]
    steps = np.diff(time)
    step = median_step(time)
    flags = [Flag("clock_far", numbers={"zero": column.zero})] if column.zero else []
    if marks:
        return [*flags, Flag("read_at_marks", numbers={"shortest": float(steps.min()), "longest": float(steps.max())})]
    missed = gaps(time)
    regular = np.abs(steps[~missed] - step) < _JITTER * step
    # Many rows are lost, too, where every step is a whole number of steps of one clock.
    lost = np.abs(steps / step - np.round(steps / step)) < _JITTER
    few = missed.mean() < _RARE or (lost.mean() > _MOST and steps.mean() < _BURSTS * step)
    if missed.any() and few and regular.mean() > _MOST:
        missing = int(np.round(steps[missed] / step - 1.0).sum())
        sizes = {"missing": missing, "gaps": int(missed.sum()), "longest": float(steps.max())}
        flags.append(Flag("samples_missing", numbers=sizes))
    elif are_uneven(time):
        kind = "come in bursts" if steps.mean() > _BURSTS * step else "are uneven"
        between = {"shortest": float(steps.min()), "longest": float(steps.max())}
        flags.append(Flag("times_irregular", numbers={"kind": kind, **between}))
    if not _FAST < step < _SLOW:
        # A log of a reading a second is usual; nothing mechanical is read every nanosecond.
        by = f" by their unit, {column.unit}" if column.rate is None else ""
        flags.append(Flag("times_long" if step >= _SLOW else "times_short", numbers={"step": step, "by": by}))
    return flags


def bend_flags(motor_angle: FloatArray, outputs: Mapping[str, FloatArray]) -> list[Flag]:
    """Tell of an arm whose tip does not point where the motor does: its columns may not be what they are called.

    The motor's angle [rad] and the outputs [m or rad] have the shape (n,), NaN in gaps.
    """
    if "tip_x" in outputs:
        x, y = outputs["tip_x"], outputs["tip_y"]
        direction = np.arctan2(y, x)
        mistakes = {
            "tip_x and tip_y exchanged": np.arctan2(x, y) - motor_angle,
            "tip_x of opposite sign": np.arctan2(y, -x) - motor_angle,
            "the motor's angle or tip_y of opposite sign": direction + motor_angle,
        }
    elif "tip_angle" in outputs:
        direction = outputs["tip_angle"]
        mistakes = {"the motor's angle or the tip's of opposite sign": direction + motor_angle}
    else:
        return []
    bend = float(np.sqrt(np.nanmean(within_half_a_turn(direction - motor_angle) ** 2)))
    aside = _aside(direction - motor_angle)
    likely, left = min(((name, _aside(angle)) for name, angle in mistakes.items()), key=lambda found: found[1])
    # A rod swings about the motor's direction: its mean tells of a mistake that is no larger than a bend in use.
    mistaken = aside > _ASIDE and left < min(_ASIDE, _STRAIGHTER * aside)
    if bend <= _BENT and not mistaken:
        return []
    return [Flag(MISREAD, numbers={"bend": bend, "likely": likely if mistaken else "", "left": left, "aside": aside})]


def _aside(angle: FloatArray) -> float:
    """Return how far an angle lies from zero once swings are averaged out [rad]."""
    parts = [part[np.isfinite(part)] for part in np.array_split(within_half_a_turn(angle), _STRETCHES)]
    return float(np.sqrt(np.mean([part.mean() ** 2 for part in parts if part.size])))


def gap_flags(label: str, time: FloatArray, values: FloatArray) -> list[Flag]:
    """Tell of cells of a column that the file leaves empty, NaN in its values, at times [s]."""
    empty = np.flatnonzero(np.isnan(values))
    if empty.size == 0 or empty.size == values.size:
        return []
    runs = np.split(empty, np.flatnonzero(np.diff(empty) > 1) + 1)
    longest = max(runs, key=len)
    start = longest[0] if longest.size > 1 else empty[0]
    sizes = {"count": empty.size, "rows": values.size, "longest": longest.size, "start": float(time[start])}
    return [Flag("cells_empty", label, numbers=sizes)]


def swing_flags(label: str, time: FloatArray, values: FloatArray, period: float | None = None) -> list[Flag]:
    """Tell of a free motion that ends before it has swung a few times to and fro.

    A sine that fits the whole motion says how much of a swing it is; one of many swings fits no slow sine. `period` is
    the shortest that the rig allows [s]. NaN are gaps.
    """
    good = np.flatnonzero(np.isfinite(values))
    duration = float(time[-1] - time[0])
    if good.size < 4 or np.ptp(values[good]) == 0.0:
        return []
    x, u = values[good] - values[good].mean(), (time[good] - time[0]) / duration
    some = slice(None, None, max(1, good.size // _ENOUGH))
    swings = float(min(np.arange(0.1, _SOME + 0.3, 0.02), key=lambda tried: _beside_a_sine(tried * u[some], x[some])))
    # Some of its samples may look slow where all of them swing fast.
    if _beside_a_sine(swings * u, x) > _SINE * float(np.std(x)):
        # No sine: many swings, or part of a very large one, which the rig knows.
        swings = np.inf if period is None else duration / period
    if swings > _SOME:
        return []
    code = "swings_few" if swings >= _WHOLE else "swing_cut"
    return [Flag(code, label, numbers={"swings": float(swings), "duration": duration})]


def _beside_a_sine(turns: FloatArray, values: FloatArray) -> float:
    """Return the standard deviation of what a sine with a mean leaves of values, its phase in turns."""
    phase = 2.0 * np.pi * turns
    sine = np.column_stack([np.ones_like(phase), np.cos(phase), np.sin(phase)])
    return float(np.std(values - sine @ np.linalg.lstsq(sine, values, rcond=None)[0]))


def without_unread(
    label: str, unit: str, time: FloatArray, values: FloatArray, still: BoolArray | None = None
) -> tuple[FloatArray, list[Flag]]:
    """Leave out readings (n,) that were lost, or that an end of the instrument's range cuts off, and tell it.

    Their noise is none.
    """
    step, flags = quantum(values, time), []
    gone = lost(values, step)
    if gone.any():
        lacked = {"count": int(gone.sum()), "start": float(time[np.argmax(gone)])}
        flags.append(Flag("readings_lost", label, unit, lacked))
        values = np.where(gone, np.nan, values)
    cut, limits = cut_off(values, step, still)
    if limits:
        numbers = {"limits": [float(limit) for limit in limits], "count": int(cut.sum())}
        flags.append(Flag("readings_clipped", label, unit, numbers))
        values = np.where(cut, np.nan, values)
    return values, flags


def clean_output(
    label: str,
    unit: str,
    time: FloatArray,
    values: FloatArray,
    noise: float,
    returns: bool,
    given: FloatArray | None = None,
    *,
    rate: bool = False,
    driven: bool = False,
    still: BoolArray | None = None,
) -> tuple[FloatArray, list[Flag]]:
    """Leave out what the instrument did not measure, and tell what else is unusual.

    `label`, `unit`: column and its unit in the file. `time`, `values` (n,): times [s] and readings; NaN are gaps.
    `noise`: standard deviation of a reading. `returns`: whether the system has a rest position, so that its mean must
    not creep. `given` (n,): the input. `rate`: whether a speed is read, which may stand still at zero. `driven`:
    whether a position is read of what an input moves, which may come to rest anywhere, where it is `still` (n,) even
    abruptly. Returned: the readings with NaN for stuck and clipped ones, the same array where there are none, and what
    is told.
    """
    step = quantum(values, time)
    rounding = step / np.sqrt(12.0)
    flags = []

    def tell(code: str, **numbers: Any) -> None:
        flags.append(Flag(code, label, unit, numbers))

    if rounding > _COARSE * noise:
        tell("readings_coarse", step=float(step), rounding=float(rounding))
    flat = flat_runs(values, max(noise, step), rate=rate, driven=driven, still=still)
    if flat.stretches:
        start, length = max(flat.stretches, key=lambda run: run[1])
        total = {"stretches": len(flat.stretches), "total": int(flat.stuck.sum())}
        tell("readings_stuck", **total, length=int(length), start=float(time[start]))
    if flat.limits:
        tell("readings_clipped", limits=[float(limit) for limit in flat.limits], count=int(flat.clipped.sum()))
    kept = values if not flat.stretches and not flat.limits else np.where(flat.stuck | flat.clipped, np.nan, values)
    found = spikes(time, kept, noise)
    if found.size:
        tell("spikes", count=int(found.size), start=float(time[found[0]]))
    if returns and (creep := drift(time, kept, noise, given)):
        tell("mean_creeps", creep=float(creep))
    return kept, flags
