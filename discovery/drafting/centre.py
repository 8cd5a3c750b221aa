"""About which reading a motion swings, told before any model is chosen."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from discovery.foundation.arrays import FloatArray

#: A passage goes from so far below to so far above: of half the range of the motion, and in sds of the noise.
_BAND, _NOISES = 0.1, 3.0
#: Quantiles between which the range lies: single wrong readings are outside.
_INSIDE = (0.01, 0.99)
#: Passages that enclose a whole swing, and corrections of the level, which end by themselves after a few.
_WHOLE, _CORRECTIONS = 3, 20
#: Share of a swing without readings that leaves its passages unknown.
_GAP = 0.4
#: Share of the readings that are the end, and of the range within which they lie if it came to rest.
_END, _STILL = 0.25, 0.1
#: Of the motion, the standard deviation of a centre that its swings tell badly.
_BADLY = 0.02
#: Standard deviation of a median of independent values over that of their mean, and quantiles one of theirs away.
_MEDIAN, _ONE = 1.25, (0.16, 0.84)
#: Share of the range that is one standard deviation of its middle, where nothing else tells the centre.
_ROUGH = 1.0 / 12.0


class Centre(NamedTuple):
    """A reading about which a motion goes, and its standard deviation."""

    at: float
    sd: float


def centre_of(time: FloatArray, output: FloatArray, noise: float = 0.0) -> Centre:
    """Return the reading about which a motion swings; where it does not swing, that at which it ends.

    A damped oscillation is as long above its centre as below: e^(-d t) cos(w t) has evenly spaced zeros. The level of
    which this holds is found swing by swing, and the median over the swings is taken: a decay, a scale that ends within
    the swings, a gap, or a body that sticks beside its centre do not move it, as they do means and last readings. A
    swing is as uncertain as the swings differ, and no less than a reading.

    Parameters
    ----------
    time, output : ndarray, shape (n,)
        Times and readings; NaN marks gaps. Times may begin again.
    noise : float
        Standard deviation of a reading.

    Examples
    --------
    >>> t = np.linspace(0, 12, 400)
    >>> y = 30.0 + 8.0 * np.exp(-0.2 * t) * np.cos(4 * t)
    >>> round(centre_of(t, y).at, 2), round(centre_of(t, np.maximum(y, 26.0)).at, 2)
    (30.0, 30.0)
    """
    good = np.flatnonzero(np.isfinite(output))
    y = median_filter(output[good], 3, mode="nearest")
    t = np.cumsum(np.maximum(np.diff(time[good], prepend=time[good[0]]), 0.0))
    low, high = np.quantile(y, _INSIDE)
    band = max(_BAND * (high - low) / 2.0, _NOISES * noise)
    starts = (float(np.median(y)), float(low + high) / 2.0)
    level = max(starts, key=lambda start: _passages(y, start, band).shape[1])
    swings = np.empty(0)
    for _ in range(_CORRECTIONS):
        found = _levels(t, y, level, band)
        if found.size == 0:
            break
        swings, before, level = found, level, float(np.median(found))
        if abs(level - before) < 1e-3 * band:
            break
    told = Centre(starts[1], _ROUGH * float(high - low))
    if swings.size:
        below, above = np.quantile(swings, _ONE)
        # Each half swing is in two of them.
        told = Centre(level, _MEDIAN * max(float(above - below) / 2.0, noise) / np.sqrt(max(1.0, swings.size / 2.0)))
    end = y[-max(1, round(_END * y.size)) :]
    # Where few swings tell it badly, the end does; a body at rest may stick anywhere among its readings.
    if told.sd > _BADLY * (high - low) and np.ptp(end) < max(_STILL * (high - low), 2.0 * band):
        return Centre(float(np.median(end)), max(float(np.ptp(end)) / 6.0, noise))
    return told


def _passages(y: FloatArray, level: float, band: float) -> NDArray[np.intp]:
    """Return the last reading beyond a band about a level before each passage, and the first after it, shape (2, k)."""
    beyond = np.flatnonzero(np.abs(y - level) > band)
    turns = np.flatnonzero(np.diff(y[beyond] > level))
    return np.stack([beyond[turns], beyond[turns + 1]])


def _levels(t: FloatArray, y: FloatArray, level: float, band: float) -> FloatArray:
    """Return the level that would part the time of two half swings evenly, for each two without a gap, shape (k,).

    About a level that is e above its centre, a sine of size a is above for a share 1/2 - asin(e/a)/pi of the time.
    """
    first, last = _passages(y, level, band)
    if first.size < _WHOLE:
        return np.empty(0)
    passed = t[first] + (t[last] - t[first]) * (level - y[first]) / (y[last] - y[first])
    halves = np.diff(passed)
    whole = halves[:-1] + halves[1:]
    parts = [slice(begin, end + 1) for begin, end in zip(first[:-2], last[2:], strict=True)]
    half_range = np.array([np.ptp(y[part]) for part in parts]) / 2.0
    read = np.array([np.diff(t[part]).max() for part in parts]) < _GAP * np.minimum(whole, np.median(whole))
    above = np.where(y[last[:-2]] > level, 1.0, -1.0)[read]
    uneven = (halves[:-1] - halves[1:])[read] / whole[read]
    return level + half_range[read] * above * np.sin(np.pi / 2.0 * uneven)
