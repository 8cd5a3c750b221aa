"""Whether a motion is pulled back to a place of rest, told before any model is chosen."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid

__all__ = ["own_period"]

FloatArray = NDArray[np.float64]

#: Passages through the middle that are enough: over more of them, twice integrated noise outgrows the motion.
_PASSAGES = 40
#: Factor by which the squared error must fall with a spring in the law.
_GAIN = 2.0
#: Periods that a recording must hold: a slow drift looks like the begin of a slow swing.
_PERIODS = 3.0


def own_period(time: FloatArray, output: FloatArray, given: FloatArray | None) -> float | None:
    """Return the period with which a system swings about its rest, None where nothing pulls it back.

    The law q'' = -d q' - k q + b u + c is fitted after two integrations over time, which need no derivative of a noisy
    reading (Young, Recursive Estimation and Time-Series Analysis, 2011, section 8.2), once with a spring and once
    without.

    Parameters
    ----------
    time, output : array, shape (n,)
        Times [s] and motion; NaN marks gaps.
    given : array, shape (n,), or None
        The input, if there is one.

    Examples
    --------
    >>> t = np.linspace(0, 20, 2001)
    >>> period = own_period(t, np.exp(-0.1 * t) * np.cos(2 * np.pi * t), None)
    >>> round(period, 2)
    1.0
    """
    good = _part(np.flatnonzero(np.isfinite(output)), output)
    if good.size < 50:
        return None
    t, y = time[good] - time[good[0]], output[good]

    def integral(values: FloatArray) -> FloatArray:
        return cumulative_trapezoid(values, t, initial=0)

    scale = float(t[-1])
    columns = [np.ones_like(t), t / scale, (t / scale) ** 2, integral(y)]
    if given is not None:
        columns.append(integral(integral(given[good])))
    without = _squares(np.column_stack(columns), y)[0]
    left, weights = _squares(np.column_stack([*columns, integral(integral(y))]), y)
    if weights[-1] >= 0.0 or without < _GAIN * left:
        return None
    period = float(2.0 * np.pi / np.sqrt(-weights[-1]))
    return period if _PERIODS * period < scale else None


def _part(good: NDArray[np.intp], output: FloatArray) -> NDArray[np.intp]:
    """Return the readings around the largest one, with no more passages through the middle than are needed."""
    side = output[good] > np.median(output[good])
    passages = np.flatnonzero(side[1:] != side[:-1])
    if passages.size <= _PASSAGES:
        return good
    largest = int(np.argmax(np.abs(output[good] - np.median(output[good]))))
    first = min(max(0, int(np.searchsorted(passages, largest)) - _PASSAGES // 2), passages.size - _PASSAGES)
    return good[passages[first] : passages[first + _PASSAGES - 1]]


def _squares(columns: FloatArray, y: FloatArray) -> tuple[float, FloatArray]:
    """Return the sum of squares that least squares leave, and the weight of each column."""
    size = np.linalg.norm(columns, axis=0)
    size[size == 0.0] = 1.0
    weights = np.linalg.lstsq(columns / size, y, rcond=None)[0]
    return float(np.sum((y - (columns / size) @ weights) ** 2)), weights / size
