"""How samples lie in time: the step between them, and where some are missing."""

from __future__ import annotations

import numpy as np

from discovery.foundation.arrays import BoolArray, FloatArray

#: Stamps that only jitter are nearer than this, over the median step; where one sample is lost they are twice as far.
_GAP = 1.5


def median_step(time: FloatArray) -> float:
    """Return the median step between instants, in their unit."""
    return float(np.median(np.diff(time)))


def gaps(time: FloatArray, step: float | None = None) -> BoolArray:
    """Return for each of the n - 1 steps between n instants whether samples are missing in it.

    That is by its length over `step`, which is their median where none is given.

    Examples
    --------
    >>> gaps(np.array([0.0, 0.1, 0.2, 0.4, 0.5])).tolist()
    [False, False, True, False]
    """
    return np.asarray(np.diff(time) > _GAP * (median_step(time) if step is None else step))
