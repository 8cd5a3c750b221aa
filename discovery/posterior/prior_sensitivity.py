r"""What the recordings added to the priors, and how much the posterior still leans on them.

A posterior under other priors needs no other chain: its draws are reweighted by the ratio of the priors. With
:math:`w_i = p_k(\theta_i) / p(\theta_i)`, moments under the prior p_k are weighted means over the draws, and
:math:`(\sum w)^2 / (n \sum w^2)` is the share of the draws that still counts [1]_.

.. [1] A. Gelman et al., Bayesian Data Analysis, 3rd ed. (CRC Press, 2013), sections 6.3 and 10.4.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from discovery.foundation.arrays import FloatArray
from discovery.posterior.priors import MarginalPrior

#: How many times as wide all priors are made together.
FACTORS = (0.5, 2.0)
#: A change beyond this, in posterior standard deviations, means that the prior matters.
LIMIT = 0.2
#: Effective draws below which the reweighted moments mean nothing.
_FEWEST = 100


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
