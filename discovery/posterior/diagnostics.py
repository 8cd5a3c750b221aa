"""Whether ensembles of walkers have converged: R-hat between them, autocorrelation time, effective samples.

A walker is no chain of its own: the moves of one ensemble couple its walkers. So an ensemble, all its walkers pooled,
counts as one chain, and the effective number of samples is the smaller of two estimates: steps times walkers over the
autocorrelation time of the walkers [1]_, which takes them as uncoupled, and the one from the scatter of the ensemble's
average in time, which does not. Autocorrelations are about the mean of all ensembles, not of each walker: a walker
that never leaves one peak of a posterior then shows.

.. [1] J. Goodman and J. Weare, "Ensemble samplers with affine invariance", Comm. Appl. Math. Comp. Sci. 5, 65 (2010).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from discovery.foundation.arrays import FloatArray

#: A chain must be so many autocorrelation times long for the estimate of that time to be trusted.
LENGTH_IN_TAU = 50
# R-hat is that of so many draws an ensemble at most, of whole walkers: ranks of millions tell no more.
_RANKED = 20_000
# Width of the window of an autocorrelation time, in that time (A. Sokal); emcee's own is empty for a short chain.
_WINDOW = 5
_TAILS = (0.05, 0.95)


@dataclass(frozen=True)
class Convergence:
    """Diagnostics of every quantity, arrays (d,), of chains of so many `steps` after burn-in.

    `r_hat` is split and rank-normalised with ensembles as chains (Vehtari et al., Bayesian Analysis 16 (2021) 667),
    `tau` the integrated autocorrelation time, the longest of all ensembles [steps], `ess` the effective number of
    samples.
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

    def times_longer(self, min_effective: float, r_hat_max: float) -> float:
        """Return how many times as many steps meet the slowest of these; infinite where that is not known.

        Effective samples grow with the steps, and what R-hat exceeds one by falls with them.
        """
        with np.errstate(divide="ignore"):
            samples, excess = np.divide(min_effective, self.ess), (self.r_hat - 1.0) / (r_hat_max - 1.0)
        slowest = float(np.max([samples, LENGTH_IN_TAU * self.tau / self.steps, excess, np.ones_like(excess)]))
        return np.inf if np.isnan(slowest) else slowest


def convergence(draws: FloatArray) -> Convergence:
    """Return the diagnostics of draws after burn-in, shape (ensembles, steps, walkers, d)."""
    from arviz_stats.base import array_stats

    ensembles, steps, walkers, d = draws.shape
    thin = -(-steps * walkers // _RANKED)
    pooled = np.moveaxis(draws[:, :, ::thin], -1, 0).reshape(d, ensembles, -1)
    tau = np.array([_autocorrelation_times(draws[..., i]) for i in range(d)]).T
    with np.errstate(invalid="ignore", divide="ignore"):
        r_hat = np.asarray(array_stats.rhat(pooled, chain_axis=1, draw_axis=2))
        mean = np.moveaxis(draws.mean(axis=2), -1, 0)
        of_mean = np.asarray(array_stats.ess(mean, chain_axis=1, draw_axis=2, method="mean"))
        coupled = of_mean * draws.var(axis=(0, 1, 2)) / mean.var(axis=(1, 2))
        uncoupled = (steps * walkers / tau).sum(axis=0)
    return Convergence(r_hat, tau.max(axis=0), np.minimum(uncoupled, coupled), steps)


def tail_effective(draws: FloatArray) -> FloatArray:
    """Return the effective number of samples for the 5 and 95 % quantiles, the smaller of both, shape (d,).

    It is that of the indicators of lying below them (Vehtari et al., Bayesian Analysis 16 (2021) 667), with walkers
    as uncoupled. Draws have the shape (ensembles, steps, walkers, d).
    """
    _, steps, walkers, _ = draws.shape
    found = []
    for values in np.moveaxis(draws, -1, 0):
        below = [(values <= q).astype(float) for q in np.quantile(values, _TAILS)]
        found.append(min(float((steps * walkers / _autocorrelation_times(b)).sum()) for b in below))
    return np.array(found)


def _autocorrelation_times(values: FloatArray) -> FloatArray:
    """Return the integrated autocorrelation time of the walkers of every ensemble, (ensembles, steps, walkers) [steps].

    NaN where nothing varies. At least one: a short chain may look as if its steps took turns, but no draw counts twice.
    """
    from scipy.fft import irfft, next_fast_len, rfft

    mean, variance = values.mean(), values.var()
    steps = values.shape[1]
    size = next_fast_len(2 * steps, real=True)
    times = []
    for ensemble in values:
        spectrum = rfft(ensemble - mean, size, axis=0)
        power = (spectrum.real**2 + spectrum.imag**2).mean(axis=1)
        with np.errstate(invalid="ignore", divide="ignore"):
            # Lags of which few pairs are left are noise, but the window ends before.
            correlation = irfft(power, size)[:steps] / (np.arange(steps, 0, -1) * variance)
        sums = 2.0 * np.cumsum(correlation) - 1.0
        long_enough = (np.arange(steps) >= _WINDOW * sums) & (sums > 0)
        times.append(sums[np.argmax(long_enough)] if long_enough.any() else sums[-1])
    return np.maximum(times, 1.0)
