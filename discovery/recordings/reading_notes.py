"""What people should know of a recording before they trust what is found in it, as sentences."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
import numpy.typing as npt

from discovery.declarations.units import quoted
from discovery.recordings.angles import within_half_a_turn
from discovery.recordings.quantisation import quantum
from discovery.recordings.repeated_notes import by_fault
from discovery.recordings.sensor_faults import drift, flat_runs, spikes

__all__ = ["bend_notes", "clean_output", "gap_notes", "misread", "swing_notes", "time_notes"]

FloatArray = npt.NDArray[np.float64]

_JITTER = 0.05  # of a step
_GAP = 1.5  # steps
_RARE = 0.1  # share of the steps
_SLOW, _FAST = 1.0, 1e-6  # steps of mechanical recordings [s]
_COARSE = 0.3  # of the noise
_BENT = 0.9  # rms deflection of a rod [rad]
_STRETCHES = 6  # of an arm's record, each with some swings
_ASIDE = 0.2  # rms of their mean deflections [rad]
_STRAIGHTER = 0.5  # of that, where a column is not what it is called
_MISREAD = (
    "Are its columns exchanged, is one of opposite sign, or is an angle in another unit than its column's name says?"
)
_WHOLE = 0.95  # swings that count as one
_SOME = 3.0  # swings
_SINE = 0.12  # of the standard deviation, what a sine may leave of a part of a swing
_ENOUGH = 300  # samples of a part of a swing


def time_notes(time: FloatArray, assumed: bool) -> list[str]:
    """Tell what is unusual about sample times.

    Parameters
    ----------
    time : array, shape (n,)
        Times [s], strictly increasing.
    assumed : bool
        Whether the sampling rate is not known.
    """
    if assumed:
        return ["The sampling rate is not known: times count samples, and rates and frequencies are per sample."]
    steps = np.diff(time)
    step = float(np.median(steps))
    notes = []
    gaps = steps > _GAP * step
    regular = np.abs(steps[~gaps] - step) < _JITTER * step
    if 0 < gaps.mean() < _RARE and regular.mean() > 0.9:
        missing = int(np.round(steps[gaps] / step - 1.0).sum())
        notes.append(
            f"{_count(missing, 'sample is', 'samples are')} missing in {_count(int(gaps.sum()), 'gap')} of the times; "
            f"the longest lasts {steps.max():.4g} s. The motion is computed through them, an input is interpolated."
        )
    elif np.quantile(np.abs(steps - step), 0.95) > _JITTER * step:
        kind = "come in bursts" if steps.mean() > 2.0 * step else "jitter"
        notes.append(
            f"The time stamps {kind}: their steps lie between {steps.min():.4g} and {steps.max():.4g} s. "
            "They are taken as they are."
        )
    if not _FAST < step < _SLOW:
        right, times = ("milliseconds", "too long") if step >= _SLOW else ("seconds", "too short")
        notes.append(
            f"The samples are {step:.4g} s apart. If the times are in {right}, they are {times} by a thousand: correct "
            "the unit or the rate in the rig file."
        )
    return notes


def bend_notes(motor_angle: FloatArray, outputs: Mapping[str, FloatArray]) -> list[str]:
    """Tell of an arm whose tip does not point where the motor does: its columns may not be what they are called.

    Parameters
    ----------
    motor_angle : array, shape (n,)
        [rad].
    outputs : mapping of str to array, shape (n,)
        Readings [m or rad], NaN in gaps.
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
    hint = f" With {likely} it would lie {left:.2g} rad beside it on average, not {aside:.2g}." if mistaken else ""
    more = ", more than a rod bends in use" if bend > _BENT else ""
    return [f"The tip lies {bend:.2g} rad beside the motor's direction (rms){more}.{hint} {_MISREAD}"]


def misread(notes: Mapping[str, Iterable[str]]) -> list[str]:
    """Return a sentence for each mistake in columns that notes, by recording, tell of, with its first numbers."""
    return [
        f"{first}: {note}" + (f" So in {', '.join(name for name, _ in others)}." if others else "")
        for (first, note), *others in by_fault(notes, _mistake).values()
    ]


def _mistake(note: str) -> tuple[str, str] | None:
    """Return the likely mistake in columns that a note tells of, which stands before its numbers, and the note."""
    return (note.partition(" With ")[2].partition(" it would ")[0], note) if note.endswith(_MISREAD) else None


def _aside(angle: FloatArray) -> float:
    """Return how far an angle lies from zero once swings are averaged out [rad]."""
    parts = [part[np.isfinite(part)] for part in np.array_split(within_half_a_turn(angle), _STRETCHES)]
    return float(np.sqrt(np.mean([part.mean() ** 2 for part in parts if part.size])))


