"""Polynomials through the neighbours of a reading: by how much it misses them, and how fast the motion is there."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from discovery.foundation.arrays import FloatArray

#: Degree and readings. Those of two readings more than the degree are differences, which suppress a motion the most;
#: those of more readings do not amplify errors that alternate from one reading to the next.
DIFFERENCES = ((3, 5), (5, 7), (7, 9))
CALMER = ((3, 9), (5, 13), (5, 17), (7, 17))
SLOWEST = ((1, 9), (1, 17), (3, 17))  # where hardly anything moves
LONGEST = 17  # readings
#: A miss beyond so many standard deviations counts as one of as many, which keeps this of Gaussian variance.
FAR, KEPT = 3.0, 0.9733
_SLOPE = (5, 13)


def misses(values: FloatArray, degree: int, readings: int) -> FloatArray:
    """Return by how much each of n values misses a polynomial through it and its neighbours, (n - readings + 1,).

    Values are equally spaced. A miss has the standard deviation of one reading's white noise, in their unit. NaN are
    gaps, and so is what is near one.
    """
    return np.convolve(values, miss_weights(degree, readings), "valid")


@lru_cache
def miss_weights(degree: int, readings: int) -> FloatArray:
    """Return the weights of readings in the miss of the one in their middle, (readings,); their squares sum to one."""
    # Orthonormal polynomials at equally spaced readings, (readings, degree + 1).
    basis = np.linalg.qr(np.polynomial.legendre.legvander(np.linspace(-1.0, 1.0, readings), degree))[0]
    weights = -basis[readings // 2] @ basis.T
    weights[readings // 2] += 1.0
    return np.asarray(weights / np.linalg.norm(weights))


def slopes(values: FloatArray, step: float) -> FloatArray:
    """Return how fast n equally spaced values move at each of them, (n,), in their unit over that of the step.

    They are those of polynomials through so many neighbours that white noise moves them little, and NaN at the ends
    and near gaps.
    """
    degree, readings = _SLOPE
    at = np.arange(readings) - readings // 2
    weights = np.linalg.pinv(np.vander(at.astype(np.float64), degree + 1, increasing=True))[1]
    found = np.full(values.shape, np.nan)
    found[readings // 2 : values.size - readings // 2] = np.convolve(values, weights[::-1], "valid") / step
    return found
