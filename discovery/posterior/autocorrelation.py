"""Autocorrelation of a posterior's chains, by ensemble: how soon a walker forgets where it was."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from discovery.posterior.correlations import quantities

if TYPE_CHECKING:
    from discovery.posterior.draws import Posterior

__all__ = ["Autocorrelation", "autocorrelation"]

FloatArray = NDArray[np.float64]
#: Lags reach so many autocorrelation times, and are at most so many.
_REACH, _MOST = 6.0, 60


@dataclass(frozen=True)
class Autocorrelation:
    """Autocorrelation functions of the physical parameters and of the noise.

    Parameters
    ----------
    lags : ndarray, shape (k,)
        [steps].
    functions : mapping of str to ndarray, shape (ensembles, k)
        Mean over the walkers of each ensemble; 1 at lag 0.
    tau : mapping of str to float
        Integrated autocorrelation time [steps].
    """

    lags: FloatArray
    functions: dict[str, FloatArray]
    tau: dict[str, float]

    def summary(self) -> dict[str, Any]:
        """Return a JSON-ready description."""
        functions = {name: np.round(f, 4).tolist() for name, f in self.functions.items()}
        return {"lags": self.lags.tolist(), "functions": functions, "tau": dict(self.tau)}


def autocorrelation(posterior: Posterior) -> Autocorrelation:
    """Return the autocorrelation of a posterior's draws; initial states are left out.

    Parameters
    ----------
    posterior : Posterior
        Draws (ensembles, draws, walkers, d), `thin` steps apart.
    """
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
