"""What half the step changes: the readings, and how they depend on the parameters.

Dry friction on steps that are too long makes the motion chatter: differences of readings are then the solver's and not
the model's, far larger than its slopes, and intervals made of them far too narrow.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from discovery.estimation.differences import Probed, simulated
from discovery.estimation.problem import Problem

__all__ = ["HalfStep", "half_step"]

FloatArray = NDArray[np.float64]
#: Parameters of which nothing is known are moved by this part of their scale.
_LITTLE = 1e-3
#: Slopes err by so much of themselves at most: their intervals then do by about as much.
_ERROR = 0.5


@dataclass(frozen=True)
class HalfStep:
    """What half the step changes at a parameter vector.

    Parameters
    ----------
    change : ndarray, shape (n,)
        Of the fitted residuals, laid out as those of a bench [noise sds].
    resolves_slopes : bool
        Whether it leaves the derivatives of the readings as they are.
    """

    change: FloatArray
    resolves_slopes: bool


def half_step(problem: Problem, x: FloatArray, sd: FloatArray) -> HalfStep:
    """Return what half the step changes, from one simulation on either.

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
        (own,), (finer,) = (simulated(b, [problem], [probe]) for b in (problem.bench, problem.bench.finer(2)))
        size, apart = (sd * _sizes(each) for each in (finer, [a - b for a, b in zip(own, finer, strict=True)]))
        moved = [b[:, :, -1] - a[:, :, -1] for a, b in zip(own, finer, strict=True)]
    # What is so uncertain that the motion blows up within it tells nothing of the steps.
    judged = known & np.isfinite(size) & np.isfinite(apart)
    # By one standard deviation readings move by about their noise; by less where something else tells the parameter.
    resolved = bool(np.all(apart[judged] <= _ERROR * np.maximum(size, 1.0)[judged]))
    fitted = [np.where(here, m[: len(here)], 0.0) for m, (_, here) in zip(moved, problem.bench.blocks(), strict=True)]
    return HalfStep(np.concatenate([each.reshape(-1) for each in fitted]), resolved)


def _sizes(columns: Sequence[FloatArray]) -> FloatArray:
    """Return by how much all readings move per unit of every parameter, shape (p,) [noise sds]."""
    slopes = [c[:, :, :-1].reshape(-1, c.shape[2] - 1) for c in columns]
    return np.asarray(np.linalg.norm(np.concatenate(slopes), axis=0), np.float64)
