"""A posterior as groups of ArviZ's InferenceData, and back, with the readings that its draws would make again."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from discovery.equations.model import Model
from discovery.estimation.natural_units import NaturalUnits
from discovery.foundation.arrays import FloatArray
from discovery.foundation.errors import InputError
from discovery.foundation.start_names import start_of
from discovery.posterior.inference_data import (
    arranged,
    as_chains,
    attributes,
    by_name,
    of_all_readings,
    of_readings,
    of_walkers,
)
from discovery.posterior.noise import errors_of, is_independent, words_of
from discovery.posterior.noise.model import own_of
from discovery.posterior.predictive import noise_factor, simulated
from discovery.recordings.experiment import Experiment

if TYPE_CHECKING:
    import xarray as xr

    from discovery.posterior.draws import Posterior

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
    """Return the groups of the fitted readings beside what all draws make of them, noise included.

    `pointwise`: with the log density of each reading. InputError for a recording that was not fitted, or channels whose
    noise was not sampled.
    """
    for experiment in experiments:
        _check_fitted(posterior, experiment)
    law = errors_of(posterior.noise)
    ensembles, parts = len(posterior.draws), [experiment.fitted_part for experiment in experiments]
    draws = {name: as_chains(posterior.draws[..., i])[1].ravel() for i, name in enumerate(posterior.names)}
    count, rng = next(iter(draws.values())).size, np.random.default_rng(posterior.provenance["seed"])
    observed, again, scores, time = (dict[str, FloatArray]() for _ in range(4))
    channel: dict[str, tuple[str, ...]] = {}

    def by_draw(values: FloatArray) -> FloatArray:
        return np.moveaxis(values.reshape(len(values), ensembles, -1), 0, -1)

    for experiment, motion in zip(parts, simulated(posterior, parts, draws), strict=True):
        r, seen, shape = experiment.recording, experiment.weights() > 0, (*motion.shape[:2], count)
        motion = np.broadcast_to(motion, shape)
        scale = np.broadcast_to(r.scatter[:, :, None] * noise_factor(posterior, r.channels, draws), shape)
        rows, columns = np.nonzero(seen)
        time[r.name], channel[r.name] = r.time[rows], tuple(r.channels[c] for c in columns)
        observed[r.name] = r.output[seen]
        own = own_of(r.channels, draws)
        again[r.name] = by_draw((motion + scale * law.drawn(rng, shape, own))[seen]).astype(np.float32)
        if pointwise:
            step = np.broadcast_to(r.steps[:, None], shape)
            density = law.density(r.output[:, :, None] - motion, scale, own, step)
            scores[r.name] = by_draw(density[seen])
    units = {c: unit for e in experiments for c, unit in zip(e.recording.channels, e.recording.units, strict=True)}
    return {
        "observed_data": of_readings(observed, time, channel, units),
        "posterior_predictive": of_readings(again, time, channel, units),
        **({"log_likelihood": of_all_readings(scores, time, channel)} if pointwise else {}),
    }


def _attributes_of(posterior: Posterior, name: str) -> dict[str, Any]:
    value, sd = posterior.reference[name]
    attributes = {key: getattr(posterior, key)[name] for key in _DIAGNOSTICS}
    attributes |= {"units": posterior.units[name], "fit_value": value, "fit_sd": sd}
    attributes |= {"stated_noise": posterior.stated_noise[name]} if name in posterior.stated_noise else {}
    return attributes | ({"long_name": posterior.meanings[name]} if name in posterior.meanings else {})


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
    gaussian, natural = (json.loads(dataset.attrs[key]) for key in ("gaussian", "natural_units"))
    # JSON has no tuples.
    places = tuple(tuple(place) for place in natural.pop("places"))
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
        natural=NaturalUnits(**natural, places=places),
        gaussian={name: (float(m), float(s)) for name, (m, s) in gaussian.items()},
        step=float(dataset.attrs["solver_step_s"]),
        provenance=json.loads(dataset.attrs["provenance"]),
    )


def check_pointwise(noise: str) -> None:
    """Refuse a log likelihood of single readings where errors depend on each other."""
    if not is_independent(noise):
        raise InputError(
            f"Errors are taken as {words_of(noise)}, so that readings are not independent given the parameters: a log "
            "likelihood of single readings, and leave-one-out with it, means nothing. Ask for pointwise=False, and "
            "compare models by their evidence, with discovery.posterior.model_comparison.compare_models."
        )


def _check_fitted(posterior: Posterior, experiment: Experiment) -> None:
    name = experiment.recording.name
    if posterior.model.mechanics.prescribed or experiment.initial_names[0] in posterior.names:
        return
    known = [found[1] for found in map(start_of, posterior.names) if found and found[0] == "delta"]
    raise InputError(f"The recording {name!r} was not fitted: the posterior is of {', '.join(known)}. Give those.")
