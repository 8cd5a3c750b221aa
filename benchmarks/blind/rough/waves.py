"""Inputs of bodies: sums of sines that begin gently, with their derivatives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Waves:
    """Sum of sines under a ramp 1 - exp(-(t / ramp)^4), which has no jump in its first three derivatives."""

    sizes: tuple[float, ...]
    frequencies: tuple[float, ...]
    phases: tuple[float, ...]
    ramp: float

    def scaled(self, factor: float) -> Waves:
        """Return the same waves, larger by a factor."""
        return Waves(tuple(factor * s for s in self.sizes), self.frequencies, self.phases, self.ramp)

    def __call__(self, time: FloatArray) -> FloatArray:
        """Value at times (n,)."""
        return self.motion(time)[0]

    def motion(self, time: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Value and its first two derivatives at times (n,)."""
        sizes, frequencies = np.array(self.sizes), np.array(self.frequencies)
        angle = np.multiply.outer(time, frequencies) + np.array(self.phases)
        sine, cosine = np.sin(angle), np.cos(angle)
        value, rate, second = sine @ sizes, cosine @ (sizes * frequencies), -sine @ (sizes * frequencies**2)
        x = time / self.ramp
        rest = np.exp(-(np.minimum(x, 20.0) ** 4))
        grown, growing = 1 - rest, 4 * x**3 * rest / self.ramp
        bending = (12 * x**2 - 16 * x**6) * rest / self.ramp**2
        return grown * value, grown * rate + growing * value, grown * second + 2 * growing * rate + bending * value


def draw_waves(rng: np.random.Generator, low: float, high: float, count: int, ramp: float) -> Waves:
    """Draw waves between two angular frequencies [rad/s], their sum of about unit size."""
    edges = np.linspace(low, high, count + 1)
    frequencies = rng.uniform(edges[:-1], edges[1:])
    sizes = rng.uniform(0.5, 1.0, count)
    sizes /= np.sqrt(np.sum(sizes**2) / 2)
    return Waves(tuple(sizes), tuple(frequencies), tuple(rng.uniform(0, 2 * np.pi, count)), ramp)
