"""Readings in steps: what is seen is the cell in which the reading fell."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from discovery.foundation.arrays import BoolArray, FloatArray
from discovery.posterior.noise.model import Noise, seen_by
from discovery.posterior.noise.tails import rounded

if TYPE_CHECKING:
    from discovery.estimation.problem import Problem
    from discovery.posterior.instrument import Instrument


@dataclass(frozen=True)
class Quantised(Noise):
    """Gaussian white errors of standard deviation sigma before the readings were rounded.

    The probability of the cell in place of the density of its middle (A. Gelman et al., Bayesian Data Analysis, section
    3.5), over the size of the cell, so that evidences compare. `cells` says, by experiment, which readings count (n,
    c), and half a step of each channel in stated noises (c,).
    """

    name: ClassVar[str] = "quantised"
    words: ClassVar[str] = "white, then rounded"
    size: ClassVar[str] = "noise before rounding, sd"

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

    def log_likelihood(self, i: int, residual: FloatArray, x: FloatArray, noise: FloatArray) -> FloatArray:
        """Return the log probability of the readings of one experiment, over the sizes of their cells."""
        seen, half = self.cells[i]
        cells = rounded(seen, residual[: len(seen)], half, np.exp(noise[0]))
        return cells - float(seen.sum(axis=0) @ np.log(2 * half))

    def whitened(self, i: int, columns: FloatArray, x: FloatArray, noise: FloatArray) -> FloatArray:
        """Return the columns over the standard deviation of noise and rounding together."""
        half = self.cells[i][1]
        return columns / np.sqrt(math.exp(2 * noise[0]) + half**2 / 3)[:, None]
