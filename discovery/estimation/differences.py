"""Derivatives of readings by central differences around a vector, within its bounds, and what half the step changes.

Dry friction on steps that are too long makes the motion chatter: differences of readings are then the solver's and not
the model's, far larger than its slopes, and intervals made of them far too narrow.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from discovery.estimation.bench import Bench
from discovery.estimation.least_squares import Minimum
from discovery.estimation.problem import Problem
from discovery.foundation.arrays import FloatArray, IntArray
from discovery.recordings.experiment import Experiment

#: Parameters of which nothing is known are moved by this part of their scale.
_LITTLE = 1e-3
#: Slopes err by so much of themselves at most: their intervals then do by about as much.
_ERROR = 0.5


@dataclass(frozen=True)
class Probed:
    """Points around a vector within its bounds, from which derivatives are taken.

    What is free of a recording moves that one alone. That of all recordings is moved at once, so that derivatives cost
    as many simulations for ten of them as for one (Curtis, Powell and Reid, Journal of the Institute of Mathematics and
    its Applications 13 (1974) 117).
    """

    points: FloatArray  # (m, 2 g + 1), the vector, then all points above it, then all below
    apart: FloatArray  # (m,), how far apart those of a number are
    at: IntArray  # (m,), which of the g points of either side each number is moved at
    owner: IntArray  # (m,), recording that each moves alone; -1 for all of them

    @classmethod
    def around(cls, problem: Problem, x: FloatArray, size: FloatArray) -> Probed:
        """Return the points around a vector (m,), each number moved by its own size either way."""
        free, each = len(problem.free), np.arange(x.size)
        owner = np.array([-1] * free + [state.experiment for state in problem.states], np.int64)
        # The first states of all recordings share a point, and so do the second ones.
        named = [*range(free), *(free + state.row for state in problem.states)]
        at = np.unique(named, return_inverse=True)[1]
        count = int(at.max(initial=-1)) + 1
        low, high = problem.bounds
        up, down = np.minimum(x + size, high), np.maximum(x - size, low)
        points = np.repeat(x[:, None], 2 * count + 1, axis=1)
        points[each, 1 + at], points[each, 1 + count + at] = up, down
        apart = up - down
        return cls(points, np.where(apart > 0, apart, 1.0), at, owner)

    @property
    def count(self) -> int:
        """Number of points."""
        return self.points.shape[1]

    def columns(self, number: int, experiment: Experiment, channels: FloatArray) -> FloatArray:
        """Return derivatives of one experiment by every number and its residual, shape (n, c, m + 1) [noise sds]."""
        noise, count = experiment.recording.scatter[:, :, None], self.count // 2
        slopes = (channels[:, :, 1 : count + 1] - channels[:, :, count + 1 :])[:, :, self.at] / self.apart / noise
        slopes[:, :, ~np.isfinite(slopes).all(axis=(0, 1)) | ((self.owner >= 0) & (self.owner != number))] = 0.0
        residual = (channels[:, :, :1] - experiment.recording.output[:, :, None]) / noise
        return np.concatenate([slopes, residual], axis=2)


def simulated(bench: Bench, problems: Sequence[Problem], probes: Sequence[Probed]) -> list[list[FloatArray]]:
    """Return the columns of every recording of a bench, for each problem: all in one simulation."""
    sets = [p.expand(probe.points) for p, probe in zip(problems, probes, strict=True)]
    edges = np.cumsum([0, *(probe.count for probe in probes)])
    channels = bench.predict(*(np.concatenate(each, axis=-1) for each in zip(*sets, strict=True)))
    return [
        [
            probe.columns(i, e, c[:, :, first : first + probe.count])
            for i, (e, c) in enumerate(zip(bench.experiments, channels, strict=True))
        ]
        for first, probe in zip(edges, probes, strict=False)
    ]


@dataclass(frozen=True)
class HalfStep:
    """What half the step changes at a parameter vector."""

    change: FloatArray  # (n,), of the fitted residuals, laid out as those of a bench [noise sds]
    resolves_slopes: bool  # whether it leaves the derivatives of the readings as they are


def half_step(problem: Problem, minimum: Minimum, sd: FloatArray) -> HalfStep:
    """Return what half the step changes, from one simulation on either.

    `problem`: on the simulators in question. `minimum`: where, with the derivatives of which intervals were made. `sd`
    (p,): standard deviations of the parameters, by which they are moved; what has none, NaN, is not judged.
    """
    known = np.isfinite(sd) & (sd > 0)
    probe = Probed.around(problem, minimum.x, np.where(known, sd, _LITTLE * problem.scale))
    with np.errstate(over="ignore", invalid="ignore"):
        (own,), (finer,) = (simulated(b, [problem], [probe]) for b in (problem.bench, problem.bench.finer(2)))
        size, apart = (sd * _sizes(each) for each in (finer, [a - b for a, b in zip(own, finer, strict=True)]))
        moved = [b[:, :, -1] - a[:, :, -1] for a, b in zip(own, finer, strict=True)]
    # What is so uncertain that the motion blows up within it tells nothing of the steps.
    judged = known & np.isfinite(size) & np.isfinite(apart)
    # By one standard deviation readings move by about their noise; by less where something else tells the parameter.
    resolved = apart <= _ERROR * np.maximum(size, 1.0)
    # Two that chatter may agree by chance, but move readings by far less than those of which the deviation was made.
    promised = sd * np.linalg.norm(minimum.jacobian[: problem.bench.n_rows], axis=0)
    resolved &= size >= _ERROR * np.minimum(promised, 1.0)
    fitted = [np.where(here, m[: len(here)], 0.0) for m, (_, here) in zip(moved, problem.bench.blocks(), strict=True)]
    return HalfStep(np.concatenate([each.reshape(-1) for each in fitted]), bool(resolved[judged].all()))


def _sizes(columns: Sequence[FloatArray]) -> FloatArray:
    """Return by how much all readings move per unit of every parameter, shape (p,) [noise sds]."""
    slopes = [c[:, :, :-1].reshape(-1, c.shape[2] - 1) for c in columns]
    return np.asarray(np.linalg.norm(np.concatenate(slopes), axis=0), np.float64)
