"""Correlated errors: a white part, and one that is forgotten exponentially."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from discovery.declarations.priors import Normal
from discovery.estimation.problem import Problem
from discovery.foundation.arrays import BoolArray, FloatArray
from discovery.foundation.sampling import median_step
from discovery.posterior.noise.filters import exponential
from discovery.posterior.noise.model import (
    LOG_2PI,
    GaussianErrors,
    Instrument,
    Noise,
    NoiseParameter,
    seen_by,
    share_of,
    share_parameter,
)

# Parts of the way from the sampling interval to the record, on a logarithmic scale, from which an estimate starts.
_STARTS = (0.25, 0.5, 0.75)


@dataclass(frozen=True)
class Correlated(GaussianErrors, Noise):
    """Gaussian errors of standard deviation sigma: white, but for a share with correlation exp(-|t - t'|/tau_n).

    The channels are independent of each other. It is the process of Ornstein and Uhlenbeck, or a real term of D.
    Foreman-Mackey et al., Astronomical Journal 154 (2017) 220. `readings` has times [s] (n,) and which readings count
    (n, c), by experiment.
    """

    name: ClassVar[str] = "correlated"
    words: ClassVar[str] = "white and exponentially correlated"
    independent: ClassVar[bool] = False

    readings: dict[int, tuple[FloatArray, BoolArray]]

    @classmethod
    def of(cls, problem: Problem, part: Instrument) -> Correlated:
        """Return the noise of an instrument: its memory lies between the sampling interval and the record."""
        experiments = problem.bench.experiments
        readings = {}
        for i in part.experiments:
            seen = seen_by(experiments[i])
            readings[i] = np.ascontiguousarray(experiments[i].recording.time[: len(seen)], float), seen
        times = [time for time, _ in readings.values()]
        shortest = math.log(min(median_step(time) for time in times))
        longest = math.log(max(float(time[-1] - time[0]) for time in times))
        share = share_parameter("share of the variance that is correlated", (-3.0, 0.0, 3.0, 6.0))
        tau = NoiseParameter(
            name="tau_n",
            unit="s",
            meaning="correlation time of the noise",
            prior=Normal(0.5 * (shortest + longest), 0.25 * (longest - shortest)),
            starts=tuple(shortest + part * (longest - shortest) for part in _STARTS),
            value=np.exp,
        )
        return cls(part, (share, tau), readings)

    def log_likelihood(self, i: int, residual: FloatArray, x: FloatArray, noise: FloatArray) -> FloatArray:
        """Return the log density of the readings of one experiment."""
        time, seen = self.readings[i]
        square, log_variance, _ = exponential(
            time, seen, residual[: len(seen)], share_of(noise[1]), np.exp(noise[2]), False
        )
        return -0.5 * (square * np.exp(-2 * noise[0]) + log_variance + seen.sum() * (2 * noise[0] + LOG_2PI))

    def whitened(self, i: int, columns: FloatArray, x: FloatArray, noise: FloatArray) -> FloatArray:
        """Return the innovations of the columns, of unit variance."""
        time, seen = self.readings[i]
        tau = np.array([math.exp(noise[2])])
        *_, innovation = exponential(time, seen, columns[: len(seen)], share_of(noise[1:2]), tau, True)
        return innovation * math.exp(-noise[0])
