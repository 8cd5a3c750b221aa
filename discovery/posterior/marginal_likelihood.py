"""The evidence of a model: its likelihood averaged over the priors, by importance sampling around the fit."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.random import Generator

from discovery.declarations.priors import Prior
from discovery.estimation.importance import Weighted, importance_sample
from discovery.foundation.arrays import FloatArray
from discovery.foundation.errors import InputError
from discovery.posterior.likelihood import LogPosterior

#: Fewer draws tell nothing of an integral.
FEWEST_DRAWS = 100


@dataclass(frozen=True)
class Evidence:
    """Log evidence of a model under one noise model, and the weighted draws, whitened, that it comes from.

    It is the natural logarithm of the density of the readings [SI units], with the priors normalised within the bounds.
    """

    target: LogPosterior
    drawn: Weighted
    log_evidence: float

    @property
    def reliable(self) -> bool:
        """Whether the number can be trusted, see `Weighted.reliable`."""
        return self.drawn.reliable

    @cached_property
    def values(self) -> FloatArray:
        """Draws in SI units, shape (n, d); they count by the weights of `drawn`."""
        return self.target.values(self.drawn.points)

    def intervals(self) -> dict[str, list[float]]:
        """Return 5, 50 and 95 % quantiles of every sampled quantity."""
        return {
            name: self.drawn.quantiles(column) for name, column in zip(self.target.names, self.values.T, strict=True)
        }

    def summary(self) -> dict[str, Any]:
        """Return a JSON-ready row."""
        return {
            "noise": self.target.noise,
            "log_evidence": self.log_evidence,
            "error": self.drawn.error,
            "pareto_k": self.drawn.pareto_k if math.isfinite(self.drawn.pareto_k) else None,
            "effective": self.drawn.effective,
            "draws": len(self.drawn.points),
            "reliable": self.reliable,
            "intervals": self.intervals(),
        }


def log_evidence(target: LogPosterior, rng: Generator, draws: int = 4000) -> Evidence:
    """Return the log evidence of a posterior, by so many draws; look at `Evidence.reliable` before its number.

    ComputationError if no draw has a finite density; InputError if a prior is no density, so that there is no evidence.
    """
    drawn = importance_sample(target, target.dimension, rng, draws, frame=target.factor)
    scale = float(np.log(np.diag(target.factor)).sum())
    return Evidence(target, drawn, drawn.log_integral + scale - log_prior_mass(target))


def log_prior_mass(target: LogPosterior) -> float:
    """Return the logarithm of the part of the priors that lies within the bounds; each must be a density."""
    lower, upper = target.problem.bounds
    return sum(
        _log_mass(prior, a, b)
        for prior, a, b in zip(target.problem.priors, lower.tolist(), upper.tolist(), strict=True)
    )


def _log_mass(prior: Prior, lower: float, upper: float) -> float:
    """Return the logarithm of the integral of a prior between bounds."""
    from scipy.integrate import quad

    width, centre = prior.width, float(getattr(prior, "mean", 0.0))
    # Over a scale on which the prior is about one wide, also where the bounds are at infinity.
    ends = math.asinh((lower - centre) / width), math.asinh((upper - centre) / width)
    a, b = (math.copysign(min(abs(end), 25.0), end) for end in ends)
    mass, _ = quad(
        lambda s: float(np.exp(prior.log_density(centre + width * math.sinh(s)))) * width * math.cosh(s),
        a,
        b,
        limit=200,
    )
    if not 0.0 < mass < 1e6:
        raise InputError("The evidence needs priors that are densities; one is flat without bounds.")
    return math.log(mass)
