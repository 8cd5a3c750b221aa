"""Draws from the posterior of a model: what they mean, how well they converged, their table and their file."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from io import BytesIO
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from discovery.equations.model import Model
from discovery.estimation.problem import NaturalUnits
from discovery.foundation.errors import InputError
from discovery.foundation.io import atomic_write
from discovery.posterior.inference_data import by_ensemble, by_walker, readings, walkers
from discovery.posterior.noise import is_independent, words_of

if TYPE_CHECKING:
    import xarray as xr

    from discovery.posterior.predictive import Band
    from discovery.recordings.experiment import Experiment

__all__ = ["INTERVAL", "Posterior"]

FloatArray = NDArray[np.float64]

#: What the intervals of a summary are; `Posterior.interval` adds the noise.
INTERVAL = "equal-tailed 90 % credible interval"
_QUANTILES = (0.05, 0.5, 0.95)
_DIAGNOSTICS = ("r_hat", "tau", "ess", "ess_tail")


@dataclass(frozen=True)
class Posterior:
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
        flat = self.flat()
        for name, stated in self.stated_noise.items():
            low, middle = np.quantile(flat[name] / stated, _QUANTILES[:2])
            if low > 1.0 and middle > 1.1:
                meant = (
                    "so the intervals are naive and may be far too wide or too narrow."
                    if is_independent(self.noise)
                    else "so the intervals are as honest as that is."
                )
                return (
                    f"{name} is {middle:.3g} times the stated noise: the model leaves a systematic residual, which is "
                    f"taken as noise that is {words_of(self.noise)}, {meant}"
                )
        return f"The residuals are no larger than the stated noise; the intervals take them as {words_of(self.noise)}."

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

    def to_tree(self, bands: Sequence[Band] = (), experiments: Sequence[Experiment] = ()) -> xr.DataTree:
        """Return the groups of ArviZ's InferenceData.

        Every walker is a chain, as ArviZ has it for emcee; the coordinate ``ensemble`` says to which ensemble it
        belongs. Log likelihoods are sums over all readings. ``posterior_predictive`` holds quantiles of the readings.

        Parameters
        ----------
        bands : sequence of Band
            What `discovery.posterior.predictive.predictive` returned; no such group without them.
        experiments : sequence of Experiment
            Recordings whose readings are kept as ``observed_data``.

        Returns
        -------
        DataTree
        """
        import xarray as xr

        coordinates = walkers(self.log_probability.shape)
        quantities = {
            name: xr.Variable(*by_walker(self.draws[..., i]), attrs=self._attributes_of(name))
            for i, name in enumerate(self.names)
        }
        groups = {
            "posterior": xr.Dataset(quantities, coordinates, self._attributes()),
            "sample_stats": xr.Dataset({"lp": by_walker(self.log_probability)}, coordinates, dict(self.acceptance)),
            "log_likelihood": xr.Dataset({"readings": by_walker(self.log_likelihood)}, coordinates),
            "prior": xr.Dataset({name: (("chain", "draw"), x[None]) for name, x in self.prior.items()}),
        }
        if bands:
            quantiles = {b.name: (b.time, b.channels, b.reading) for b in bands}
            groups["posterior_predictive"] = readings(quantiles, _QUANTILES)
        if experiments:
            recordings = [e.recording for e in experiments]
            groups["observed_data"] = readings({r.name: (r.time, r.channels, r.output) for r in recordings})
        return xr.DataTree.from_dict(groups)

    def to_netcdf(
        self, path: str | os.PathLike[str], bands: Sequence[Band] = (), experiments: Sequence[Experiment] = ()
    ) -> None:
        """Write the groups of `to_tree` as netCDF, beside its place first."""
        # In memory: on a full disk the library of the format ends the process.
        made = BytesIO()
        self.to_tree(bands, experiments).to_netcdf(made, engine="h5netcdf")
        with atomic_write(path) as temporary:
            temporary.write_bytes(made.getbuffer())

    def _attributes_of(self, name: str) -> dict[str, Any]:
        value, sd = self.reference[name]
        attributes = {key: getattr(self, key)[name] for key in _DIAGNOSTICS}
        attributes |= {"units": self.units[name], "fit_value": value, "fit_sd": sd}
        attributes |= {"stated_noise": self.stated_noise[name]} if name in self.stated_noise else {}
        return attributes | ({"long_name": self.meanings[name]} if name in self.meanings else {})

    def _attributes(self) -> dict[str, Any]:
        return {
            "quantities": json.dumps(self.names),
            "interval": self.interval,
            "status": self.status,
            "model": json.dumps(self.model.to_dict()),
            "natural_units": json.dumps(asdict(self.natural)),
            "gaussian": json.dumps(dict(self.gaussian)),
            "solver_step_s": self.step,
            "acceptance": json.dumps(dict(self.acceptance)),
            "provenance": json.dumps(dict(self.provenance)),
            "inference_library": "emcee",
            "inference_library_version": str(self.provenance["versions"]["emcee"]),
        }

    @classmethod
    def from_netcdf(cls, path: str | os.PathLike[str]) -> Posterior:
        """Read what `to_netcdf` wrote.

        Raises
        ------
        InputError
            If the file is not such a file.
        """
        import xarray as xr

        try:
            with xr.open_datatree(path, engine="h5netcdf") as tree:
                return cls._from_tree(tree.load())
        except (OSError, KeyError, ValueError) as error:
            raise InputError(f"{os.fspath(path)} is not a posterior that this package wrote: {error}") from error

    @classmethod
    def _from_tree(cls, tree: xr.DataTree) -> Posterior:
        dataset = tree["posterior"].to_dataset()
        names = tuple(json.loads(dataset.attrs["quantities"]))
        variables = {name: dataset[name] for name in names}

        def attribute(key: str) -> dict[str, float]:
            return {name: float(v.attrs[key]) for name, v in variables.items() if key in v.attrs}

        value, sd = attribute("fit_value"), attribute("fit_sd")
        gaussian = json.loads(dataset.attrs["gaussian"])
        return cls(
            names=names,
            units={name: str(v.attrs["units"]) for name, v in variables.items()},
            draws=np.stack([by_ensemble(v) for v in variables.values()], axis=-1),
            log_probability=by_ensemble(tree["sample_stats"].dataset["lp"]),
            log_likelihood=by_ensemble(tree["log_likelihood"].dataset["readings"]),
            **{key: attribute(key) for key in _DIAGNOSTICS},
            prior={str(name): x.to_numpy()[0] for name, x in tree["prior"].data_vars.items()},
            acceptance=json.loads(dataset.attrs["acceptance"]),
            reference={name: (value[name], sd[name]) for name in names},
            stated_noise=attribute("stated_noise"),
            meanings={name: str(v.attrs["long_name"]) for name, v in variables.items() if "long_name" in v.attrs},
            model=Model.from_dict(json.loads(dataset.attrs["model"])),
            natural=NaturalUnits(**json.loads(dataset.attrs["natural_units"])),
            gaussian={name: (float(m), float(s)) for name, (m, s) in gaussian.items()},
            step=float(dataset.attrs["solver_step_s"]),
            provenance=json.loads(dataset.attrs["provenance"]),
        )
