"""Readings that the instrument did not measure: stuck, clipped, lost, spiked; and a mean that creeps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from discovery.foundation.arrays import BoolArray, FloatArray, IntArray
from discovery.foundation.sampling import stretches
from discovery.recordings.time_stamps import left_by_cubics

_SHORTEST_CLIPPED = 3  # equal readings at the extreme
_SHORTEST_STUCK = 10  # equal readings elsewhere
_LOST, _LONGEST_LOST = 3, 3  # how often zeros must come that are no readings, and how many in a row at most
_FAR_OFF = 6.0  # usual steps between readings, and quanta, that lie between them and their neighbours
_TRAVEL = 30.0  # quanta or noise sds that the signal covers beside a run, in as many samples
# Speed at the edge of a run against that beside it: a motion that comes to rest slows down first, one that turns is
# half as fast there.
_ABRUPT_STUCK = 0.8
_ABRUPT_CLIPPED = 0.5
_EDGE = 2  # samples that tell the speed at the edge, at least
_SEEN = 5.0  # quanta or noise sds that they must cover
_JUMP = 3.0  # largest changes of the step just before
_SPIKE = 12.0  # robust sds
_OF_EVEN = np.sqrt(70.0) / 6.0  # sd of what misses the cubic through evenly spaced neighbours [noise sds]
_WIDE = 2.0  # times the usual span of neighbours
_NEIGHBOURHOOD = 25  # samples on either side of a spike that tell what is usual
IDLE = 0.5  # share of a stay in which nothing pushes, from which a drive rests there
_PERIODS = 4.0  # over which a mean is taken
_CREEP = 0.05  # of the signal's sd
_CERTAIN = 3.0  # standard errors
_STILL = 2.0  # noise sds about a straight line over a period
_RESTS = 3  # periods


@dataclass(frozen=True)
class FlatRuns:
    """Samples (n,) of a signal that stand still where the signal cannot.

    `stuck` and `clipped` mark readings to be left out: the repeats of a stuck reading, with the first of them where a
    jump leads to it, and those at the end of the instrument's range. `stretches` have the first sample that is left out
    and the number of them, of each stuck stretch; `limits` are the values at which the readings are clipped.
    """

    stuck: BoolArray
    clipped: BoolArray
    stretches: tuple[tuple[int, int], ...]
    limits: tuple[float, ...]


def flat_runs(
    values: FloatArray, error: float, *, rate: bool = False, driven: bool = False, still: BoolArray | None = None
) -> FlatRuns:
    """Find equal readings in a row between which the system was moving; NaN are gaps.

    A motion that turns or comes to rest slows down before it stands still, and a quantised one covers only a few
    quanta beside a turning point. A run is a fault if the signal covers far more in as many samples beside it, and
    enters or leaves it at speed; at the extreme of all readings it is clipped, elsewhere it is stuck. A run that begins
    with a jump, as of an instrument that falls to a dead value, is stuck at the extreme too, and as a whole.

    `error` is the standard deviation of a reading, or the quantum if that is larger. Where `rate` says that a speed is
    read, dry friction ends it abruptly: zero, to which no jump leads, is a standstill. So is any place of what is
    `driven`, where it slows down before, and moves on from there without a jump; or, however it comes there, where it
    may stand by itself most of the time, `still` (n,), as nothing pushes.
    """
    change = np.flatnonzero(np.concatenate([[True], np.diff(values) != 0.0, [True]]))
    starts, lengths = change[:-1], np.diff(change)
    finite = values[np.isfinite(values)]
    stuck = np.zeros(values.size, bool)
    stretches: list[tuple[int, int]] = []
    at_limit: dict[float, list[tuple[int, int]]] = {}
    extremes = (float(np.min(finite, initial=np.inf)), float(np.max(finite, initial=-np.inf)))
    for run in zip(starts[1:].tolist(), lengths[1:].tolist(), strict=True):  # a record may begin at rest
        start, length = run
        limit = values[start] in extremes
        if length < (_SHORTEST_CLIPPED if limit else _SHORTEST_STUCK):
            continue
        if not _interrupts(values, *run, error, _ABRUPT_CLIPPED if limit else _ABRUPT_STUCK):
            continue
        if rate and abs(values[start]) <= error and not _jumps(values, *run, error):
            continue
        idle = still is not None and np.mean(still[start : start + length]) > IDLE
        if driven and (_rests(values, *run, error) or (idle and not _jumps(values, *run, error))):
            continue
        if limit:
            at_limit.setdefault(float(values[start]), []).append(run)
        else:
            stretches.append(run)
    limits = []
    for value, runs in sorted(at_limit.items()):
        if len(runs) > 1 and not all(_jumps(values, *run, error) for run in runs):
            limits.append(value)
        else:
            stretches += [run for run in runs if len(runs) > 1 or run[1] >= _SHORTEST_STUCK]
    # A reading that the instrument stuck at was measured; one that it jumped to was not.
    kept = [not _jumps(values, *run, error) for run in stretches]
    stretches = sorted((start + k, length - k) for (start, length), k in zip(stretches, kept, strict=True))
    for start, length in stretches:
        stuck[start : start + length] = True
    return FlatRuns(stuck, np.isin(values, limits), tuple(stretches), tuple(limits))


def _jumps(values: FloatArray, start: int, length: int, error: float) -> bool:
    """Whether a run of equal readings begins where the motion before it would not have come to in a step."""
    near = values[max(0, start - max(length, 2 * _EDGE)) : start]
    near = near[np.isfinite(near)]
    if near.size < 3:
        return False
    # A motion that is stopped, or clipped, ends between where it was and where it would have gone on to.
    low, high = sorted((near[-1], 2.0 * near[-1] - near[-2]))
    beyond = max(low - values[start], values[start] - high)
    return bool(beyond > _JUMP * np.abs(np.diff(near, 2)).max() + _SEEN * error)


def _rests(values: FloatArray, start: int, length: int, error: float) -> bool:
    """Whether what moves slows down to a run of equal readings, and moves on from it, where it moves on.

    The motion goes on behind a sensor that sticks, and the reading jumps after it.
    """
    before = values[max(0, start - 2 * _EDGE) : start + 1][::-1]
    if before.size <= 2 * _EDGE or not np.isfinite(before).all() or _jumps(values, start, length, error):
        return False
    last, earlier = abs(before[_EDGE] - before[0]), abs(before[2 * _EDGE] - before[_EDGE])
    slows = last <= max(_ABRUPT_STUCK * earlier, _SEEN * error)
    return bool(slows and not _jumps(values[::-1], values.size - start - length, length, error))


def _interrupts(values: FloatArray, start: int, length: int, error: float, abrupt: float) -> bool:
    """Whether a run of equal readings interrupts a motion."""
    stop = start + length
    width = max(length, 2 * _EDGE)
    sides = [values[max(0, start - width) : start + 1][::-1], values[stop - 1 : stop + width]]
    sides = [side for side in sides if side.size > 2 * _EDGE and np.isfinite(side).all()]
    if not sides or any(np.ptp(side) < _TRAVEL * error for side in sides):
        return False
    if _jumps(values, start, length, error):
        return True
    for side in sides:
        # Over fewer samples a slow motion is hidden by the error.
        edge = max(_EDGE, int(np.ceil(_SEEN * error / np.abs(np.diff(side)).mean())))
        if side.size > 2 * edge:
            usual = np.median(np.abs(side[edge:] - side[:-edge]))
            if abs(side[edge] - side[0]) > abrupt * usual:
                return True
    return False


def lost(values: FloatArray, step: float) -> BoolArray:
    """Return which readings (n,) are zeros of an instrument that read nothing, of one that reads in steps.

    A motion does not come from afar to exactly zero, and go back where it was, in a reading or three, time and again. A
    standstill lasts longer; what passes through zero goes on to the other side. NaN are gaps.
    """
    zero = values == 0.0
    steps = np.abs(np.diff(values))[~zero[1:] & ~zero[:-1]]
    found = np.zeros(values.size, bool)
    if not np.isfinite(steps).any():
        return found
    far = _FAR_OFF * max(float(np.nanmedian(steps)), step)
    short = [(a, b) for a, b in stretches(zero) if a > 0 and b < zero.size and b - a <= _LONGEST_LOST]
    sides = [(a, b, values[a - 1], values[b]) for a, b in short]
    gone = [(a, b) for a, b, before, after in sides if before * after > 0 and min(abs(before), abs(after)) > far]
    for a, b in gone if len(gone) >= _LOST else ():
        found[a:b] = True
    return found


def spikes(time: FloatArray, values: FloatArray, error: float) -> IntArray:
    """Return the samples of single readings far from where their neighbours put them.

    A cubic through two neighbours on either side predicts a reading. A spike misses its prediction by far more than is
    usual around it, and pulls the predictions beside it two thirds as far to the other side. Neighbours that lie across
    a gap of the times [s] predict nothing. `error` is the standard deviation of a reading; NaN are gaps.
    """
    if values.size < 4 * _NEIGHBOURHOOD:
        return np.empty(0, np.int64)
    miss = np.zeros(values.size)
    wide = time[4:] - time[:-4] > _WIDE * np.median(time[4:] - time[:-4])
    miss[2:-2] = np.where(wide, 0.0, _OF_EVEN * left_by_cubics(time, values)[0])
    size = np.abs(np.nan_to_num(miss))
    around = np.lib.stride_tricks.sliding_window_view(
        np.pad(size, _NEIGHBOURHOOD, mode="reflect"), 2 * _NEIGHBOURHOOD + 1
    )
    candidates = np.flatnonzero(size > _SPIKE * max(error, 1.4826 * float(np.median(size))))
    usual = 1.4826 * np.median(around[candidates], axis=1)
    before, here, after = miss[candidates - 1], miss[candidates], miss[np.minimum(candidates + 1, values.size - 1)]
    opposite = (before * here < 0) & (after * here < 0)
    large = np.minimum(np.abs(before), np.abs(after)) > 0.4 * np.abs(here)
    return candidates[(np.abs(here) > _SPIKE * usual) & opposite & large]


def drift(time: FloatArray, values: FloatArray, error: float, given: FloatArray | None = None) -> float:
    """Give by how much the mean about which a signal swings creeps over the record, in its unit.

    The slow part of a motion has a trend too, by chance or because its input has one. Such a trend is no creeping, nor
    is that of a free body which dry friction stops off its middle: where it stands still in the end, that part tells.

    It is the change over the whole record of a straight line through means over four periods, or through the readings
    at the end that stand still; 0 if it is below a twentieth of the signal's standard deviation, or below three of its
    own standard errors, or the record is shorter than four such windows. `error` is the standard deviation of a reading
    at times [s], `given` the input, which a slow motion follows. NaN are skipped.
    """
    good = np.isfinite(values)
    even = np.linspace(time[0], time[-1], time.size)
    x = np.interp(even, time[good], values[good])
    given = None if given is None else np.interp(even, time, given)
    spectrum = np.abs(np.fft.rfft((x - x.mean()) * np.hanning(x.size)))
    first = 2  # a creeping mean itself lies below
    peak = first + int(np.argmax(spectrum[first:]))
    width = round(_PERIODS * x.size / peak)
    if 4 * width > x.size:
        return 0.0
    rest = _stands_still(x, x.size // peak, error) if given is None else 0
    if rest:
        span, (change, doubt) = rest, _trend(x[-rest:], [])
        doubt = max(doubt, error * np.sqrt(12.0 / rest))
    else:
        window = np.hanning(width + 2)[1:-1]  # no side lobes that the swing could pass through
        slow = [np.convolve(signal, window / window.sum(), mode="valid") for signal in (x, given) if signal is not None]
        span, (change, doubt) = slow[0].size, _trend(slow[0], slow[1:])
    whole = (x.size - 1) / (span - 1)  # of the record
    return whole * change if abs(whole * change) > max(_CREEP * float(np.std(x)), _CERTAIN * whole * doubt) else 0.0


def _stands_still(values: FloatArray, period: int, error: float) -> int:
    """Return for how many samples at the end nothing but noise is seen, whole periods, at least `_RESTS` of them."""
    count = values.size // period if period > 3 else 0
    parts = values[values.size - count * period :].reshape(count, max(period, 1))[::-1]
    line = np.linspace(-1.0, 1.0, max(period, 2))
    lines = np.column_stack([np.ones_like(line), line])
    left = (part - lines @ np.linalg.lstsq(lines, part, rcond=None)[0] for part in parts)
    moves = [float(np.std(own)) > _STILL * error for own in left]
    still = moves.index(True) if True in moves else count
    return still * period if still >= _RESTS else 0


def _trend(values: FloatArray, beside: list[FloatArray]) -> tuple[float, float]:
    """Return the change of a straight line through values over their length, beside other signals, and its error."""
    line = np.linspace(-0.5, 0.5, values.size)
    others = np.column_stack([np.ones_like(line), *(signal - signal.mean() for signal in beside)])
    # What of the line the others cannot follow.
    own = line - others @ np.linalg.lstsq(others, line, rcond=None)[0]
    both = np.column_stack([line, others])
    found = np.linalg.lstsq(both, values, rcond=None)[0]
    left = values - both @ found
    # What is left is smooth: a value is only independent of those on the other side of a zero.
    independent = 1 + np.count_nonzero(np.diff(np.signbit(left)))
    shown = np.sqrt(independent * max(float(np.mean(own**2)), np.finfo(float).tiny))
    return float(found[0]), float(np.std(left) / shown)
