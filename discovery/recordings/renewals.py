"""Readings of a sensor that was asked more often than it measures: it repeats the one before until it has a new one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from discovery.foundation.arrays import BoolArray, FloatArray, IntArray
from discovery.foundation.sampling import median_step
from discovery.recordings.file_signals import Signals
from discovery.recordings.flags import REPEATED, Flag
from discovery.recordings.reading_noise import estimate_noise
from discovery.recordings.rounding import are_marks, quantum

_FEWEST = 40  # readings
_PASSING = 5.0  # steps or noise sds, by more of which a reading lies beyond the one before it, and the next beyond it
_SOME, _SHARE = 8, 0.1  # repeated readings in a motion that passes, and their share of such readings
_REGULAR = 0.9  # share of such readings that last for as many rows as usual, to the next whole number,
_MOSTLY, _LONGER = (
    0.5,
    2.0,
)  # or share that lasts for more than one row, where so many are no longer than this many usual
_AGREES = 0.95  # share of the rows of which a clock must tell whether they repeat
_WINDOW = 256  # rows from which the clock is sought first
_RANGE, _FINE = 0.06, 0.1  # of its rate, and ticks over a window: where a clock is sought, and in what steps
_HINT, _EQUAL = 0.1, 1e-9  # weight of a row that may repeat by itself, and of nothing
_PHASES, _AGAIN = 24, 10.0  # phases that are tried, and steps of the rate over which it is sought again
_BESIDE, _NEARLY_ALL = 0.6, 0.98  # steps of the rows, by which most readings come no farther from the middle of two


@dataclass(frozen=True)
class Renewals:
    """When a sensor renewed its reading.

    `fresh` marks the rows (n,) that hold a new one, `share` are repeats among rows in which it moved, `rate` is its own
    rate [Hz]. `time` are times [s] of the new ones on its steady clock; None where no such clock explains the repeats.
    """

    fresh: BoolArray
    share: float
    rate: float
    time: FloatArray | None


def renewals(time: FloatArray, values: FloatArray) -> Renewals | None:
    """Find readings (n,) at times [s] that repeat the one before because the sensor had no new one; None without any.

    A motion that goes on one way, by far more than the noise and the resolution of a reading from each to the next,
    does not stand still in between. At rest, at a turn, and where steps are coarse beside the motion, readings repeat
    by themselves: such say nothing. Few long repeats are those of a sensor that sticks.
    """
    starts = np.flatnonzero(np.concatenate([[True], np.diff(values) != 0.0]))
    lengths, new = np.diff(np.append(starts, values.size)), values[starts]
    few = values.size < _FEWEST or starts.size < _SOME
    if few or starts.size > (1.0 - 0.5 * _SHARE) * values.size or are_marks(time, values):
        return None
    error = max(quantum(values), estimate_noise(new), np.finfo(float).tiny)
    passing = _passing(new, error)
    own = lengths[passing]
    if np.count_nonzero(own > 1) < max(_SOME, _SHARE * own.size):
        return None
    usual = float(own.mean())
    most = np.ceil(usual)
    if np.mean((own >= np.floor(usual)) & (own <= most)) < _REGULAR:
        # A camera whose frames are late now and then.
        most = np.ceil(_LONGER * usual)
        if np.mean(own > 1) < _MOSTLY or np.mean(own <= most) < _REGULAR:
            return None
    told = np.flatnonzero(passing)
    rate = float(told.size / np.sum(time[starts[told + 1]] - time[starts[told]]))
    begins = np.zeros(values.size, bool)
    begins[starts] = True
    # What differs from the row before is new, whatever moves.
    clock = _clock(time, begins, begins | np.repeat(passing, lengths), rate)
    share = 1.0 - float(own.size / own.sum())
    # Without a clock, nobody can tell a repeat from an equal reading where nothing moves, and moves on from there.
    rests = (lengths > most) & np.append(np.abs(np.diff(new)) <= _PASSING * error, True)
    gapped = Renewals(begins | np.repeat(rests, lengths), share, rate, None)
    if clock is None:
        return gapped
    rows, ticks = _rows_of_ticks(time, begins, *clock)
    # A reading came at any moment between its row and the one before. Rows of equal ones are told by the clock itself.
    seen = begins[rows] & (rows > 0)
    middle = 0.5 * (time[rows[seen]] + time[rows[seen] - 1])
    line = np.polynomial.Polynomial.fit(ticks[seen], middle, 1)
    if np.mean(np.abs(line(ticks[seen]) - middle) < _BESIDE * median_step(time)) < _NEARLY_ALL:
        return gapped
    return Renewals(np.isin(np.arange(values.size), rows), share, float(1.0 / line.deriv()(0.0)), line(ticks))


def _passing(new: FloatArray, error: float) -> BoolArray:
    """Return which of readings (m,), each unlike the one before, a motion passes on one way, far beyond their error."""
    steps = np.diff(new) / error
    ways = np.where(np.abs(steps) > _PASSING, np.sign(steps), 0.0)
    return np.pad(ways[:-1] * ways[1:] > 0.0, 1)


def _rows_of_ticks(time: FloatArray, begins: BoolArray, rate: float, phase: float) -> tuple[IntArray, IntArray]:
    """Return the rows that hold a new reading, and the ticks of the clock that brought them, both (m,).

    They are those that begin another reading, and the first ones after ticks that brought an equal one.
    """
    at = (time - time[0]) * rate + phase
    ticks = np.floor(at).astype(np.int64)
    seen = np.flatnonzero(begins)
    first = np.flatnonzero(np.diff(ticks, prepend=ticks[0] - 1) > 0)
    # A tick lies between a row and the one before, or next to both.
    before = at[np.maximum(seen - 1, 0)]
    late = (ticks[seen] <= before) & (ticks[seen] + 1.0 - at[seen] < before - ticks[seen])
    of_seen = ticks[seen] + late
    of_seen[:1] = np.minimum(of_seen[:1], of_seen[1:2] - 1)  # the first may have come long before
    rows = np.concatenate([seen, first])
    found, which = np.unique(np.concatenate([of_seen, ticks[first]]), return_index=True)
    rising = np.diff(np.maximum.accumulate(rows[which]), prepend=-1) > 0
    return rows[which][rising], found[rising]


def _clock(time: FloatArray, begins: BoolArray, known: BoolArray, rate: float) -> tuple[float, float] | None:
    """Return rate [Hz] and phase of a steady clock that ticks before each row that `begins` a reading, and no other.

    It must tell the rows that are `known`; the others decide between clocks that do. It is sought over more and more
    rows, each time about the one that was found. None where there is no such clock.
    """
    reach, stop = _RANGE, min(_WINDOW, time.size)
    while True:
        part = slice(0, stop)
        step = _FINE / ((time[stop - 1] - time[0]) * rate)
        rates = rate * (1.0 + np.arange(-reach, reach + step, step))
        phases = (np.arange(_PHASES) + 0.5) / _PHASES
        found = [_agreement(time[part], begins[part], known[part], tried, phases) for tried in rates]
        right = np.array([of_all for of_all, _ in found])
        best = right >= right.max() - _EQUAL
        # In the middle of all clocks that fit.
        fitting = np.flatnonzero(best.any(axis=1))
        chosen = fitting[fitting.size // 2]
        phase = float(np.angle(np.mean(np.exp(2j * np.pi * phases[best[chosen]]))) / (2.0 * np.pi)) % 1.0
        rate, reach = float(rates[chosen]), _AGAIN * step
        if found[chosen][1].max() < _AGREES:
            return None
        if stop == time.size:
            return rate, phase
        stop = min(2 * stop, time.size)


def _agreement(
    time: FloatArray, begins: BoolArray, known: BoolArray, rate: float, phases: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return which share of rows a clock tells right for each phase: of all, by weight, and of those that are known."""
    told = np.diff(np.floor((time - time[0]) * rate + phases[:, None]), axis=1) > 0
    right = told == begins[1:]
    weights = np.where(known[1:], 1.0, _HINT)
    return right @ weights / weights.sum(), right[:, known[1:]].mean(axis=1)


def on_sensors_clock(found: Signals) -> list[Flag]:
    """Leave out the readings that repeat the one before because the sensor had no new one, and tell it.

    Where nothing else is read, their rows go, and the others take the times of the sensor's own clock. An input keeps
    its times, and outputs have gaps.
    """
    flags = []
    for channel, values in found.outputs.items():
        renewed = renewals(found.time, values)
        if renewed is None:
            continue
        moved = renewed.time is not None and found.inputs is None and len(found.outputs) == 1
        step = median_step(found.time)
        numbers = {"share": renewed.share, "rate": renewed.rate, "polled": 1.0 / step, "step": step, "moved": moved}
        flags.append(Flag(REPEATED, found.names[channel], found.units[channel], numbers))
        if moved and renewed.time is not None:
            found.keep(np.flatnonzero(renewed.fresh))
            found.time = renewed.time - renewed.time[0] + found.time[0]
        else:
            found.outputs[channel] = np.where(renewed.fresh, values, np.nan)
    return flags
