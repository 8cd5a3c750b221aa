"""Readings that lie at an end of the range of an instrument which reads in steps."""

from __future__ import annotations

import numpy as np

from discovery.foundation.arrays import BoolArray, FloatArray
from discovery.foundation.sampling import stretches
from discovery.recordings.sensor_faults import IDLE

_BANDS = (0, 1, 2, 4, 8, 16)  # steps that readings at an end may lie apart
_OF_RANGE = 0.01  # of all readings, the widest band
_SHORTEST = 3  # readings of a stay that tells
_STAYS = 2  # that tell, at both ends together
_BESIDE = 6  # readings on either side of a stay that are looked at
#: Speed at the edge of a stay over that beside it, on the one side and on the other: a third on both where a motion
#: comes to rest and begins again. An instrument may be slow to saturate.
_ABRUPT, _LEAST = 0.5, 0.1
_FLAT = 4.0  # power of the flattest turn
_CLEAR = 10.0  # bands by which a stay is left at least: speeds are told apart by less than steps


def cut_off(values: FloatArray, step: float, still: BoolArray | None = None) -> tuple[BoolArray, tuple[float, ...]]:
    """Find readings (n,) at an end of the range of an instrument that reads in steps; NaN are gaps.

    Returned: which they are, and the ends. A motion that stays for some readings within a few steps of its extreme
    turns there, or stands still: it leaves the band slowly. One that is cut off enters and leaves it at its speed. Even
    a turn as flat as a fourth power leaves it by no more than a ratio of lengths allows. Two such stays tell an end.
    `still` (n,): where what is read may stand still by itself, as a drive that nothing pushes; stays there tell none.
    """
    good = np.flatnonzero(np.isfinite(values))
    nothing = np.zeros(values.size, bool)
    if step == 0.0 or good.size < 2 * _BESIDE:
        return nothing, ()
    read = values[good]
    idle = np.zeros(read.size, bool) if still is None else still[good]
    ends = {sign: float((sign * read).max()) for sign in (-1.0, 1.0)}
    stays: dict[float, tuple[int, float]] = {}
    for sign, end in ends.items():
        below = end - sign * read
        counts = [
            (_stays(below, band * step, step, idle), -band)
            for band in _BANDS
            if band * step <= _OF_RANGE * np.ptp(read)
        ]
        most, narrowest = max(counts, default=(0, 0))
        stays[sign] = (most, -narrowest * step)
    # What stops as abruptly elsewhere stands still by itself.
    if sum(count for count, _ in stays.values()) < max(_STAYS, 1 + _stops(read, step)):
        return nothing, ()
    limits = []
    for sign, (count, band) in stays.items():
        if count:
            nothing[good] |= ends[sign] - sign * read <= band + 0.5 * step
            limits.append(sign * ends[sign])
    return nothing, tuple(limits)


def _stays(below: FloatArray, band: float, step: float, idle: BoolArray) -> int:
    """Return how often readings that lie so far `below` their extreme stay within a band as no motion does."""
    found = 0
    for start, stop in stretches(below <= band + 0.5 * step):
        length = stop - start
        if length < _SHORTEST or idle[start:stop].mean() > IDLE:
            continue
        # A turn of this length within the band is so far below two readings later.
        most = (band + step) * max(_CLEAR, ((length + 4.0) / (length - 1.0)) ** _FLAT)
        sides = below[max(0, start - _BESIDE) : start + 1][::-1], below[stop - 1 : stop + _BESIDE]
        ratios = [_abruptness(side, most) for side in sides]
        found += max(ratios) > _ABRUPT and min(ratios) > _LEAST
    return found


def _stops(read: FloatArray, step: float) -> int:
    """Return how often readings stand still away from both extremes, and come there and leave as no turn does."""
    edges = np.concatenate([[0], 1 + np.flatnonzero(np.abs(np.diff(read)) > step), [read.size]])
    far, found = _OF_RANGE * np.ptp(read), 0
    for start, stop in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
        below = np.abs(read - read[start])
        if stop - start < _SHORTEST or min(read[start] - read.min(), read.max() - read[start]) <= far:
            continue
        sides = below[max(0, start - _BESIDE) : start + 1][::-1], below[stop - 1 : stop + _BESIDE]
        ratios = [_abruptness(side, _CLEAR * step) for side in sides]
        found += max(ratios) > _ABRUPT and min(ratios) > _LEAST
    return found


def _abruptness(side: FloatArray, most: float) -> float:
    """Return the speed at which readings leave over that beside it, from the edge of a stay outwards.

    It is 0 where they leave by no more than a turn does at most, and where they are too few.
    """
    if side.size < 4 or side[2] - side[0] <= most:
        return 0.0
    steps = np.abs(side[2:] - side[:-2])
    return float(steps[0] / max(np.median(steps[1:]), steps[0] * _LEAST))
