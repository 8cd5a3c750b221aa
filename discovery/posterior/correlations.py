"""Correlations of a posterior's draws: of its parameters with each other, and along its chains."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np

from discovery.foundation.arrays import FloatArray
from discovery.foundation.start_names import is_start

if TYPE_CHECKING:
    from discovery.posterior.draws import Posterior

#: Correlations of at least this size are told.
NOTABLE = 0.3
#: Lags reach so many autocorrelation times, and are at most so many.
_REACH, _MOST = 6.0, 60


@dataclass(frozen=True)
class Correlations:
    """Correlation coefficients `matrix` (d, d) of the draws of the physical parameters and of the noise, by `names`.

    `pairs` are those whose correlation is at least `NOTABLE`, the strongest first.
    """

    names: tuple[str, ...]
    matrix: FloatArray
    pairs: tuple[tuple[str, str], ...]

    def summary(self) -> dict[str, Any]:
        """Return a JSON-ready description."""
        at = {name: i for i, name in enumerate(self.names)}
        return {
            "names": list(self.names),
            "matrix": self.matrix.tolist(),
            "pairs": [{"pair": [a, b], "correlation": float(self.matrix[at[a], at[b]])} for a, b in self.pairs],
        }


def quantities(posterior: Posterior) -> tuple[str, ...]:
    """Return the names of the sampled quantities but for the initial states."""
    return tuple(n for n in posterior.names if not is_start(n))


def correlations(posterior: Posterior) -> Correlations:
    """Return the correlations of a posterior; initial states are left out."""
    names = quantities(posterior)
    flat = posterior.flat()
    matrix = np.atleast_2d(np.corrcoef(np.array([flat[n] for n in names])))
    size = {(names[i], names[j]): abs(matrix[i, j]) for i, j in combinations(range(len(names)), 2)}
    told = sorted((pair for pair, r in size.items() if r >= NOTABLE), key=lambda pair: -size[pair])
    return Correlations(names, matrix, tuple(told))


@dataclass(frozen=True)
class Autocorrelation:
    """Autocorrelation functions of the physical parameters and of the noise, at `lags` (k,) [steps].

    `functions`, by name, are means over the walkers of each ensemble (ensembles, k), 1 at lag 0; `tau` are their
    integrated autocorrelation times [steps].
    """

    lags: FloatArray
    functions: dict[str, FloatArray]
    tau: dict[str, float]

    def summary(self) -> dict[str, Any]:
        """Return a JSON-ready description."""
        functions = {name: np.round(f, 4).tolist() for name, f in self.functions.items()}
        return {"lags": self.lags.tolist(), "functions": functions, "tau": dict(self.tau)}


def autocorrelation(posterior: Posterior) -> Autocorrelation:
    """Return the autocorrelation of a posterior's draws; initial states are left out."""
    thin = int(posterior.provenance.get("thin", 1))
    names = quantities(posterior)
    tau = {n: float(posterior.tau[n]) for n in names}
    longest = posterior.draws.shape[1]
    wanted = int(np.ceil(_REACH * max(tau.values()) / thin))
    count = max(2, min(wanted + 1, longest // 2, _MOST))
    functions = {n: _function(posterior.draws[..., posterior.names.index(n)], count) for n in names}
    return Autocorrelation(thin * np.arange(count, dtype=float), functions, tau)


def _function(x: FloatArray, count: int) -> FloatArray:
    """Return the first values of the autocorrelation function of chains (e, n, w), shape (e, count)."""
    # The mean of the whole ensemble, not of each walker, whose few draws would hide slow changes.
    centred = x - x.mean(axis=(1, 2), keepdims=True)
    n = x.shape[1]
    lagged = [(centred[:, : n - k] * centred[:, k:]).mean(axis=(1, 2)) for k in range(count)]
    return np.stack(lagged, axis=1) / lagged[0][:, None]
