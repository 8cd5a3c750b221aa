"""Outliers: errors with the long tails of Student's t."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.random import Generator
from scipy import stats
from scipy.special import gammaln

from discovery.declarations.priors import Normal
from discovery.estimation.problem import Problem
from discovery.foundation.arrays import FloatArray
from discovery.foundation.compiled_function import compiled
from discovery.posterior.noise.filters import FAST, LANES, TOGETHER, padded
from discovery.posterior.noise.model import Instrument, Noise, NoiseParameter, Own


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


def scattered(residual: FloatArray, factor: FloatArray) -> FloatArray:
    """Return the sum of log(1 + factor r^2) over residuals (n, c, k), for factors (k,), shape (k,)."""
    block, (rows,) = padded(residual, factor)
    total = np.empty(rows.size)
    _scattered(block, rows, total)
    return total[: residual.shape[2]]


@dataclass(frozen=True)
class StudentT(Noise):
    """Independent errors that follow Student's t with nu degrees of freedom; sigma is its scale.

    K. Lange, R. Little, J. Taylor, Journal of the American Statistical Association 84 (1989) 881. `counts` are readings
    by experiment.
    """

    name: ClassVar[str] = "student_t"
    words: ClassVar[str] = "independent, with outliers (Student t)"
    size: ClassVar[str] = "noise, scale of Student t"
    outliers: ClassVar[bool] = True

    counts: dict[int, int]

    @classmethod
    def of(cls, problem: Problem, part: Instrument) -> StudentT:
        """Return the noise of an instrument."""
        nu = NoiseParameter(
            name="nu",
            unit="1",
            meaning="degrees of freedom: few for many outliers",
            prior=Normal(math.log(10.0), 1.0),
            starts=(math.log(3.0), math.log(30.0)),
            value=np.exp,
        )
        experiments = problem.bench.experiments
        return cls(part, (nu,), {i: int((experiments[i].weights() > 0).sum()) for i in part.experiments})

    @classmethod
    def drawn(cls, rng: Generator, shape: tuple[int, ...], own: Own) -> FloatArray:
        """Return errors of unit scale."""
        return rng.standard_t(own["nu"], shape)

    @classmethod
    def density(cls, error: FloatArray, size: FloatArray, own: Own, step: FloatArray) -> FloatArray:
        """Return the log density of Student's t."""
        return np.asarray(stats.t.logpdf(error / size, own["nu"]) - np.log(size))

    def log_likelihood(self, i: int, residual: FloatArray, x: FloatArray, noise: FloatArray) -> FloatArray:
        """Return the log density of the readings of one experiment."""
        log_factor, nu = noise[0], np.exp(noise[1])
        each = gammaln(0.5 * (nu + 1)) - gammaln(0.5 * nu) - 0.5 * np.log(np.pi * nu) - log_factor
        return self.counts[i] * each - 0.5 * (nu + 1) * scattered(residual, np.exp(-2 * log_factor) / nu)

    def whitened(self, i: int, columns: FloatArray, x: FloatArray, noise: FloatArray) -> FloatArray:
        """Return the columns over what a reading tells of its mean, sqrt((nu + 1)/(nu + 3))/sigma."""
        nu = math.exp(noise[1])
        return columns * (math.sqrt((nu + 1) / (nu + 3)) * math.exp(-noise[0]))

    def scaled(self, i: int, residual: FloatArray, x: FloatArray, noise: FloatArray) -> FloatArray:
        """Return residuals (n, c, k) of which half the sum of squares is minus the log likelihood, bar a constant."""
        nu = math.exp(noise[1])
        size = np.sqrt((nu + 1) * np.log1p((residual * math.exp(-noise[0])) ** 2 / nu))
        return np.asarray(np.copysign(size, residual))
