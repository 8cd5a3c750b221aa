"""A model that was fitted to a part of long recordings, fitted to the whole of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from discovery.estimation.batch import fit_problems
from discovery.estimation.fit import Fit
from discovery.estimation.model_error import ModelError
from discovery.recordings.experiment import Experiment

__all__ = ["fitted_to_all"]

_ITERATIONS = 25


def fitted_to_all(found: Fit, error: float, experiments: Sequence[Experiment]) -> Fit:
    """Return the same model fitted to other recordings by generalised least squares, from where it is.

    Intervals stay those of the part: a model error in a parameter's direction does not average out, and without one
    they are wider than all readings would give.

    Parameters
    ----------
    found : Fit
        On parts of the recordings; it is returned where the motion blows up beyond them.
    error : float
        Size of the model error [noise sds].
    experiments : sequence of Experiment
        The recordings, of the same names.
    """
    old = found.problem
    problem = replace(old, bench=old.bench.of_others(experiments))
    weighted = replace(problem, error=ModelError.of(error, old.units.time))
    start = problem.start(found.values)
    (minimum,) = fit_problems([weighted], [start], iterations=_ITERATIONS, tolerance=1e-6, rough=True)
    if not np.isfinite(minimum.cost):
        return found
    residual = problem.bench.residuals(*problem.expand(minimum.x[:, None]))[:, 0]
    residual = np.append(residual, problem.prior_residuals(minimum.x[:, None])[:, 0])
    minimum = replace(minimum, residual=residual, cost=0.5 * float(residual @ residual))
    return replace(found, problem=problem, minimum=minimum)
