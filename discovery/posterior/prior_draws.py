"""Draws from the prior of everything that a posterior samples: what was believed before the recordings."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from discovery.declarations.parameters import HalfStudent, LogNormal, Normal, Prior
from discovery.posterior.likelihood import NOISE_PRIOR, LogPosterior
from discovery.posterior.noise.model import Logistic

__all__ = ["prior_draws"]

FloatArray = NDArray[np.float64]
_ATTEMPTS = 100


def prior_draws(target: LogPosterior, count: int, rng: Generator) -> dict[str, FloatArray]:
    """Return independent draws from the priors, cut off at the parameters' bounds.

    Returns
    -------
    dict of str to ndarray, shape (count,)
        In SI units; quantities whose prior is no distribution, flat without bounds, are left out.
    """
    problem = target.problem
    noise = [NOISE_PRIOR] * len(target.instruments) + [p.prior for model in target.models for p in model.parameters]
    laws = [*target.priors, *((prior, 1.0) for prior in noise)]
    open_ends = np.full(len(noise), np.inf)
    lower, upper = np.append(problem.bounds[0], -open_ends), np.append(problem.bounds[1], open_ends)
    columns = [
        _drawn(prior, unit, low, high, count, rng)
        for (prior, unit), low, high in zip(laws, lower.tolist(), upper.tolist(), strict=True)
    ]
    proper = [name for name, column in zip(target.names, columns, strict=True) if column is not None]
    vectors = np.stack([np.full(count, c) if x is None else x for x, c in zip(columns, target.centre, strict=True)], 1)
    z = np.linalg.solve(target.factor, (vectors - target.centre).T).T
    values = target.values(np.asarray(z, np.float64))
    return {name: values[:, i] for i, name in enumerate(target.names) if name in proper}


def _drawn(prior: Prior, unit: float, low: float, high: float, count: int, rng: Generator) -> FloatArray | None:
    """Return draws of one sampled number between its bounds; None where the prior is no distribution."""
    found = np.empty(0)
    for _ in range(_ATTEMPTS):
        match prior:
            case Normal(mean, sd):
                x = unit * rng.normal(mean, sd, count)
            case HalfStudent(scale):
                x = unit * scale * np.abs(rng.standard_t(3, count))
            case LogNormal(median, log_sd):
                x = unit * median * np.exp(rng.normal(0.0, log_sd, count))
            case Logistic():
                x = unit * rng.logistic(size=count)
            case _ if np.isfinite([low, high]).all():
                return rng.uniform(low, high, count)
            case _:
                return None
        found = np.append(found, x[(x >= low) & (x <= high)])[:count]
        if found.size == count:
            return found
    return None
