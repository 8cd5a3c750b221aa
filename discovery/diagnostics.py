"""Whether ensembles of walkers have converged: R-hat between them, autocorrelation time, effective samples.

A walker is no chain of its own: the moves of one ensemble couple its walkers. So an ensemble, all its walkers pooled,
counts as one chain, and the effective number of samples is the smaller of two estimates: steps times walkers over the
autocorrelation time of the walkers [1]_, which takes them as uncoupled, and the one from the scatter of the ensemble's
average in time, which does not.

.. [1] J. Goodman and J. Weare, "Ensemble samplers with affine invariance", Comm. Appl. Math. Comp. Sci. 5, 65 (2010).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Convergence", "convergence"]

FloatArray = NDArray[np.float64]

#: A chain must be so many autocorrelation times long for the estimate of that time to be trusted.
LENGTH_IN_TAU = 50


@dataclass(frozen=True)
class Convergence:
    """Diagnostics of every quantity.

    Parameters
    ----------
    r_hat : ndarray, shape (d,)
        Split, rank-normalised R-hat with ensembles as chains (Vehtari et al., Bayesian Analysis 16 (2021) 667).
    tau : ndarray, shape (d,)
        Integrated autocorrelation time, the longest of all ensembles [steps].
    ess : ndarray, shape (d,)
        Effective number of samples.
    steps : int
        Length of the chains after burn-in.
    """

    r_hat: FloatArray
    tau: FloatArray
    ess: FloatArray
    steps: int

    def meets(self, min_effective: float, r_hat_max: float) -> bool:
        """Tell whether every quantity has converged; a diagnostic that is not a number has not."""
        return bool(
            np.all(self.r_hat <= r_hat_max)
            and np.all(self.ess >= min_effective)
            and np.all(self.steps >= LENGTH_IN_TAU * self.tau)
        )


def convergence(draws: FloatArray) -> Convergence:
    """Return the diagnostics of draws after burn-in.

    Parameters
    ----------
    draws : ndarray, shape (ensembles, steps, walkers, d)

    Returns
    -------
    Convergence
    """
    from arviz_stats.base import array_stats
    from emcee.autocorr import integrated_time

    ensembles, steps, walkers, d = draws.shape
    with np.errstate(invalid="ignore", divide="ignore"):
        # A tolerance of zero: the length is judged by `meets`, with the numbers.
        each = np.array([integrated_time(chain, tol=0) for chain in draws])
        pooled = np.moveaxis(draws, -1, 0).reshape(d, ensembles, steps * walkers)
        r_hat = np.asarray(array_stats.rhat(pooled, chain_axis=1, draw_axis=2))
        mean = np.moveaxis(draws.mean(axis=2), -1, 0)
        of_mean = np.asarray(array_stats.ess(mean, chain_axis=1, draw_axis=2, method="mean"))
        uncoupled = (steps * walkers / each).sum(axis=0)
        coupled = of_mean * draws.var(axis=(0, 1, 2)) / mean.var(axis=(1, 2))
    return Convergence(r_hat, each.max(axis=0), np.minimum(uncoupled, coupled), steps)