def gap_notes(label: str, time: FloatArray, values: FloatArray) -> list[str]:
    """Tell of cells that the file leaves empty.

    Parameters
    ----------
    label : str
        Column, for the sentence.
    time, values : array, shape (n,)
        Times [s] and readings as the file has them, NaN where a cell is empty.
    """
    empty = np.flatnonzero(np.isnan(values))
    if empty.size == 0 or empty.size == values.size:
        return []
    runs = np.split(empty, np.flatnonzero(np.diff(empty) > 1) + 1)
    longest = max(runs, key=len)
    where = f"the first at {time[empty[0]]:.4g} s"
    if longest.size > 1:
        where = f"up to {longest.size} in a row, from {time[longest[0]]:.4g} s"
    count = _count(empty.size, "empty cell")
    return [f"{label!r} has {count} in {values.size} rows, {where}: gaps, which are not compared."]


def swing_notes(label: str, time: FloatArray, values: FloatArray, period: float | None = None) -> list[str]:
    """Tell of a free motion that ends before it has swung a few times to and fro.

    A sine that fits the whole motion says how much of a swing it is; one of many swings fits no slow sine.

    Parameters
    ----------
    label : str
        Column, for the sentence.
    time, values : array, shape (n,)
        Times [s] and readings, NaN in gaps.
    period : float, optional
        Shortest period that the rig allows [s].
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
    if swings >= _WHOLE:
        return [
            f"{label!r} holds about {swings:.2g} swings ({duration:.3g} s): few to tell damping and weak forces apart. "
            "Better record ten."
        ]
    return [
        f"{label!r} holds about {swings:.1g} of a swing ({duration:.3g} s): frequency, damping and the form of the "
        "force are hardly told apart. If it swings at all, record several swings, better ten: without a hold-out, the "
        "last third judges."
    ]


def _beside_a_sine(turns: FloatArray, values: FloatArray) -> float:
    """Return the standard deviation of what a sine with a mean leaves of values, its phase in turns."""
    phase = 2.0 * np.pi * turns
    sine = np.column_stack([np.ones_like(phase), np.cos(phase), np.sin(phase)])
    return float(np.std(values - sine @ np.linalg.lstsq(sine, values, rcond=None)[0]))


def clean_output(
    label: str, unit: str, time: FloatArray, values: FloatArray, noise: float, returns: bool
) -> tuple[FloatArray, list[str]]:
    """Leave out what the instrument did not measure, and tell what else is unusual.

    Parameters
    ----------
    label, unit : str
        Column and its unit in the file, for the sentences.
    time, values : array, shape (n,)
        Times [s] and readings; NaN are gaps.
    noise : float
        Standard deviation of a reading.
    returns : bool
        Whether the system has a rest position, so that its mean must not creep.

    Returns
    -------
    values : array, shape (n,)
        With NaN for stuck and clipped readings; the same array where there are none.
    notes : list of str
    """
    step = quantum(values)
    rounding = step / np.sqrt(12.0)
    notes = []
    if rounding > _COARSE * noise:
        notes.append(
            f"{label!r} reads in steps of {quoted(step, unit, 4)}: its noise is taken as at least "
            f"{quoted(rounding, unit)}, the standard deviation of rounding."
        )
    flat = flat_runs(values, max(noise, step))
    if flat.stretches:
        start, length = max(flat.stretches, key=lambda run: run[1])
        count, total = len(flat.stretches), int(flat.stuck.sum())
        where = "for" if count == 1 else f"in {count} stretches, {total} samples in all, the longest of"
        notes.append(
            f"{label!r} is stuck {where} {length} samples from {time[start]:.4g} s, while the system moves. "
            "They are left out."
        )
    if flat.limits:
        at = " and ".join(quoted(limit, unit, 4) for limit in flat.limits)
        notes.append(
            f"{label!r} saturates at {at}: {int(flat.clipped.sum())} clipped samples are left out. Widen the "
            "instrument's range."
        )
    kept = values if not flat.stretches and not flat.limits else np.where(flat.stuck | flat.clipped, np.nan, values)
    found = spikes(kept, noise)
    if found.size:
        notes.append(
            f"{label!r} has {_count(found.size, 'spike')}, far from where the readings beside them would put them, the "
            f"first at {time[found[0]]:.4g} s. They are kept."
        )
    if returns and (creep := drift(time, kept)):
        notes.append(
            f"The mean of {label!r} creeps by {quoted(creep, unit)} over the record: a drifting instrument, or a rest "
            "position that moves."
        )
    return kept, notes


def _count(number: int, one: str, several: str = "") -> str:
    return f"{number} {one if number == 1 else several or one + 's'}"
