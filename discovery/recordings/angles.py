"""Angles that are known but for full turns."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

__all__ = ["within_half_a_turn"]


def within_half_a_turn(angle: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Return an angle [rad] without its full turns, from minus pi on and less than pi; NaN stays."""
    return (angle + np.pi) % (2 * np.pi) - np.pi
