"""Errors of the recorded input: what the system makes of them is in every reading."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from discovery.estimation.problem import Problem
from discovery.foundation.arrays import BoolArray, FloatArray
from discovery.posterior.noise.filters import oscillating
from discovery.posterior.noise.model import (
    LOG_2PI,
    GaussianErrors,
    Instrument,
    Noise,
    seen_by,
    share_of,
    share_parameter,
)
from discovery.recordings.experiment import Experiment

# Smallest angular frequency over the dominant one: a stiffness may be at its bound of zero.
_SLOWEST = 1e-2


@dataclass(frozen=True)
class InputNoise(GaussianErrors, Noise):
    """White errors of the readings, and white errors of the input that passed through the system to first order.

    What a system of angular frequency sqrt(alpha) and damping xi makes of white noise is the stochastically driven
    oscillator of D. Foreman-Mackey et al., Astronomical Journal 154 (2017) 220, equation 23: it depends on the sampled
    parameters themselves. All channels see the same error of the coordinate; sigma is the standard deviation of a
    reading with both parts, on average over the recording.

    `readings` has, by experiment, times [s] (n,), which readings count (n, c), and their slope against the coordinate
    over its rms (n, c). `alpha` [1/s^2] and `xi` [1/s] are places among the free numbers, as integers, or values;
    `slowest` is the smallest angular frequency [rad/s].
    """

    name: ClassVar[str] = "input"
    words: ClassVar[str] = "white, and input noise that passed through the system"
    independent: ClassVar[bool] = False
    needs: ClassVar[str] = "a recorded input"

    readings: dict[int, tuple[FloatArray, BoolArray, FloatArray]]
    alpha: int | float
    xi: int | float
    slowest: float

    @classmethod
    def of(cls, problem: Problem, part: Instrument) -> InputNoise | None:
        """Return the noise of an instrument; None without a recorded input that moves the coordinate it reads."""
        experiments = problem.bench.experiments
        first = experiments[part.experiments[0]]
        if first.drive is None or first.reads_acceleration or problem.model.mechanics.prescribed:
            return None
        slopes = {i: _slope(experiments[i]) for i in part.experiments}
        size = math.sqrt(sum(float(np.sum(s**2)) for s in slopes.values()) / part.n)
        readings = {}
        for i, slope in slopes.items():
            seen = seen_by(experiments[i])
            readings[i] = experiments[i].recording.time[: len(seen)], seen, slope[: len(seen)] / size
        share = share_parameter("share of the variance that came in with the input", (-3.0, 0.0, 3.0))
        dominant = 1.0 / problem.units.time
        longest = max(float(time[-1] - time[0]) for time, *_ in readings.values())
        alpha = _where(problem, "alpha", dominant**2)
        # Where the model has no damping, the least that the recording could show.
        return cls(part, (share,), readings, alpha, _where(problem, "xi", 2.0 / longest), _SLOWEST * dominant)

    def _system(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return angular frequency [rad/s] and damping [1/s] of free numbers (p, k), each (k,)."""
        alpha, xi = (x[v] if isinstance(v, int) else np.full(x.shape[1], v, np.float64) for v in (self.alpha, self.xi))
        return np.sqrt(np.maximum(alpha, self.slowest**2)), np.maximum(xi, 0.0)

    def log_likelihood(self, i: int, residual: FloatArray, x: FloatArray, noise: FloatArray) -> FloatArray:
        """Return the log density of the readings of one experiment."""
        time, seen, slope = self.readings[i]
        square, log_variance, _ = oscillating(
            time, seen, residual[: len(seen)], share_of(noise[1]), *self._system(x), slope=slope, keep=False
        )
        return -0.5 * (square * np.exp(-2 * noise[0]) + log_variance + seen.sum() * (2 * noise[0] + LOG_2PI))

    def whitened(self, i: int, columns: FloatArray, x: FloatArray, noise: FloatArray) -> FloatArray:
        """Return the innovations of the columns, of unit variance."""
        time, seen, slope = self.readings[i]
        system = self._system(x[:, None])
        *_, innovation = oscillating(
            time, seen, columns[: len(seen)], share_of(noise[1:2]), *system, slope=slope, keep=True
        )
        return innovation * math.exp(-noise[0])


def _where(problem: Problem, name: str, otherwise: float) -> int | float:
    """Return the row of a free parameter, the value of a known one, or what stands for one that the model lacks."""
    if name in problem.free:
        return problem.free.index(name)
    return float(problem.model.known.get(name, otherwise))


def _slope(experiment: Experiment) -> FloatArray:
    """Return the derivative of every reading by the coordinate, in stated noises, zero where none counts, (n, c)."""
    recording, weights = experiment.recording, experiment.weights()
    out = np.where(weights > 0, recording.output, 0.0)
    if recording.channels == ("tip_x", "tip_y"):
        turned = np.column_stack([-out[:, 1], out[:, 0]])
    elif recording.channels == ("tip_deflection",) and experiment.rig.length is not None:
        turned = np.sqrt(np.maximum(experiment.rig.length.value**2 - out**2, 0.0))
    else:
        turned = np.ones_like(out)
    return turned * weights
