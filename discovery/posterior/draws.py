"""Draws from the posterior of a model: what they mean, how well they converged, their table and their file."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass
from io import BytesIO
from typing import TYPE_CHECKING, Any

import numpy as np

from discovery.equations.model import Model
from discovery.estimation.natural_units import NaturalUnits
from discovery.foundation.arguments import as_path, check_whole
from discovery.foundation.arrays import FloatArray
from discovery.foundation.errors import InputError
from discovery.foundation.io import atomic_write
from discovery.plots.estimates import PosteriorViews
from discovery.posterior.noise import is_independent, words_of
from discovery.posterior.tree import as_tree, check_pointwise, fields_of, readings, sampled, some
from discovery.recordings.chosen import Recordings, training_of

if TYPE_CHECKING:
    import xarray as xr

#: What the intervals of a summary are; `Posterior.interval` adds the noise.
INTERVAL = "equal-tailed 90 % credible interval"
_QUANTILES = (0.05, 0.5, 0.95)
#: Draws of which a file keeps what they would read again, and readings that it keeps of them at most.
_REPLICATED, _KEPT = 100, 2_000_000


@dataclass(frozen=True, repr=False)
class Posterior(PosteriorViews):
    """The sampled posterior: its draws, with what they mean and how well they converged.

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

    Examples
    --------
    >>> data = load_dataset("datasets/spring_bench/rig.toml")
    >>> part = [data.train[0].first(100)]  # its first second
    >>> fit = fit_model(declared_model(data), part)
    >>> posterior = sample(fit, min_effective=500)
    >>> posterior.to_pandas()["mean"].round(1).to_dict()  # s^-1, s^-2, m
    {'xi': 0.4, 'alpha': 400.0, 'sigma': 0.0}
    >>> round(float(posterior.flat()["alpha"].mean()), 1), posterior.summary()[1]["unit"]
    (400.0, 's^-2')
    >>> posterior.to_netcdf("posterior.nc")
    >>> Posterior.from_netcdf("posterior.nc").initial_states().index.tolist()
    ['train_high']
    >>> sorted(posterior.to_tree().children), len(posterior.plot_marginals(["alpha"]))
    (['posterior', 'prior', 'sample_stats'], 1)
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

    def to_arviz(self, data: Recordings | None = None, *, draws: int = 400, pointwise: bool = True) -> xr.DataTree:
        """Return some of the draws with everything that ArviZ asks for.

        The groups posterior, sample_stats, posterior_predictive and log_likelihood are of the same draws; observed_data
        has the fitted readings. A chain is an independent ensemble. The log likelihood is one variable over all
        recordings, so that `arviz.loo` and `arviz.compare` judge the whole fit. ArviZ below 1.0 takes the tree through
        ``arviz.from_datatree``.

        Parameters
        ----------
        data : Dataset or sequence of Experiment
            The recordings that were fitted, without which there are no readings to predict; see `to_tree` otherwise.
        draws : int
            Draws, evenly from all ensembles.
        pointwise : bool
            With the log likelihood of every reading.

        Raises
        ------
        InputError
            If a recording was not fitted, or `pointwise` is asked for under a noise whose errors depend on each other.

        Examples
        --------
        >>> data = load_dataset("datasets/spring_bench/rig.toml")
        >>> part = [data.train[0].first(100)]  # its first second
        >>> fit = fit_model(declared_model(data), part)
        >>> posterior = sample(fit, min_effective=500)
        >>> tree = posterior.to_arviz(part, draws=100)
        >>> sorted(tree.children)
        ['log_likelihood', 'observed_data', 'posterior', 'posterior_predictive', 'prior', 'sample_stats']
        """
        check_whole(draws, "draws", 1)
        if data is None:
            raise InputError(
                "`data` are the recordings that were fitted. Give the data set, or the list that was fitted."
            )
        if pointwise:
            check_pointwise(self.noise)
        chosen = some(self, draws)
        return as_tree(self, sampled(chosen) | readings(chosen, training_of(data), pointwise=pointwise))

    def to_tree(self, data: Recordings | None = None) -> xr.DataTree:
        """Return all draws as groups of ArviZ's InferenceData.

        Parameters
        ----------
        data : Dataset or sequence of Experiment, optional
            The recordings that were fitted: with them, observed_data has their readings, and posterior_predictive what
            some of the draws make of them.

        Returns
        -------
        DataTree
            The groups posterior, sample_stats (lp, and as log_likelihood the sum over all readings) and prior. A chain
            is an independent ensemble.
        """
        groups = sampled(self)
        if data is not None:
            recordings = training_of(data)
            size = sum(e.recording.output.size for e in recordings)
            kept = max(len(self.draws), min(_REPLICATED, _KEPT // size))
            groups |= readings(some(self, kept), recordings, pointwise=False)
        return as_tree(self, groups)

    def to_netcdf(self, path: str | os.PathLike[str], data: Recordings | None = None) -> None:
        """Write the groups of `to_tree` as netCDF, beside its place first."""
        path = as_path(path, "path", "Give the path of the file to write.")
        # In memory: on a full disk the library of the format ends the process.
        made = BytesIO()
        self.to_tree(data).to_netcdf(made, engine="h5netcdf")
        with atomic_write(path) as temporary:
            temporary.write_bytes(made.getbuffer())

    @classmethod
    def from_netcdf(cls, path: str | os.PathLike[str]) -> Posterior:
        """Read what `to_netcdf` wrote.

        Raises
        ------
        InputError
            If the file is not such a file.
        """
        import xarray as xr

        path = as_path(path, "path", "Give the path of a file that to_netcdf wrote.")
        try:
            with xr.open_datatree(path, engine="h5netcdf") as tree:
                return cls(**fields_of(tree.load()))
        except (OSError, KeyError, ValueError) as error:
            raise InputError(f"{os.fspath(path)} is not a posterior that this package wrote: {error}") from error
