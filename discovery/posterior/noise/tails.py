"""Likelihoods of independent residuals with long tails, and of rounded readings: compiled, many sets side by side."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from discovery.foundation.arrays import BoolArray, FloatArray
from discovery.foundation.compiled_function import compiled
from discovery.posterior.noise.filters import FAST, LANES, TOGETHER, padded


@compiled(nogil=True, fastmath=FAST, error_model="numpy")
def _scattered(residual, factor, total):
    n, c, k = residual.shape
    prod = np.empty(LANES)
    for first in range(0, k, LANES):
        prod[:] = 1.0
        held = 0
        total[first : first + LANES] = 0.0
        for i in range(n):
            for channel in range(c):
                row = residual[i, channel]
                for j in range(LANES):
                    prod[j] *= 1.0 + row[first + j] * row[first + j] * factor[first + j]
                held += 1
                if held == TOGETHER:
                    held = 0
                    for j in range(LANES):
                        total[first + j] += math.log(prod[j])
                        prod[j] = 1.0
        for j in range(LANES):
            total[first + j] += math.log(prod[j])


@njit(error_model="numpy", forceinline=True)
def _log_cell(u, h):
    """Logarithm of the probability that a standard normal number lies within h of u."""
    u = abs(u)
    if h < 1e-4:
        return math.log(2.0 * h) - 0.5 * math.log(2.0 * math.pi) - 0.5 * u * u + h * h * (u * u - 1.0) / 6.0
    near, far = u - h, u + h
    if near < 30.0:
        return math.log(0.5 * (math.erfc(near * math.sqrt(0.5)) - math.erfc(far * math.sqrt(0.5))))
    # Both ends lie in one tail: its asymptotic series, with the larger exponential taken out.
    i, j = 1.0 / (near * near), 1.0 / (far * far)
    inner = (1.0 - i * (1.0 - 3.0 * i * (1.0 - 5.0 * i * (1.0 - 7.0 * i)))) / near
    outer = (1.0 - j * (1.0 - 3.0 * j * (1.0 - 5.0 * j * (1.0 - 7.0 * j)))) / far
    between = inner - outer * math.exp(-2.0 * u * h)
    return -0.5 * near * near - 0.5 * math.log(2.0 * math.pi) + math.log(between)


@compiled(nogil=True, error_model="numpy")
def _rounded(seen, residual, half, sd, total):
    n, c, k = residual.shape
    for first in range(k):
        total[first] = 0.0
    for i in range(n):
        for channel in range(c):
            if seen[i, channel]:
                for lane in range(k):
                    total[lane] += _log_cell(residual[i, channel, lane] / sd[lane], half[channel] / sd[lane])


def scattered(residual: FloatArray, factor: FloatArray) -> FloatArray:
    """Return the sum of log(1 + factor r^2) over residuals (n, c, k), for factors (k,), shape (k,)."""
    k = residual.shape[2]
    block, (rows,) = padded(residual, factor)
    total = np.empty(rows.size)
    _scattered(block, rows, total)
    return total[:k]


def rounded(seen: BoolArray, residual: FloatArray, half: FloatArray, sd: FloatArray) -> FloatArray:
    """Return the log probability (k,) of the cells of readings that were rounded, gaps left out.

    Residuals (n, c, k) are predictions less the middles of the cells, `half` (c,) is half a cell, and `sd` (k,) the
    standard deviation of the noise before rounding.
    """
    total = np.empty(residual.shape[2])
    _rounded(seen, np.ascontiguousarray(residual), half, np.ascontiguousarray(sd, float), total)
    return total
