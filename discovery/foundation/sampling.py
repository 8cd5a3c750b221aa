"""How samples lie in time: the step between them, and where some are missing."""

from __future__ import annotations

import numpy as np

from discovery.foundation.arrays import BoolArray, FloatArray

#: Stamps that only jitter are nearer than this, over the median step; where one sample is lost they are twice as far.
_GAP = 1.5
#: Of the median step, by which others may differ.
_UNEVEN = 0.05


def median_step(time: FloatArray) -> float:
    """Return the median step between instants, in their unit."""
    return float(np.median(np.diff(time)))


def mean_rate(time: FloatArray) -> float:
    """Return how many instants there are per unit of their time, from the first to the last: that tells of any steps.

    Examples
    --------
    >>> mean_rate(np.array([0.0, 0.1, 0.3, 0.4, 0.5]))
    8.0
    """
    return float((time.size - 1) / (time[-1] - time[0]))


def gaps(time: FloatArray, step: float | None = None) -> BoolArray:
    """Return for each of the n - 1 steps between n instants whether samples are missing in it.

    That is by its length over `step`, which is their median where none is given.

    Examples
    --------
    >>> gaps(np.array([0.0, 0.1, 0.2, 0.4, 0.5])).tolist()
    [False, False, True, False]
    """
    return np.asarray(np.diff(time) > _GAP * (median_step(time) if step is None else step))


def are_uneven(time: FloatArray) -> bool:
    """Return whether instants increase, and more than one step in twenty is not like the others.

    Examples
    --------
    >>> are_uneven(np.array([0.0, 0.1, 0.25, 0.3]))
    True
    """
    steps = np.diff(time)
    return bool(
        steps.size
        and steps.min() > 0.0
        and np.quantile(np.abs(steps - np.median(steps)), 0.95) > _UNEVEN * np.median(steps)
    )
