"""Arrays by what they hold, and angles that are known but for full turns."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

BoolArray = NDArray[np.bool_]
FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


def within_half_a_turn(angle: FloatArray) -> FloatArray:
    """Return an angle [rad] without its full turns, from minus pi on and less than pi; NaN stays."""
    return (angle + np.pi) % (2 * np.pi) - np.pi
