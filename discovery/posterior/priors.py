r"""What was believed before the recordings, what they added to it, and how much the posterior still leans on it.

A posterior under other priors needs no other chain: its draws are reweighted by the ratio of the priors. With
:math:`w_i = p_k(\theta_i) / p(\theta_i)`, moments under the prior p_k are weighted means over the draws, and
:math:`(\sum w)^2 / (n \sum w^2)` is the share of the draws that still counts [1]_.

.. [1] A. Gelman et al., Bayesian Data Analysis, 3rd ed. (CRC Press, 2013), sections 6.3 and 10.4.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from numpy.typing import ArrayLike

from discovery.declarations.priors import Prior
from discovery.foundation.arrays import FloatArray
from discovery.posterior.likelihood import NOISE_PRIOR, LogPosterior

#: Points of a quadrature, and how often draws beyond the bounds are made anew.
_POINTS, _ATTEMPTS = 20_001, 100
#: How many times as wide all priors are made together.
FACTORS = (0.5, 2.0)
#: A change beyond this, in posterior standard deviations, means that the prior matters.
LIMIT = 0.2
#: Effective draws below which the reweighted moments mean nothing.
_FEWEST = 100


@dataclass(frozen=True)
class MarginalPrior:
    """Prior of one parameter [SI], as declared or as the rig states it, cut off at `bounds` [SI]."""

    prior: Prior
    bounds: tuple[float, float]

    def log_density(self, x: ArrayLike) -> FloatArray:
        """Return the log density at `x` [SI] up to a constant, minus infinity outside the bounds."""
        x = np.asarray(x, float)
        inside = (x >= self.bounds[0]) & (x <= self.bounds[1])
        return np.where(inside, self.prior.log_density(x), -np.inf)

    @property
    def sd(self) -> float:
        """Standard deviation within the bounds [SI]; infinite for a flat prior without bounds."""
        if not self.prior.is_proper and not np.isfinite(self.bounds).all():
            return math.inf
        x = self.prior.nodes(*self.bounds, _POINTS)
        log_density = self.log_density(x)
        density = np.exp(log_density - log_density.max())
        total = np.trapezoid(density, x)
        mean = np.trapezoid(x * density, x) / total
        return math.sqrt(np.trapezoid((x - mean) ** 2 * density, x) / total)

    def draws(self, count: int, rng: Generator) -> FloatArray | None:
        """Return independent draws within the bounds [SI]; None where the prior is no distribution."""
        low, high = self.bounds
        if not self.prior.is_proper:
            return rng.uniform(low, high, count) if np.isfinite(self.bounds).all() else None
        found = np.empty(0)
        for _ in range(_ATTEMPTS):
            x = self.prior.draws(rng, count)
            found = np.append(found, x[(x >= low) & (x <= high)])[:count]
            if found.size == count:
                return found
        return None


def marginal_priors(target: LogPosterior) -> dict[str, MarginalPrior]:
    """Return the priors of the free physical parameters of a posterior, by name."""
    return dict(zip(target.problem.free, _sampled_priors(target), strict=False))


def _sampled_priors(target: LogPosterior) -> list[MarginalPrior]:
    """Return the priors of all that is sampled: free numbers of the problem, then those of the noise."""
    noise = [NOISE_PRIOR] * len(target.instruments) + [p.prior for model in target.models for p in model.parameters]
    bounds = zip(*(edge.tolist() for edge in target.problem.bounds), strict=True)
    own = [MarginalPrior(prior, both) for prior, both in zip(target.problem.priors, bounds, strict=True)]
    return [*own, *(MarginalPrior(prior, (-math.inf, math.inf)) for prior in noise)]


def prior_draws(target: LogPosterior, count: int, rng: Generator) -> dict[str, FloatArray]:
    """Return so many independent draws from the priors, cut off at the parameters' bounds, by name in SI units.

    Quantities whose prior is no distribution, flat without bounds, are left out.
    """
    columns = [prior.draws(count, rng) for prior in _sampled_priors(target)]
    proper = [name for name, column in zip(target.names, columns, strict=True) if column is not None]
    vectors = np.stack([np.full(count, c) if x is None else x for x, c in zip(columns, target.centre, strict=True)], 1)
    z = np.linalg.solve(target.factor, (vectors - target.centre).T).T
    values = target.values(np.asarray(z, np.float64))
    return {name: values[:, i] for i, name in enumerate(target.names) if name in proper}


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
    laws = {name: own.prior for name, own in priors.items()}
    logs = sum(p.widened(factor).log_density(draws[name]) - p.log_density(draws[name]) for name, p in laws.items())
    weights = np.exp(logs - np.max(logs))
    return weights / weights.sum()


def _moments(x: FloatArray, weights: FloatArray) -> tuple[float, float]:
    mean = float(np.einsum("i,i->", weights, x))
    return mean, float(np.sqrt(np.einsum("i,i->", weights, (x - mean) ** 2)))
