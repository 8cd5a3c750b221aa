"""The layout of ArviZ's InferenceData: an independent ensemble is a chain, the recordings of a quantity a dimension.

The walkers of an ensemble are coupled by its moves, so that none of them is a chain of its own: with walkers as chains,
R-hat would compare what is not independent. Within a chain the draws of a walker follow each other, then come those of
the next: the autocorrelation that ArviZ sees is that of a walker.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from discovery.foundation.arrays import FloatArray

if TYPE_CHECKING:
    import xarray as xr

_DIMENSIONS = ("chain", "draw")
_LABELLED = re.compile(r"(?P<stem>[^\[]+)\[(?P<label>.*)\]")


def as_chains(values: FloatArray) -> tuple[tuple[str, str], FloatArray]:
    """Return the dimensions and values (chains, draws) of a quantity (ensembles, steps, walkers)."""
    return _DIMENSIONS, values.swapaxes(1, 2).reshape(len(values), -1)


def of_walkers(values: xr.DataArray) -> FloatArray:
    """Return a quantity as (ensembles, steps, walkers): the inverse of `as_chains`."""
    array = np.asarray(values.to_numpy(), np.float64)
    walkers = int(values["walker"].max()) + 1
    return array.reshape(len(array), walkers, -1).swapaxes(1, 2)


def arranged(values: Mapping[str, FloatArray], said: Mapping[str, Mapping[str, Any]] | None = None) -> xr.Dataset:
    """Return quantities (ensembles, steps, walkers) as one dataset; recordings and instruments become dimensions.

    ``"rate_0_init[high]"`` becomes ``rate_0_init`` at ``recording="high"``. `said` has attributes of every quantity; of
    those that share a variable, numbers become arrays. The dataset has the coordinates ``walker`` and ``step`` of the
    draws, and the names in its attribute ``quantities``.
    """
    import xarray as xr

    ensembles, steps, walkers = next(iter(values.values())).shape
    coordinates: dict[str, Any] = {
        "chain": np.arange(ensembles),
        "draw": np.arange(steps * walkers),
        "walker": ("draw", np.repeat(np.arange(walkers), steps)),
        "step": ("draw", np.tile(np.arange(steps), walkers)),
    }
    variables: dict[str, Any] = {}
    for stem, names in _grouped(values).items():
        chains = [as_chains(values[name])[1] for name in names]
        each = [dict((said or {}).get(name, {})) for name in names]
        labels = [_split(name)[1] for name in names]
        if labels[0] is None:
            variables[stem] = (_DIMENSIONS, chains[0], each[0])
            continue
        where = _where(stem)
        coordinates[where] = [str(label) for label in labels]
        shared = {key: [own[key] for own in each] for key in each[0]}
        told = {key: found[0] if isinstance(found[0], str) else found for key, found in shared.items()}
        variables[stem] = ((*_DIMENSIONS, where), np.stack(chains, axis=-1), told)
    return xr.Dataset(variables, coordinates, {"quantities": json.dumps(list(values))})


def by_name(dataset: xr.Dataset) -> dict[str, FloatArray]:
    """Return the quantities of a dataset from `arranged` by name, each (ensembles, steps, walkers)."""
    return {name: of_walkers(_variable(dataset, name)) for name in json.loads(dataset.attrs["quantities"])}


def attributes(dataset: xr.Dataset) -> dict[str, dict[str, Any]]:
    """Return the attributes of every quantity of a dataset from `arranged`, by name."""
    found: dict[str, dict[str, Any]] = {}
    for stem, names in _grouped(json.loads(dataset.attrs["quantities"])).items():
        for i, name in enumerate(names):
            told = dataset[stem].attrs
            found[name] = {key: x if isinstance(x, str) else np.atleast_1d(x)[i] for key, x in told.items()}
    return found


def _split(name: str) -> tuple[str, str | None]:
    """Return what is measured, and of what."""
    found = _LABELLED.fullmatch(name)
    return (found["stem"], found["label"]) if found else (name, None)


def _where(stem: str) -> str:
    """Return the dimension of what a quantity belongs to: starts are of recordings, noise is of instruments.

    What is counted from the first recording has a dimension of its own, which lacks that one.
    """
    if stem in ("delta_0_init", "rate_0_init"):
        return "recording"
    return f"recording_{stem.removesuffix('_0_init')}" if stem.endswith("_init") else "instrument"


def _grouped(names: Mapping[str, Any] | Sequence[str]) -> dict[str, list[str]]:
    """Return names by the variable that holds them."""
    groups: dict[str, list[str]] = {}
    for name in names:
        groups.setdefault(_split(name)[0], []).append(name)
    return groups


def _variable(dataset: xr.Dataset, name: str) -> xr.DataArray:
    stem, label = _split(name)
    return dataset[stem] if label is None else dataset[stem].sel({_where(stem): label}).transpose(*_DIMENSIONS)


def of_readings(
    values: Mapping[str, FloatArray],
    time: Mapping[str, FloatArray],
    channel: Mapping[str, Sequence[str]],
    units: Mapping[str, str] | None = None,
) -> xr.Dataset:
    """Return what belongs to single readings, a variable a recording, its readings one after the other.

    Values have the shape (n,), or (chains, draws, n) of draws; `time` [s] and `channel` say when and by which channel
    each was read. Where values have units, channels of different ones have theirs in a coordinate.
    """
    import xarray as xr

    variables: dict[str, Any] = {}
    coordinates: dict[str, Any] = {}
    for recording, found in values.items():
        name = re.sub(r"\W+", "_", recording)
        own = f"reading_{name}"
        each = [] if units is None else [units[c] for c in channel[recording]]
        shared = {"units": each[0]} if len(set(each)) == 1 else {}
        variables[name] = ((*_DIMENSIONS[: found.ndim - 1], own), found, {"recording": recording, **shared})
        if each and not shared:
            coordinates[f"units_{name}"] = (own, np.asarray(each, dtype=str))
        coordinates[f"time_{name}"] = (own, time[recording], {"units": "s"})
        coordinates[f"channel_{name}"] = (own, np.asarray(channel[recording], dtype=str))
    return xr.Dataset(variables, coordinates)


def of_all_readings(
    values: Mapping[str, FloatArray], time: Mapping[str, FloatArray], channel: Mapping[str, Sequence[str]]
) -> xr.Dataset:
    """Return what belongs to single readings as one variable, recordings one after the other: leave-one-out needs one.

    Values have the shape (chains, draws, n); see `of_readings` for the others.
    """
    import xarray as xr

    of = [name for name in values for _ in range(len(time[name]))]
    coordinates: dict[str, Any] = {
        "recording": ("reading", np.asarray(of, dtype=str)),
        "time": ("reading", np.concatenate([time[name] for name in values]), {"units": "s"}),
        "channel": ("reading", np.asarray([c for name in values for c in channel[name]], dtype=str)),
    }
    together = np.concatenate(list(values.values()), axis=-1)
    return xr.Dataset({"readings": ((*_DIMENSIONS, "reading"), together)}, coordinates)
