"""Readings in steps: what is seen is the cell in which the reading fell."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numba import njit
from scipy.special import log_ndtr

from discovery.estimation.problem import Problem
from discovery.foundation.arrays import BoolArray, FloatArray
from discovery.foundation.compiled_function import compiled
from discovery.posterior.noise.model import GaussianErrors, Instrument, Noise, Own, seen_by


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


def rounded(seen: BoolArray, residual: FloatArray, half: FloatArray, sd: FloatArray) -> FloatArray:
    """Return the log probability (k,) of the cells of readings that were rounded, gaps left out.

    Residuals (n, c, k) are predictions less the middles of the cells, `half` (c,) is half a cell, and `sd` (k,) the
    standard deviation of the noise before rounding.
    """
    total = np.empty(residual.shape[2])
    _rounded(seen, np.ascontiguousarray(residual), half, np.ascontiguousarray(sd, float), total)
    return total


@dataclass(frozen=True)
class Quantised(GaussianErrors, Noise):
    """Gaussian white errors of standard deviation sigma before the readings were rounded.

    The probability of the cell in place of the density of its middle (A. Gelman et al., Bayesian Data Analysis, section
    3.5), over the size of the cell, so that evidences compare. `cells` says, by experiment, which readings count (n,
    c), and half a step of each channel in stated noises (c,).
    """

    name: ClassVar[str] = "quantised"
    words: ClassVar[str] = "white, then rounded"
    size: ClassVar[str] = "noise before rounding, sd"
    needs: ClassVar[str] = "readings in steps"

    cells: dict[int, tuple[BoolArray, FloatArray]]

    @classmethod
    def of(cls, problem: Problem, part: Instrument) -> Quantised | None:
        """Return the noise of an instrument; None where its readings do not come in steps."""
        cells = {}
        for i in part.experiments:
            recording = problem.bench.experiments[i].recording
            if not recording.steps.all():
                return None
            cells[i] = seen_by(problem.bench.experiments[i]), 0.5 * recording.steps / recording.noise
        return cls(part, (), cells)

    @classmethod
    def density(cls, error: FloatArray, size: FloatArray, own: Own, step: FloatArray) -> FloatArray:
        """Return the log probability of the cell of each reading, over its size."""
        half = 0.5 * step
        # From the tail in which both its ends lie.
        near, far = log_ndtr((half - np.abs(error)) / size), log_ndtr((-half - np.abs(error)) / size)
        return np.asarray(near + np.log1p(-np.exp(far - near)) - np.log(2.0 * half))

    def log_likelihood(self, i: int, residual: FloatArray, x: FloatArray, noise: FloatArray) -> FloatArray:
        """Return the log probability of the readings of one experiment, over the sizes of their cells."""
        seen, half = self.cells[i]
        cells = rounded(seen, residual[: len(seen)], half, np.exp(noise[0]))
        return cells - float(seen.sum(axis=0) @ np.log(2 * half))

    def whitened(self, i: int, columns: FloatArray, x: FloatArray, noise: FloatArray) -> FloatArray:
        """Return the columns over the standard deviation of noise and rounding together."""
        half = self.cells[i][1]
        return columns / np.sqrt(math.exp(2 * noise[0]) + half**2 / 3)[:, None]
