"""Fits once a search is over: generalised least squares on all recordings; intervals that odds exclude left out."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from discovery.declarations.registry import get_effect
from discovery.estimation.batch import fit_problems
from discovery.estimation.bench import Bench
from discovery.estimation.fit import Fit
from discovery.estimation.least_squares import Minimum
from discovery.estimation.model_error import ModelError
from discovery.estimation.problem import Problem
from discovery.foundation.arrays import FloatArray

#: Rounds in which a fit to a part becomes one to all.
_ITERATIONS = 25
#: Squared distance from none, in variances, up to which an interval of 90 % holds none.
_HOLDS = 1.645**2
#: Why a value may have no interval.
BENT = "its posterior is too bent for an interval"


def generalised(
    problems: Sequence[Problem],
    starts: Sequence[FloatArray],
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
    """Return a minimum with its residual in noise sds, less what is believed of sizes; the Jacobian stays white."""
    if not np.isfinite(minimum.cost):
        return minimum
    x = minimum.x[:, None]
    data = problem.bench.residuals(*problem.expand(x))[:, 0]
    residual = np.append(data, problem.prior_residuals(x)[:, 0])
    cost, jacobian = 0.5 * float(residual @ residual), minimum.jacobian[: residual.size]
    return replace(minimum, residual=residual, cost=cost, jacobian=jacobian)


def fitted_to_all(found: Fit, error: float, bench: Bench) -> Fit:
    """Return the same model fitted to other recordings by generalised least squares, from where it is.

    Intervals stay those of the part: a model error in a parameter's direction does not average out, and without one
    they are wider than all readings would give.

    `found`: on parts of the recordings; it is returned where the motion blows up beyond them. `error`: size of the
    model error [noise sds]. `bench`: simulators of the recordings, of the same names.
    """
    problem = replace(found.problem, bench=bench)
    start = problem.start(found.values)
    (minimum,) = generalised([problem], [start], [error], iterations=_ITERATIONS, tolerance=1e-6)
    return replace(found, problem=problem, minimum=minimum) if np.isfinite(minimum.cost) else found


def without_bent(fit: Fit, effects: Iterable[str]) -> Fit:
    """Return a fit without the intervals of effects that hold none of the effect, though it is known to be there.

    The odds compare with a refit that lacks the effect, an interval extrapolates to it from the slopes at the estimate.
    Where the two contradict each other the posterior is not normal: a law that saturates, a valley that ends before
    the amplitude vanishes.

    `fit`: with intervals to first order. `effects`: effects whose absence the odds exclude.
    """
    at = {n: i for i, n in enumerate(fit.problem.names)}
    reasons, covariance = dict(fit.reasons), fit.covariance.copy()
    for effect in effects:
        own = [p for p in get_effect(effect).parameters() if p.name in at and p.name not in fit.reasons]
        sizes = [at[p.name] for p in own if not p.shape]
        spread = np.sqrt(np.diag(fit.covariance)[sizes])
        away = fit.minimum.x[sizes] / spread
        known = fit.covariance[np.ix_(sizes, sizes)] / np.outer(spread, spread)
        if not sizes or not away @ np.linalg.pinv(known, hermitian=True) @ away < _HOLDS:
            continue
        for p in own:
            reasons[p.name] = BENT
            covariance[at[p.name], :] = covariance[:, at[p.name]] = np.nan
    return replace(fit, reasons=reasons, covariance=covariance)
