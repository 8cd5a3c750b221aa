"""Derivatives of readings by central differences around a vector, within its bounds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from discovery.estimation.bench import Bench
from discovery.estimation.problem import Problem
from discovery.recordings.experiment import Experiment

__all__ = ["Probed", "simulated"]

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Probed:
    """Points around a vector within its bounds, and how far apart those of a parameter are."""

    points: FloatArray
    apart: FloatArray

    @classmethod
    def around(cls, problem: Problem, x: FloatArray, size: FloatArray) -> Probed:
        """Return the points around a vector (p,), each parameter moved by its own size either way."""
        low, high = problem.bounds
        up, down = np.minimum(x + size, high), np.maximum(x - size, low)
        points = np.repeat(x[:, None], 2 * x.size + 1, axis=1)
        each = np.arange(x.size)
        points[each, 1 + each], points[each, 1 + x.size + each] = up, down
        apart = up - down
        return cls(points, np.where(apart > 0, apart, 1.0))

    @property
    def count(self) -> int:
        """Number of points."""
        return self.points.shape[1]

    def columns(self, experiment: Experiment, channels: FloatArray) -> FloatArray:
        """Return derivatives by every parameter and the residual, shape (n, c, p + 1) [noise sds]."""
        p, noise = self.apart.size, experiment.recording.scatter[:, :, None]
        slopes = (channels[:, :, 1 : p + 1] - channels[:, :, p + 1 :]) / self.apart / noise
        slopes[:, :, ~np.isfinite(slopes).all(axis=(0, 1))] = 0.0
        residual = (channels[:, :, :1] - experiment.recording.output[:, :, None]) / noise
        return np.concatenate([slopes, residual], axis=2)


def simulated(bench: Bench, problems: Sequence[Problem], probes: Sequence[Probed]) -> list[list[FloatArray]]:
    """Return the columns of every recording of a bench, for each problem: all in one simulation."""
    sets = [p.expand(probe.points) for p, probe in zip(problems, probes, strict=True)]
    edges = np.cumsum([0, *(probe.count for probe in probes)])
    channels = bench.predict(*(np.concatenate(each, axis=-1) for each in zip(*sets, strict=True)))
    return [
        [
            probe.columns(e, c[:, :, first : first + probe.count])
            for e, c in zip(bench.experiments, channels, strict=True)
        ]
        for first, probe in zip(edges, probes, strict=False)
    ]
