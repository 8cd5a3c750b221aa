"""Motions that chatter: dry friction at rest on steps that are too long for it tells no derivative at any small step.

What changes by nothing then moves the readings, by less than matters to them and by far more than a small step of a
parameter does: a derivative grows as its step becomes smaller, and passes for knowledge of the parameter.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from discovery.estimation.bench import Bench
from discovery.estimation.covariance import Probed, simulated
from discovery.estimation.problem import Problem, side_by_side
from discovery.foundation.arrays import FloatArray

#: A change of parameters by this part of themselves is none.
_NOTHING = 1e-9
#: It may move readings by as much as a step of a parameter does; where it moves them more, such a step is to move them
#: by so many times as much [noise sds, all readings together].
_QUIET, _CLEAR = 0.3, 5.0
#: Steps grow by this factor, up to a hundredth of the size of a parameter.
_FACTOR, _LARGEST = 10.0, 1e-2


def clear_of_chatter(
    bench: Bench, problems: Sequence[Problem], points: Sequence[FloatArray], sizes: Sequence[FloatArray]
) -> tuple[list[FloatArray], list[list[FloatArray]]]:
    """Return by how much parameters are moved for derivatives (p,), and the columns that follow, see `simulated`.

    They are moved as given, but by more where a motion chatters. What moves the readings by no more than that, however
    far it is moved, is told by none of them: its step is zero.

    `bench`: simulators of all problems. `points`, `sizes` each (p,): where, and the steps in question.
    """
    probes = [Probed.around(*each) for each in zip(problems, points, sizes, strict=True)]
    steps, columns = list(sizes), simulated(bench, problems, probes)
    floor = _by_nothing(bench, problems, points, columns)
    for i in np.flatnonzero(np.isfinite(floor) & (floor > _QUIET)).tolist():
        steps[i], columns[i] = _grown(bench, problems[i], points[i], sizes[i], columns[i], _CLEAR * float(floor[i]))
    return steps, columns


def _by_nothing(
    bench: Bench, problems: Sequence[Problem], points: Sequence[FloatArray], columns: Sequence[list[FloatArray]]
) -> FloatArray:
    """Return how far readings move where parameters are changed by nothing, (problems,) [noise sds]."""
    moved = [(x + _NOTHING * p.scale)[:, None] for p, x in zip(problems, points, strict=True)]
    channels = bench.predict(*side_by_side(problems, moved))
    apart = []
    for k, (e, c) in enumerate(zip(bench.experiments, channels, strict=True)):
        left = (c - e.recording.output[:, :, None]) / e.recording.scatter[:, :, None]
        before = np.stack([own[k][:, :, -1] for own in columns], axis=2)
        present = np.isfinite(e.recording.output)[:, :, None]
        apart.append(np.square(left - before).sum(axis=(0, 1), where=present))
    return np.asarray(np.sqrt(np.sum(apart, axis=0)))


def _grown(
    bench: Bench, problem: Problem, x: FloatArray, size: FloatArray, columns: list[FloatArray], wanted: float
) -> tuple[FloatArray, list[FloatArray]]:
    """Return steps of parameters that move the readings by as much as is wanted, zero where none does, and columns."""
    size, most = size.copy(), _LARGEST * problem.scale
    while True:
        slopes = np.sqrt(sum(np.square(c[:, :, :-1]).sum(axis=(0, 1)) for c in columns))
        short = (slopes * size < wanted) & (size > 0.0)
        if not short.any():
            return size, columns
        size[short & (size >= most)] = 0.0
        size[short] = np.minimum(_FACTOR * size, most)[short]
        (columns,) = simulated(bench, [problem], [Probed.around(problem, x, size)])
