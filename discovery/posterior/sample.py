"""A sample of the posterior: its draws, how they were made, and what they say of every quantity."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from discovery.equations.model import Model
from discovery.estimation.natural_units import NaturalUnits
from discovery.plots.posteriors import PosteriorViews
from discovery.posterior.noise import is_independent, words_of

if TYPE_CHECKING:
    pass

__all__ = ["INTERVAL", "Sample"]

FloatArray = NDArray[np.float64]

#: What the intervals of a summary are; `Posterior.interval` adds the noise.
INTERVAL = "equal-tailed 90 % credible interval"
_QUANTILES = (0.05, 0.5, 0.95)


@dataclass(frozen=True, repr=False)
class Sample(PosteriorViews):
    """Draws from a posterior, with what they mean and how well they converged.

    Parameters
    ----------
    names : tuple of str
        Free physical parameters, initial deflection and rate in every recording, noise of every instrument.
    units : mapping of str to str
        Unit of every quantity.
    draws : ndarray, shape (ensembles, draws, walkers, d)
        In SI units, after burn-in, thinned to about two an autocorrelation time.
    log_probability, log_likelihood : ndarray, shape (ensembles, draws, walkers)
        Log posterior density up to the evidence, of the logarithm of the noise; and log likelihood.
    r_hat, tau, ess : mapping of str to float
        See `discovery.posterior.diagnostics.Convergence`.
    ess_tail : mapping of str to float
        Effective number of samples for the 5 and 95 % quantiles, the smaller of both.
    acceptance : mapping of str to float
        Accepted part of the proposals of every kind of move, since the last adaptation.
    prior : mapping of str to ndarray, shape (m,)
        Draws from the prior in SI units; without the quantities whose prior is no distribution.
    reference : mapping of str to (float, float)
        Estimate and standard deviation of the fit from which sampling started; NaN where it has none.
    stated_noise : mapping of str to float
        Noise that the rig states, by name of the noise parameter.
    meanings : mapping of str to str
        What every quantity of the noise means.
    model : Model
        The model.
    natural : NaturalUnits
        Natural units of its declarations.
    gaussian : mapping of str to (mean, sd)
        Parameters free within the rig's uncertainty.
    step : float
        Integration step, the shortest where they differ [s].
    provenance : mapping of str to object
        Seed, versions, hashes of the recordings, settings: JSON-ready.
    """

    names: tuple[str, ...]
    units: Mapping[str, str]
    draws: FloatArray
    log_probability: FloatArray
    log_likelihood: FloatArray
    r_hat: Mapping[str, float]
    tau: Mapping[str, float]
    ess: Mapping[str, float]
    ess_tail: Mapping[str, float]
    acceptance: Mapping[str, float]
    prior: Mapping[str, FloatArray]
    reference: Mapping[str, tuple[float, float]]
    stated_noise: Mapping[str, float]
    meanings: Mapping[str, str]
    model: Model
    natural: NaturalUnits
    gaussian: Mapping[str, tuple[float, float]]
    step: float
    provenance: Mapping[str, Any]

    def flat(self) -> dict[str, FloatArray]:
        """Return all draws of every quantity by name."""
        return {name: self.draws[..., i].ravel() for i, name in enumerate(self.names)}

    @property
    def noise(self) -> str:
        """Name of the noise model that was sampled."""
        return str(self.provenance["noise"])

    @property
    def interval(self) -> str:
        """What the intervals of the summary are, and under which noise."""
        return f"{INTERVAL}, errors of the readings taken as {words_of(self.noise)}"

    @property
    def status(self) -> str:
        """One sentence on what the intervals mean; it warns where the noise had to absorb misfit."""
        absorbed = self._absorbed()
        if absorbed is None:
            return (
                "The residuals are not clearly larger than the noise that is stated or estimated; the intervals take "
                f"them as {words_of(self.noise)}."
            )
        meant = (
            "so the intervals are naive and may be far too wide or too narrow."
            if is_independent(self.noise)
            else "so the intervals are as honest as that is."
        )
        return (
            f"{absorbed[0]} is {absorbed[1]:.3g} times the stated noise: the model leaves a systematic residual, which "
            f"is taken as noise that is {words_of(self.noise)}, {meant}"
        )

    @property
    def warns(self) -> bool:
        """Whether the noise had to absorb misfit."""
        return self._absorbed() is not None

    def _absorbed(self) -> tuple[str, float] | None:
        """Return the quantity of the noise that is larger than stated, and how many times; None without one."""
        flat = self.flat()
        for name, stated in self.stated_noise.items():
            low, middle = np.quantile(flat[name] / stated, _QUANTILES[:2])
            if low > 1.0 and middle > 1.1:
                return name, float(middle)
        return None

    def summary(self) -> list[dict[str, Any]]:
        """Return one JSON-ready row a quantity, in its unit.

        Mean, its Monte Carlo standard error, sd, quantiles; R-hat between the ensembles, effective samples of the bulk
        and of the tails; the fit's value and sd; and what a quantity of the noise means.
        """
        rows = []
        for name, values in self.flat().items():
            low, middle, high = np.quantile(values, _QUANTILES)
            value, sd = self.reference[name]
            rows.append(
                {
                    "name": name,
                    "unit": self.units[name],
                    "mean": float(values.mean()),
                    "mcse": float(values.std(ddof=1)) / math.sqrt(self.ess[name]),
                    "sd": float(values.std(ddof=1)),
                    "q05": float(low),
                    "q50": float(middle),
                    "q95": float(high),
                    "interval": self.interval,
                    "r_hat": self.r_hat[name],
                    "ess": self.ess[name],
                    "ess_tail": self.ess_tail[name],
                    "fit_value": value,
                    "fit_sd": sd if math.isfinite(sd) else None,
                    **({"meaning": self.meanings[name]} if name in self.meanings else {}),
                }
            )
        return rows
