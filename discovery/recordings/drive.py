"""An input as piecewise polynomials: value, rate and acceleration at any time, and its kinks, where steps must end."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline

from discovery.foundation.arrays import FloatArray


@dataclass(frozen=True)
class Drive:
    """An input as piecewise polynomials, constant before its first and after its last time."""

    #: (m + 1,): times between which the input is one polynomial [s]; a step that crosses none of them sees a smooth
    #: input.
    breakpoints: FloatArray
    coefficients: FloatArray  # (d + 1, m), of the powers of ``t - breakpoints[i]``, highest first, in the input's unit
    kinks: FloatArray  # (k,), times at which acceleration, rate or value jumps: integration steps must end there

    def evaluate(self, time: npt.ArrayLike, side: Literal["left", "right"] = "right") -> FloatArray:
        """Return value, rate and acceleration at any times [s], shape (3, n); `side` is the limit to take at a kink.

        Outside the record the value is held, with zero rates.
        """
        t = np.atleast_1d(np.asarray(time, np.float64))
        first, last = self.breakpoints[0], self.breakpoints[-1]
        piece = np.clip(np.searchsorted(self.breakpoints, t, side) - 1, 0, self.coefficients.shape[1] - 1)
        s = np.clip(t, first, last) - self.breakpoints[piece]
        value, rate, half_acceleration = np.zeros((3, t.size))
        for row in self.coefficients:
            half_acceleration = half_acceleration * s + rate
            rate = rate * s + value
            value = value * s + row[piece]
        inside = (t >= first) & (t < last) if side == "right" else (t > first) & (t <= last)
        return np.stack([value, np.where(inside, rate, 0.0), np.where(inside, 2.0 * half_acceleration, 0.0)])


def spline_drive(t: FloatArray, u: FloatArray) -> Drive:
    """Return the cubic spline through samples ``u`` (n,) at the times ``t`` (n,) [s]."""
    spline = CubicSpline(t, u)
    return Drive(t, spline.c, np.empty(0))
