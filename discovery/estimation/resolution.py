"""Whether the steps of a solver resolve how the readings depend on the parameters.

Dry friction on steps that are too long makes the motion chatter: differences of readings are then the solver's and not
the model's, far larger than its slopes, and intervals made of them far too narrow.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from discovery.estimation.bench import Bench
from discovery.estimation.differences import Probed, simulated
from discovery.estimation.problem import Problem

__all__ = ["resolves_slopes"]

FloatArray = NDArray[np.float64]
#: Parameters of which nothing is known are moved by this part of their scale.
_LITTLE = 1e-3
#: Slopes err by so much of themselves at most: their intervals then do by about as much.
_ERROR = 0.5


def resolves_slopes(problem: Problem, x: FloatArray, sd: FloatArray) -> bool:
    """Return whether half the step gives the same derivatives of the readings.

    Parameters
    ----------
    problem : Problem
        On the simulators in question.
    x : ndarray, shape (p,)
        Where.
    sd : ndarray, shape (p,)
        Standard deviations of the parameters, by which they are moved; what has none, NaN, is not judged.
    """
    known = np.isfinite(sd) & (sd > 0)
    probe = Probed.around(problem, x, np.where(known, sd, _LITTLE * problem.scale))
    with np.errstate(over="ignore", invalid="ignore"):
        own, finer = (_slopes(problem, bench, probe) for bench in (problem.bench, problem.bench.finer(2)))
        size, apart = (sd * np.linalg.norm(slopes, axis=0) for slopes in (finer, own - finer))
    # What is so uncertain that the motion blows up within it tells nothing of the steps.
    judged = known & np.isfinite(size) & np.isfinite(apart)
    # By one standard deviation readings move by about their noise; by less where something else tells the parameter.
    return bool(np.all(apart[judged] <= _ERROR * np.maximum(size, 1.0)[judged]))


def _slopes(problem: Problem, bench: Bench, probe: Probed) -> FloatArray:
    """Return the derivatives of all readings by every parameter, shape (n, p) [noise sds]."""
    (columns,) = simulated(bench, [problem], [probe])
    return np.concatenate([c[:, :, :-1].reshape(-1, c.shape[2] - 1) for c in columns])
