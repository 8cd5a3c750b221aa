"""Generalised least squares: several problems fitted, each under a model error of a size."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from discovery.estimation.batch import fit_problems
from discovery.estimation.least_squares import Minimum
from discovery.estimation.model_error import ModelError
from discovery.estimation.problem import Problem

__all__ = ["generalised"]


def generalised(
    problems: Sequence[Problem],
    starts: Sequence[NDArray[np.float64]],
    sizes: Sequence[float],
    *,
    iterations: int,
    tolerance: float,
) -> list[Minimum]:
    """Return the minima under model errors of some sizes over the noise; their residuals are in noise sds again."""
    weighted = [replace(p, error=ModelError.of(s, p.units.time)) for p, s in zip(problems, sizes, strict=True)]
    minima = fit_problems(weighted, starts, iterations=iterations, tolerance=tolerance, rough=True)
    return [_in_noise(p, m) for p, m in zip(problems, minima, strict=True)]


def _in_noise(problem: Problem, minimum: Minimum) -> Minimum:
    """Return a minimum with its residual in noise sds; the Jacobian stays white."""
    if not np.isfinite(minimum.cost):
        return minimum
    x = minimum.x[:, None]
    data = problem.bench.residuals(*problem.expand(x))[:, 0]
    residual = np.append(data, problem.prior_residuals(x)[:, 0])
    return replace(minimum, residual=residual, cost=0.5 * float(residual @ residual))
