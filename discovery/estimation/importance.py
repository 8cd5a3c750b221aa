"""Integrals of densities that are roughly normal, by importance sampling, with the diagnostic of their draws.

The proposal is a Student t, adapted to its own weighted draws, with a wider one mixed in as a defence (T. Hesterberg,
Technometrics 37 (1995) 185). The largest weights are smoothed by a Pareto distribution, whose shape k says whether the
answer can be trusted (A. Vehtari et al., Journal of Machine Learning Research 25 (2024) 72).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from discovery.foundation.errors import ComputationError

__all__ = ["LARGEST_K", "LEAST_EFFECTIVE", "Weighted", "importance_sample"]

FloatArray = NDArray[np.float64]

#: Pareto k above which the mean of the weights converges too slowly for any use.
LARGEST_K = 0.7
#: Part of the draws that must count.
LEAST_EFFECTIVE = 0.15
_DOF = 8.0
# Part of the draws that the defence makes, and how much wider it is.
_DEFENCE, _WIDER = 0.1, 2.5
# A round is good, or not worth another, by its error.
_WELL, _GAIN = 0.8, 0.9
_QUANTILES = (0.05, 0.5, 0.95)
# Draws below which no Pareto distribution can be fitted to the largest weights.
_TAIL = 25


@dataclass(frozen=True)
class Weighted:
    """Weighted draws from a density.

    Parameters
    ----------
    points : ndarray, shape (n, d)
        Where it was evaluated.
    weights : ndarray, shape (n,)
        Pareto-smoothed, of sum one.
    log_integral : float
        Logarithm of the integral of the density.
    error : float
        Standard error of `log_integral`.
    pareto_k : float
        Shape of the largest weights; above `LARGEST_K` nothing here can be trusted.
    """

    points: FloatArray
    weights: FloatArray
    log_integral: float
    error: float
    pareto_k: float

    @property
    def effective(self) -> float:
        """Effective number of draws."""
        return float(1.0 / np.sum(self.weights**2))

    @property
    def reliable(self) -> bool:
        """Whether the numbers can be trusted: the mean of the weights converges, and enough draws count.

        The second is asked for because k is estimated from the tail that was seen: it misses a region, such as the neck
        of a funnel, that hardly a draw reaches.
        """
        return self.pareto_k <= LARGEST_K and self.effective >= LEAST_EFFECTIVE * len(self.weights)

    def quantiles(self, values: FloatArray) -> list[float]:
        """Return 5, 50 and 95 % quantiles of a quantity (n,) of the draws."""
        order = np.argsort(values)
        middle = np.cumsum(self.weights[order]) - 0.5 * self.weights[order]
        found: list[float] = np.interp(_QUANTILES, middle, values[order]).tolist()
        return found


def importance_sample(
    log_density: Callable[[FloatArray], FloatArray],
    dimension: int,
    rng: Generator,
    draws: int = 4000,
    pilot: int = 1024,
    *,
    rounds: int = 6,
    repairs: int = 3,
) -> Weighted:
    """Integrate a density that is roughly a standard normal one.

    Parameters
    ----------
    log_density : callable
        Log density at points (k, d), minus infinity outside the support.
    dimension : int
        Dimension d.
    rng : Generator
        Source of the draws.
    draws, pilot : int
        Draws of the last round, and of one that adapts the proposal.
    rounds, repairs : int
        How many rounds adapt at most, and how many times the last one is repeated, adapted to itself.

    Raises
    ------
    ComputationError
        If no draw has a finite density.
    """
    centre, factor = np.zeros(dimension), np.eye(dimension)
    last = math.inf
    for _ in range(rounds):
        first = _round(log_density, centre, factor, rng, pilot)
        if first.effective > _WELL * pilot or (first.reliable and not first.error < _GAIN * last):
            break
        last = first.error
        centre, factor = _moments(first, centre, factor)
    drawn = _round(log_density, centre, factor, rng, draws)
    for _ in range(repairs):
        if drawn.reliable:
            break
        # A tail that the fewer draws had not shown.
        centre, factor = _moments(drawn, centre, factor)
        drawn = _round(log_density, centre, factor, rng, draws)
    return drawn


def _round(
    log_density: Callable[[FloatArray], FloatArray], centre: FloatArray, factor: FloatArray, rng: Generator, n: int
) -> Weighted:
    """Draw from the proposal and weigh."""
    from arviz_stats.base import array_stats
    from scipy.special import gammaln

    d = centre.size
    t = rng.standard_normal((n, d)) / np.sqrt(rng.chisquare(_DOF, n) / _DOF)[:, None]
    wide = np.where(rng.random(n) < _DEFENCE, _WIDER, 1.0)
    t *= wide[:, None]
    square = np.einsum("nd,nd->n", t, t)
    constant = gammaln(0.5 * (_DOF + d)) - gammaln(0.5 * _DOF) - 0.5 * d * math.log(_DOF * math.pi)
    narrow = math.log(1 - _DEFENCE) - 0.5 * (_DOF + d) * np.log1p(square / _DOF)
    broad = math.log(_DEFENCE) - d * math.log(_WIDER) - 0.5 * (_DOF + d) * np.log1p(square / (_DOF * _WIDER**2))
    log_proposal = constant + np.logaddexp(narrow, broad) - float(np.log(np.diag(factor)).sum())
    points = centre + np.einsum("nj,ij->ni", t, factor)
    raw = log_density(points) - log_proposal
    inside = np.isfinite(raw)
    if inside.sum() < max(2 * d, _TAIL):
        raise ComputationError(f"Of {n} draws around the fit only {int(inside.sum())} have a finite density.")
    with np.errstate(all="ignore"):
        # It wants what it calls log likelihoods, whose negative is the log weight.
        smooth, k = array_stats.psislw(-raw[inside])
    # The smallest weight is never smoothed: it tells by what all were divided.
    least = int(np.argmin(raw[inside]))
    log_sum = float(raw[inside][least] - smooth[least])
    weights = np.zeros(n)
    weights[inside] = np.exp(smooth)
    weights /= weights.sum()
    error = math.sqrt(max(float(np.sum(weights**2)) - 1.0 / n, 0.0))
    return Weighted(points, weights, log_sum - math.log(n), error, float(k) if math.isfinite(k) else math.inf)


def _moments(drawn: Weighted, centre: FloatArray, factor: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return mean and factor of the covariance of weighted draws, the latter drawn to the old one where few count."""
    mean = np.einsum("n,nd->d", drawn.weights, drawn.points)
    off = drawn.points - mean
    covariance = np.einsum("n,ni,nj->ij", drawn.weights, off, off)
    trust = drawn.effective / (drawn.effective + 2 * centre.size)
    return mean, np.asarray(np.linalg.cholesky(trust * covariance + (1 - trust) * factor @ factor.T), np.float64)
