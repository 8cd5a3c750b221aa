"""Readings that are those of another signal or recording, noise and all: no instrument repeats its noise."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from scipy.signal import correlate, correlation_lags

from discovery.foundation.arrays import FloatArray
from discovery.foundation.sampling import median_step
from discovery.recordings.reading_noise import white_noise
from discovery.recordings.recording import Recording
from discovery.recordings.rounding import are_marks, quantum

#: Of the noise: what two signals with noises of their own never come down to.
_NEAR = 0.3
#: Share of Gaussian values that is below so many standard deviations.
_MOST, _SIGMAS = 0.9, 1.645
#: Readings in common that are needed, at least and as a share of the shorter signal.
_FEWEST, _MUCH = 60, 0.1
#: Noise does not repeat so many readings in a row, of which so many differ.
_ROW, _DIFFERENT = 30, 20
#: Share of the shorter recording that is repeated by no accident.
_REPEATED = 0.1
#: Part of the largest reading below which noise is that of rounding to seven digits.
_EXACT = 1e-6
#: Share of the readings at equal times that must be equal. Repeated trials read in coarse steps agree in fewer.
_EQUAL = 0.99
#: Pairs of equal readings that tell by which time one recording may be shifted against the other.
_PAIRS = 200_000
#: Of a step: times that are equal.
_SAME_TIME = 0.25
#: Part by which steps differ that are equal.
_SAME_STEP = 1e-3


def copied(first: FloatArray, second: FloatArray) -> int | None:
    """Return the row of the second signal from which on it is a part of the first, but for less than its own noise.

    The signals are read at equal steps; NaN are gaps. None also where the noise cannot be told from the motion or from
    rounding.
    """
    noise = _own_noise(second)
    if noise is None:
        return None
    # The second signal comes later by as many rows as those by which the noises of both are most alike.
    one, other = (np.nan_to_num(np.diff(values, 4)) for values in (first, second))
    alike = correlate(other, one, method="fft")
    lag = int(correlation_lags(other.size, one.size)[np.argmax(alike)])
    begin = max(lag, 0)
    common = min(second.size, first.size + lag) - begin
    if common < max(_FEWEST, _MUCH * min(first.size, second.size)):
        return None
    apart = second[begin : begin + common] - first[begin - lag : begin - lag + common]
    return begin if _size(apart) < _NEAR * noise else None


def scaled_copy(first: FloatArray, second: FloatArray) -> bool:
    """Return whether the second signal is the first, row by row, but for scale, zero and less than its own noise."""
    noise = _own_noise(second)
    good = np.isfinite(first) & np.isfinite(second)
    if noise is None or good.sum() < _FEWEST or np.ptp(first[good]) == 0.0:
        return False
    line = np.polynomial.Polynomial.fit(first[good], second[good], 1)
    return _size(second[good] - line(first[good])) < _NEAR * noise


def _own_noise(values: FloatArray) -> float | None:
    """Return the noise of readings; None where it is not that of single readings, or less than a step of rounding."""
    noise = white_noise(values)
    return noise if noise is not None and noise > quantum(values) else None


def _size(values: FloatArray) -> float:
    """Return the root mean square of values by a quantile that few bad ones do not move; infinite without any.

    Steady readings in coarse steps agree by chance in more than half of the rows, and in their median.
    """
    finite = np.abs(values[np.isfinite(values)])
    return float(np.quantile(finite, _MOST)) / _SIGMAS if finite.size >= _FEWEST else np.inf


def shared_samples(first: Recording, second: Recording) -> int | None:
    """Return the row of the second recording from which on it repeats readings of the first.

    Found are stretches that both have, row by row, and recordings of which one is a part of the other with rows left
    out, as every second one, its times shifted or not; also where less was added to a stretch than its own noise.

    Returned: counted from 0 among the samples of the second; None where they share nothing that chance would not
    repeat.
    """
    # To seven digits: a file may have been written again.
    seen, judged = (r.output.astype(np.float32) for r in (first, second))
    if seen.shape[1] != judged.shape[1]:
        return None
    counted = all(are_marks(second.time, channel) for channel in second.output.T)
    at = _stretch(seen, judged, [np.diff(r.time) for r in (first, second)], counted=counted)
    at = _thinned(first, second, _SAME_STEP if counted else _SAME_TIME) if at is None else at
    return _disguised(first, second) if at is None and not counted else at


def _stretch(
    seen: npt.NDArray[np.float32], judged: npt.NDArray[np.float32], steps: Sequence[FloatArray], *, counted: bool
) -> int | None:
    """Return where a row of equal readings begins that both recordings hold because they were cut from one.

    They are as far apart in time, too: what is counted at marks is equal in all recordings, and only its times tell.
    """
    # A run of twice that length holds a whole block of the first wherever it begins.
    blocks = [(i, seen[i : i + _ROW]) for i in range(0, len(seen) - _ROW + 1, _ROW)]
    known = {b.tobytes(): i for i, b in blocks if np.isfinite(b).all() and len(np.unique(b, axis=0)) >= _DIFFERENT}
    # Few readings are those with which a block begins.
    begins = np.flatnonzero(np.isin(judged[: 1 - _ROW, 0], [seen[i, 0] for i in known.values()]))
    alike = ((known.get(judged[j : j + _ROW].tobytes()), int(j)) for j in begins)
    cut = ((i, j) for i, j in alike if i is not None and _is_cut(seen, judged, i, j))
    rows = ((j, steps[0][i : i + _ROW - 1], steps[1][j : j + _ROW - 1]) for i, j in cut)
    return next((j for j, one, other in rows if _keeps_time(one, other, counted)), None)


def _keeps_time(one: FloatArray, other: FloatArray, counted: bool) -> bool:
    """Return whether most readings of two rows are as far apart in time; of counted ones, to what no run repeats."""
    step = float(np.median(one))
    if counted:
        told = len(np.unique(np.round(one / (_SAME_STEP * step)))) >= _DIFFERENT
        return told and bool(np.quantile(np.abs(one - other), _MOST) < _SAME_STEP * step)
    return bool(np.median(np.abs(one - other)) < _SAME_TIME * step)


def _is_cut(seen: npt.NDArray[np.float32], judged: npt.NDArray[np.float32], i: int, j: int) -> bool:
    """Return whether what is equal from two places on is no accident of slow motion read in coarse steps.

    What is cut from one recording is equal up to an end of a part, on either side, or over much of it. Simulated
    motions without noise are equal as long as they were begun alike.
    """
    before, after = min(i, j), min(len(seen) - i, len(judged) - j)
    one, other = seen[i - before : i + after], judged[j - before : j + after]
    differ = np.flatnonzero((one != other).any(axis=1) & np.isfinite(one).all(axis=1) & np.isfinite(other).all(axis=1))
    first = differ[differ < before].max(initial=-1) + 1
    last = differ[differ > before].min(initial=before + after)
    channels = [c[np.isfinite(c)] for c in judged.T]
    begun_alike = i == j and all((white_noise(c) or 0.0) <= _EXACT * np.abs(c).max(initial=0.0) for c in channels)
    reaches = (first == 0 and not begun_alike) or last == before + after
    return bool(reaches or last - first >= _REPEATED * min(len(seen), len(judged)))


def _disguised(first: Recording, second: Recording) -> int | None:
    """Return where every channel repeats the other recording but for less than its noise, at one shift of the rows."""
    one, other = (median_step(r.time) for r in (first, second))
    if abs(one - other) > _SAME_STEP * one:
        return None
    found = {copied(seen, judged) for seen, judged in zip(first.output.T, second.output.T, strict=True)}
    return found.pop() if len(found) == 1 else None


def _thinned(first: Recording, second: Recording, part: float) -> int | None:
    """Return the first common reading where one recording is a part of the other with rows left out.

    Times are the same that differ by less than a `part` of a step.
    """
    seen, judged = (
        np.column_stack([r.output] if r.input is None else [r.output, r.input]).astype(np.float32)
        for r in (first, second)
    )
    if seen.shape[1] != judged.shape[1]:
        return None
    same = part * min(median_step(r.time) for r in (first, second))
    shift = _shift(seen, judged, first.time, second.time, same)
    if shift is None:
        return None
    place = np.searchsorted(first.time, second.time - shift - same)
    place = np.minimum(place, first.time.size - 1)
    meet = np.abs(second.time - shift - first.time[place]) <= same
    # What was left out of one as stuck or clipped may have been kept in the other.
    meet &= np.isfinite(seen[place]).all(axis=1) & np.isfinite(judged).all(axis=1)
    equal = meet & (seen[place] == judged).all(axis=1)
    most = 0.5 * min(np.isfinite(x).all(axis=1).sum() for x in (seen, judged))
    if equal.sum() < max(_ROW, most, _EQUAL * meet.sum()) or len(np.unique(judged[equal], axis=0)) < _DIFFERENT:
        return None
    return int(np.argmax(equal))


def _shift(
    seen: npt.NDArray[np.float32], judged: npt.NDArray[np.float32], before: FloatArray, after: FloatArray, same: float
) -> float | None:
    """Return by which time most of the equal readings are shifted; None where no two are equal."""
    _, kind = np.unique(np.concatenate([seen, judged]), axis=0, return_inverse=True)
    kind = kind.ravel()
    here, there = kind[: len(seen)], kind[len(seen) :]
    counts = [np.bincount(k, minlength=int(kind.max()) + 1) for k in (here, there)]
    pairs = counts[0] * counts[1]
    # Rare readings tell most: coarse ones pair with many that are only equal by chance.
    common = np.flatnonzero(pairs)
    common = common[np.argsort(pairs[common], kind="stable")]
    common = common[: max(1, int(np.searchsorted(np.cumsum(pairs[common]), _PAIRS)))]
    if common.size == 0:
        return None
    order, starts = np.argsort(here, kind="stable"), np.concatenate([[0], np.cumsum(counts[0])])
    rows = np.flatnonzero(np.isin(there, common))
    shifts = np.sort(
        np.concatenate([after[j] - before[order[starts[there[j]] : starts[there[j] + 1]]] for j in rows.tolist()])
    )
    within = np.searchsorted(shifts, shifts + same, side="right") - np.arange(shifts.size)
    best = int(np.argmax(within))
    return float(np.median(shifts[best : best + within[best]]))
