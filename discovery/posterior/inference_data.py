"""The layout of ArviZ's InferenceData: every walker of every ensemble is a chain, as ArviZ has it for emcee."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["by_ensemble", "by_walker", "readings", "walkers"]

FloatArray = NDArray[np.float64]
_DIMENSIONS = ("chain", "draw")


def by_walker(values: FloatArray) -> tuple[tuple[str, str], FloatArray]:
    """Return the dimensions and values (chains, draws) of a quantity (ensembles, draws, walkers)."""
    return _DIMENSIONS, values.swapaxes(1, 2).reshape(-1, values.shape[1])


def walkers(shape: tuple[int, ...]) -> dict[str, Any]:
    """Return the coordinates of quantities of a shape (ensembles, draws, walkers): also whose chain each is."""
    ensembles, draws, each = shape
    chains = np.arange(ensembles * each)
    whose = {"ensemble": ("chain", chains // each), "walker": ("chain", chains % each)}
    return {"chain": chains, "draw": np.arange(draws), **whose}


def by_ensemble(values: xr.DataArray) -> FloatArray:
    """Return a quantity as (ensembles, draws, walkers): the inverse of `by_walker`."""
    array = np.asarray(values.to_numpy(), np.float64)
    return array.reshape(int(values["ensemble"].max()) + 1, -1, array.shape[1]).swapaxes(1, 2)


def readings(
    recordings: Mapping[str, tuple[FloatArray, Sequence[str], FloatArray]], quantiles: Sequence[float] = ()
) -> xr.Dataset:
    """Return readings of recordings, each with times and channels of its own.

    Parameters
    ----------
    recordings : mapping of str to (time, channels, values)
        Times (n,) [s], names of channels (c,), and values (n, c), or with quantiles (q, n, c).
    quantiles : sequence of float
        Which they are.

    Returns
    -------
    Dataset
    """
    import xarray as xr

    variables: dict[str, Any] = {}
    coordinates: dict[str, Any] = {"quantile": list(quantiles)} if quantiles else {}
    for name, (time, channels, values) in recordings.items():
        own = (f"time[{name}]", f"channel[{name}]")
        coordinates |= {own[0]: time, own[1]: list(channels)}
        variables[name] = ((*(["quantile"] if quantiles else []), *own), values)
    return xr.Dataset(variables, coordinates)
