r"""What was believed before the recordings, what they added to it, and how much the posterior still leans on it.

A posterior under other priors needs no other chain: its draws are reweighted by the ratio of the priors. With
:math:`w_i = p_k(\theta_i) / p(\theta_i)`, moments under the prior p_k are weighted means over the draws, and
:math:`(\sum w)^2 / (n \sum w^2)` is the share of the draws that still counts [1]_.

.. [1] A. Gelman et al., Bayesian Data Analysis, 3rd ed. (CRC Press, 2013), sections 6.3 and 10.4.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import ArrayLike

from discovery.declarations.parameters import HalfStudent, LogNormal, LogUniform, Normal, Prior, Student
from discovery.foundation.arrays import FloatArray
from discovery.posterior.likelihood import NOISE_PRIOR, LogPosterior
from discovery.posterior.noise.model import Logistic

#: Points of a quadrature, and how many widths it reaches where there is no bound.
_POINTS, _REACH = 20_001, 10.0
#: Scales of a heavy tail.
_FAR = 1e6
_ATTEMPTS = 100
#: How many times as wide all priors are made together.
FACTORS = (0.5, 2.0)
#: A change beyond this, in posterior standard deviations, means that the prior matters.
LIMIT = 0.2
#: Effective draws below which the reweighted moments mean nothing.
_FEWEST = 100


@dataclass(frozen=True)
class MarginalPrior:
    """Prior of one parameter, as declared or as the rig states it, in its `unit` [SI], cut off at `bounds` [SI]."""

    prior: Prior
    unit: float
    bounds: tuple[float, float]

    def log_density(self, x: ArrayLike) -> FloatArray:
        """Return the log density at `x` [SI] up to a constant, minus infinity outside the bounds."""
        x = np.asarray(x, float)
        inside = (x >= self.bounds[0]) & (x <= self.bounds[1])
        return np.where(inside, self.prior.log_density(x / self.unit), -np.inf)

    @property
    def sd(self) -> float:
        """Standard deviation within the bounds [SI]; infinite for a flat prior without bounds."""
        proper = isinstance(self.prior, (Normal, Student, HalfStudent, LogNormal, LogUniform))
        if not proper and not np.isfinite(self.bounds).all():
            return math.inf
        x = self._grid()
        log_density = self.log_density(x)
        density = np.exp(log_density - log_density.max())
        total = np.trapezoid(density, x)
        mean = np.trapezoid(x * density, x) / total
        return math.sqrt(np.trapezoid((x - mean) ** 2 * density, x) / total)

    def _grid(self) -> FloatArray:
        lower, upper = self.bounds
        if isinstance(self.prior, LogNormal):
            # Evenly in the logarithm: such a prior spans decades.
            far = np.exp(_REACH * self.prior.log_sd)
            middle = self.prior.median * self.unit
            return np.geomspace(max(lower, middle / far), min(upper, middle * far), _POINTS)
        if isinstance(self.prior, LogUniform):
            ends = np.geomspace(1.0 / self.prior.factor, self.prior.factor, _POINTS) * self.prior.size * self.unit
            return np.clip(ends if upper > 0.0 else -ends[::-1], lower, upper)
        if isinstance(self.prior, HalfStudent | Student):
            # Densely where it is large, and far into its tail.
            size = self.prior.scale * self.unit
            first, last = np.arcsinh(np.clip([lower / size, upper / size], -_FAR, _FAR))
            return size * np.sinh(np.linspace(first, last, _POINTS))
        if isinstance(self.prior, Normal):
            middle, reach = self.prior.mean * self.unit, _REACH * self.prior.sd * self.unit
            lower, upper = max(lower, middle - reach), min(upper, middle + reach)
        return np.linspace(lower, upper, _POINTS)

    def widened(self, factor: float) -> MarginalPrior:
        """Return the prior so many times as wide, with the same centre and bounds; a flat one stays what it is."""
        if isinstance(self.prior, Normal):
            return replace(self, prior=replace(self.prior, sd=factor * self.prior.sd))
        if isinstance(self.prior, HalfStudent | Student):
            return replace(self, prior=replace(self.prior, scale=factor * self.prior.scale))
        if isinstance(self.prior, LogNormal):
            return replace(self, prior=replace(self.prior, log_sd=factor * self.prior.log_sd))
        return self

    def summary(self) -> dict[str, Any]:
        """Return the law with its numbers in SI units, JSON-ready."""
        prior, unit = self.prior, self.unit
        if isinstance(prior, Normal):
            return {"law": "normal", "mean": prior.mean * unit, "sd": prior.sd * unit}
        if isinstance(prior, HalfStudent):
            return {"law": "half-t", "scale": prior.scale * unit}
        if isinstance(prior, Student):
            return {"law": "t", "scale": prior.scale * unit}
        if isinstance(prior, LogNormal):
            return {"law": "log-normal", "median": prior.median * unit, "log_sd": prior.log_sd}
        if isinstance(prior, LogUniform):
            return {"law": "log-uniform", "size": prior.size * unit, "factor": prior.factor}
        return {"law": "flat"}


def marginal_priors(target: LogPosterior) -> dict[str, MarginalPrior]:
    """Return the priors of the free physical parameters of a posterior, by name."""
    free = target.problem.free
    bounds = zip(*(edge.tolist() for edge in target.problem.bounds), strict=True)
    return {
        name: MarginalPrior(prior, unit, both)
        for name, (prior, unit), both in zip(free, target.problem.priors, bounds, strict=False)
    }


def prior_draws(target: LogPosterior, count: int, rng: Generator) -> dict[str, FloatArray]:
    """Return so many independent draws from the priors, cut off at the parameters' bounds, by name in SI units.

    Quantities whose prior is no distribution, flat without bounds, are left out.
    """
    problem = target.problem
    noise = [NOISE_PRIOR] * len(target.instruments) + [p.prior for model in target.models for p in model.parameters]
    laws = [*target.problem.priors, *((prior, 1.0) for prior in noise)]
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
            case Student(scale):
                x = unit * scale * rng.standard_t(3, count)
            case LogNormal(median, log_sd):
                x = unit * median * np.exp(rng.normal(0.0, log_sd, count))
            case LogUniform(size, factor):
                x = np.copysign(unit * size, low + high) * factor ** rng.uniform(-1.0, 1.0, count)
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


@dataclass(frozen=True)
class PriorEffect:
    """Prior against posterior of one parameter, and what other widths of all priors would do to it.

    `prior_sd` is the prior's standard deviation within its bounds [SI], `contraction` 1 - var_post / var_prior: 1 where
    the recordings say all, 0 where the prior does. By factor of the widths: `shift`, the change of the mean in
    posterior standard deviations, `sd_ratio`, the new standard deviation over the old one, and `effective`, the share
    of the draws that still counts.
    """

    name: str
    prior_sd: float
    contraction: float
    shift: Mapping[float, float]
    sd_ratio: Mapping[float, float]
    effective: Mapping[float, float]
    draws: int

    @property
    def sensitive(self) -> bool:
        """Whether mean or standard deviation change by more than `LIMIT`, or nobody can tell."""
        return any(
            abs(self.shift[k]) > LIMIT
            or abs(self.sd_ratio[k] - 1) > LIMIT
            or self.effective[k] * self.draws < min(_FEWEST, self.draws)
            for k in self.shift
        )


def prior_effects(draws: Mapping[str, FloatArray], priors: Mapping[str, MarginalPrior]) -> list[PriorEffect]:
    """Return what the priors matter, one row a parameter, from draws (n,) [SI] under these priors."""
    weights = {k: _weights(draws, priors, k) for k in FACTORS}
    found = []
    for name, prior in priors.items():
        x = draws[name]
        mean, sd = float(x.mean()), float(x.std())
        moments = {k: _moments(x, w) for k, w in weights.items()}
        prior_sd = prior.sd
        found.append(
            PriorEffect(
                name,
                prior_sd,
                contraction=1 - (sd / prior_sd) ** 2,
                shift={k: (m - mean) / sd for k, (m, _) in moments.items()},
                sd_ratio={k: s / sd for k, (_, s) in moments.items()},
                effective={k: float(1 / (w.size * np.sum(w**2))) for k, w in weights.items()},
                draws=x.size,
            )
        )
    return found


def _weights(draws: Mapping[str, FloatArray], priors: Mapping[str, MarginalPrior], factor: float) -> FloatArray:
    """Return the normalised weights of the draws under priors that are all so many times as wide."""
    logs = sum(
        prior.widened(factor).log_density(draws[name]) - prior.log_density(draws[name])
        for name, prior in priors.items()
    )
    weights = np.exp(logs - np.max(logs))
    return weights / weights.sum()


def _moments(x: FloatArray, weights: FloatArray) -> tuple[float, float]:
    mean = float(np.einsum("i,i->", weights, x))
    return mean, float(np.sqrt(np.einsum("i,i->", weights, (x - mean) ** 2)))
