"""Outliers: errors with the long tails of Student's t."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from scipy.special import gammaln

from discovery.declarations.parameters import Normal
from discovery.foundation.arrays import FloatArray
from discovery.posterior.noise.model import Noise, NoiseParameter
from discovery.posterior.noise.tails import scattered

if TYPE_CHECKING:
    from discovery.estimation.problem import Problem
    from discovery.posterior.instrument import Instrument


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
