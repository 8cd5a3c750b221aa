"""A posterior as groups of ArviZ's InferenceData, and back."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from discovery.equations.model import Model
from discovery.estimation.natural_units import NaturalUnits
from discovery.foundation.arrays import FloatArray
from discovery.posterior.inference_data import (
    arranged,
    as_chains,
    attributes,
    by_name,
    of_all_readings,
    of_readings,
    of_walkers,
)
from discovery.posterior.replication import replicated

if TYPE_CHECKING:
    import xarray as xr

    from discovery.posterior.draws import Posterior
    from discovery.recordings.experiment import Experiment

_DIAGNOSTICS = ("r_hat", "tau", "ess", "ess_tail")


def as_tree(posterior: Posterior, groups: Mapping[str, xr.Dataset]) -> xr.DataTree:
    """Return groups as one tree, with the prior."""
    import xarray as xr

    prior = {name: x[None, :, None] for name, x in posterior.prior.items()}
    said = {name: {"units": posterior.units[name]} for name in prior}
    return xr.DataTree.from_dict({**groups, **({"prior": arranged(prior, said)} if prior else {})})


def some(posterior: Posterior, draws: int) -> Posterior:
    """Return the posterior of some draws, evenly from all ensembles, each as a walker of its own."""
    ensembles, d = len(posterior.draws), posterior.draws.shape[-1]
    every = posterior.draws.swapaxes(1, 2).reshape(ensembles, -1, d)
    chosen = np.linspace(0, every.shape[1] - 1, min(max(1, draws // ensembles), every.shape[1])).astype(int)

    def each(values: FloatArray) -> FloatArray:
        return values.swapaxes(1, 2).reshape(ensembles, -1)[:, None, chosen]

    return replace(
        posterior,
        draws=every[:, None, chosen],
        log_probability=each(posterior.log_probability),
        log_likelihood=each(posterior.log_likelihood),
    )


def sampled(posterior: Posterior) -> dict[str, xr.Dataset]:
    """Return the groups of the draws alone."""
    import xarray as xr

    values = {name: posterior.draws[..., i] for i, name in enumerate(posterior.names)}
    draws = arranged(values, {name: _attributes_of(posterior, name) for name in posterior.names})
    densities = {"lp": as_chains(posterior.log_probability), "log_likelihood": as_chains(posterior.log_likelihood)}
    return {
        "posterior": draws.assign_attrs(_attributes(posterior)),
        "sample_stats": xr.Dataset(densities, draws[["walker", "step"]].coords, dict(posterior.acceptance)),
    }


def readings(posterior: Posterior, experiments: Sequence[Experiment], *, pointwise: bool) -> dict[str, xr.Dataset]:
    """Return the groups of single readings, for all draws."""
    ensembles = len(posterior.draws)
    draws = {name: as_chains(posterior.draws[..., i])[1].ravel() for i, name in enumerate(posterior.names)}
    rng = np.random.default_rng(posterior.provenance["seed"])
    found = replicated(posterior, experiments, draws, rng)
    time = {r.name: r.time for r in found}
    channel = {r.name: r.channel for r in found}
    units = {c: unit for e in experiments for c, unit in zip(e.recording.channels, e.recording.units, strict=True)}

    def by_draw(values: FloatArray) -> FloatArray:
        return np.moveaxis(values.reshape(len(values), ensembles, -1), 0, -1)

    groups = {
        "observed_data": of_readings({r.name: r.observed for r in found}, time, channel, units),
        "posterior_predictive": of_readings(
            {r.name: by_draw(r.again).astype(np.float32) for r in found}, time, channel, units
        ),
    }
    if pointwise:
        scores = {r.name: by_draw(r.log_likelihood) for r in found}
        groups["log_likelihood"] = of_all_readings(scores, time, channel)
    return groups


def _attributes_of(posterior: Posterior, name: str) -> dict[str, Any]:
    value, sd = posterior.reference[name]
    attributes = {key: getattr(posterior, key)[name] for key in _DIAGNOSTICS}
    attributes |= {"units": posterior.units[name], "fit_value": value, "fit_sd": sd}
    attributes |= {"stated_noise": posterior.stated_noise[name]} if name in posterior.stated_noise else {}
    return attributes | ({"long_name": posterior.meanings[name]} if name in posterior.meanings else {})


def _natural_units(stored: dict[str, Any]) -> NaturalUnits:
    """Return natural units from JSON, which has no tuples."""
    return NaturalUnits(**stored | {"places": tuple(tuple(place) for place in stored["places"])})


def _attributes(posterior: Posterior) -> dict[str, Any]:
    return {
        "interval": posterior.interval,
        "status": posterior.status,
        "model": json.dumps(posterior.model.to_dict()),
        "natural_units": json.dumps(asdict(posterior.natural)),
        "gaussian": json.dumps(dict(posterior.gaussian)),
        "solver_step_s": posterior.step,
        "acceptance": json.dumps(dict(posterior.acceptance)),
        "provenance": json.dumps(dict(posterior.provenance)),
        "inference_library": (library := "emcee" if posterior.provenance["method"] == "emcee" else "discovery"),
        "inference_library_version": str(posterior.provenance["versions"][library]),
    }


def fields_of(tree: xr.DataTree) -> dict[str, Any]:
    """Return the fields of a posterior whose groups were kept by `as_tree`."""
    dataset = tree["posterior"].to_dataset()
    values, said = by_name(dataset), attributes(dataset)

    def attribute(key: str) -> dict[str, float]:
        return {name: float(told[key]) for name, told in said.items() if key in told}

    value, sd = attribute("fit_value"), attribute("fit_sd")
    gaussian = json.loads(dataset.attrs["gaussian"])
    return dict(
        names=tuple(values),
        units={name: str(told["units"]) for name, told in said.items()},
        draws=np.stack(list(values.values()), axis=-1),
        log_probability=of_walkers(tree["sample_stats"].dataset["lp"]),
        log_likelihood=of_walkers(tree["sample_stats"].dataset["log_likelihood"]),
        **{key: attribute(key) for key in _DIAGNOSTICS},
        prior={name: x[0, :, 0] for name, x in by_name(tree["prior"].to_dataset()).items()},
        acceptance=json.loads(dataset.attrs["acceptance"]),
        reference={name: (value[name], sd[name]) for name in values},
        stated_noise=attribute("stated_noise"),
        meanings={name: str(told["long_name"]) for name, told in said.items() if "long_name" in told},
        model=Model.from_dict(json.loads(dataset.attrs["model"])),
        natural=_natural_units(json.loads(dataset.attrs["natural_units"])),
        gaussian={name: (float(m), float(s)) for name, (m, s) in gaussian.items()},
        step=float(dataset.attrs["solver_step_s"]),
        provenance=json.loads(dataset.attrs["provenance"]),
    )
