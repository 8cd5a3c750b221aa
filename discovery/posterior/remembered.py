"""A log density whose values are kept: an interrupted run that asks the same again has them at once."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

__all__ = ["Remembered"]

FloatArray = NDArray[np.float64]
#: Points that are asked for together, in whole lanes of the kernel, and seconds after which what was done is kept.
_BLOCK, _KEPT_AFTER = 512, 2.0


class Remembered:
    """A log density that is asked for points in an order that only a seed decides.

    Parameters
    ----------
    log_density : callable
        Log density at points (k, d).
    keep : callable
        Keeps `values`; called every few seconds.
    """

    def __init__(self, log_density: Callable[[FloatArray], FloatArray], keep: Callable[[], None]) -> None:
        #: First coordinate and log density of every point so far, or those of an earlier run, shape (n, 2).
        self.values = np.empty((0, 2))
        self._log_density, self._keep = log_density, keep
        self._asked, self._kept = 0, time.perf_counter()

    def __call__(self, points: FloatArray) -> FloatArray:
        """Return the log density at points (k, d)."""
        found = np.empty(len(points))
        for first in range(0, len(points), _BLOCK):
            part = slice(first, first + _BLOCK)
            found[part] = self._of_block(points[part])
        return found

    def _of_block(self, points: FloatArray) -> FloatArray:
        own = slice(self._asked, self._asked + len(points))
        self._asked = own.stop
        if not np.array_equal(self.values[own, 0], points[:, 0]):
            # Nothing is known from here on, or the earlier run was asked for other numbers of draws.
            values = np.column_stack([points[:, 0], self._log_density(points)])
            self.values = np.concatenate([self.values[: own.start], values])
            if time.perf_counter() - self._kept > _KEPT_AFTER:
                self._keep()
                self._kept = time.perf_counter()
        return self.values[own, 1]
