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
) -> list[FloatArray]:
    """Return by how much parameters are moved for derivatives (p,): as given, but by more where a motion chatters.

    What moves the readings by no more than that, however far it is moved, is told by none of them: its step is zero.

    `bench`: simulators of all problems. `points`, `sizes` each (p,): where, and the steps in question.
    """
    floor = _by_nothing(bench, problems, points)
    found = list(sizes)
    for i in np.flatnonzero(np.isfinite(floor) & (floor > _QUIET)).tolist():
        found[i] = _grown(bench, problems[i], points[i], sizes[i], _CLEAR * float(floor[i]))
    return found


def _by_nothing(bench: Bench, problems: Sequence[Problem], points: Sequence[FloatArray]) -> FloatArray:
    """Return how far readings move where parameters are changed by nothing, (problems,) [noise sds]."""
    columns = [np.column_stack([x, x + _NOTHING * p.scale]) for p, x in zip(problems, points, strict=True)]
    channels = bench.predict(*side_by_side(problems, columns))
    apart = [
        np.square((c[:, :, 1::2] - c[:, :, 0::2]) / e.recording.scatter[:, :, None]).sum(axis=(0, 1))
        for e, c in zip(bench.experiments, channels, strict=True)
    ]
    return np.asarray(np.sqrt(np.sum(apart, axis=0)))


def _grown(bench: Bench, problem: Problem, x: FloatArray, size: FloatArray, wanted: float) -> FloatArray:
    """Return steps of parameters that move the readings by as much as is wanted; zero where none does."""
    size, most = size.copy(), _LARGEST * problem.scale
    while True:
        (columns,) = simulated(bench, [problem], [Probed.around(problem, x, size)])
        slopes = np.sqrt(sum(np.square(c[:, :, :-1]).sum(axis=(0, 1)) for c in columns))
        short = (slopes * size < wanted) & (size > 0.0)
        if not short.any():
            return size
        size[short & (size >= most)] = 0.0
        size[short] = np.minimum(_FACTOR * size, most)[short]
