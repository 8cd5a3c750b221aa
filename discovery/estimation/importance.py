"""Integrals of densities that are roughly normal, by importance sampling, with the diagnostic of their draws.

The proposal is a Student t, adapted to its own weighted draws, with a wider one mixed in as a defence, see
`discovery.estimation.proposal`. The largest weights are smoothed by a Pareto distribution, whose shape k says whether
the answer can be trusted (A. Vehtari et al., Journal of Machine Learning Research 25 (2024) 72).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from scipy.optimize import brentq
from scipy.special import logsumexp

from discovery.estimation.proposal import Proposal, enough
from discovery.foundation.arrays import FloatArray
from discovery.foundation.errors import ComputationError

LogDensity = Callable[[FloatArray], FloatArray]

#: Pareto k above which the mean of the weights converges too slowly for any use.
LARGEST_K = 0.7
#: Part of the draws that must count.
LEAST_EFFECTIVE = 0.15
# A round is good, or not worth another, by its error.
_WELL, _GAIN = 0.8, 0.9
_QUANTILES = (0.05, 0.5, 0.95)
# Draws that count below which more of them are in vain.
_ALONE = 2.0
# Logarithm of the smallest power of a density that flattens it, and what is least beside it: that power makes both
# about equal.
_FLATTEST, _LEAST = -40.0, -1e15
# Draws below which no Pareto distribution can be fitted to the largest weights.
_TAIL = 25


@dataclass(frozen=True)
class Weighted:
    """Weighted draws from a density."""

    points: FloatArray  # (n, d), where it was evaluated
    weights: FloatArray  # (n,), Pareto-smoothed, of sum one
    log_weights: FloatArray  # (n,), as they were; minus infinity where the density is zero
    log_integral: float  # logarithm of the integral of the density
    error: float  # standard error of `log_integral`
    pareto_k: float  # shape of the largest weights; above `LARGEST_K` nothing here can be trusted

    @property
    def effective(self) -> float:
        """Effective number of draws."""
        return float(1.0 / np.sum(self.weights**2))

    @property
    def share(self) -> float:
        """Part of the draws that counts."""
        return self.effective / len(self.points)

    def flattened(self, count: float) -> FloatArray:
        """Return weights (n,) of sum one by which so many draws count, at most half of them.

        Where fewer do, they are flattened to a power below one: the likeliest draw of a proposal that is far too wide
        alone tells nothing of a shape (E. Koblents and J. Miguez, Statistics and Computing 25 (2015) 407).
        """
        count = min(count, 0.5 * np.isfinite(self.log_weights).sum())
        if self.effective >= count:
            return self.weights
        below = self.log_weights - self.log_weights.max()
        below = np.where(np.isfinite(below), np.maximum(below, _LEAST), -np.inf)

        def excess(log_power: float) -> float:
            weights = np.exp(math.exp(log_power) * below)
            return float(weights.sum() ** 2 / np.sum(weights**2) - count)

        log_power = 0.0 if excess(0.0) >= 0 else brentq(excess, _FLATTEST, 0.0)
        weights = np.exp(math.exp(log_power) * below)
        return np.asarray(weights / weights.sum())

    @property
    def reliable(self) -> bool:
        """Whether the numbers can be trusted: the mean of the weights converges, and enough draws count.

        The second is asked for because k is estimated from the tail that was seen: it misses a region, such as the neck
        of a funnel, that hardly a draw reaches.
        """
        return self.pareto_k <= LARGEST_K and self.share >= LEAST_EFFECTIVE

    def quantiles(self, values: FloatArray) -> list[float]:
        """Return 5, 50 and 95 % quantiles of a quantity (n,) of the draws."""
        order = np.argsort(values)
        middle = np.cumsum(self.weights[order]) - 0.5 * self.weights[order]
        found: list[float] = np.interp(_QUANTILES, middle, values[order]).tolist()
        return found


def importance_sample(
    log_density: LogDensity,
    dimension: int,
    rng: Generator,
    draws: int = 4000,
    pilot: int = 1024,
    *,
    frame: FloatArray | None = None,
    rounds: int = 6,
    repairs: int = 3,
) -> Weighted:
    """Integrate a density that is roughly a standard normal one.

    Where hardly more than one draw counts after all rounds that adapt, it is not: those draws are returned.

    `log_density`: at points (k, d) of `dimension` d, minus infinity outside the support. `draws`, `pilot`: of the last
    round, and of one that adapts the proposal. `frame` (d, d): matrix to coordinates in which valleys may bend, see
    `discovery.estimation.proposal.Proposal`. `rounds`, `repairs`: how many rounds adapt at most, and how many times the
    last one is repeated, adapted to itself. Raises ComputationError if hardly a draw has a finite density.
    """
    proposal = Proposal.standard(dimension, frame)
    last = math.inf
    for _ in range(rounds):
        first = weighed(log_density, proposal, rng, pilot)
        if first.effective > _WELL * pilot or (first.reliable and not first.error < _GAIN * last):
            break
        last = first.error
        proposal = proposal.adapted(first.points, first.flattened(enough(dimension)))
    if first.effective < _ALONE:
        return first
    drawn = weighed(log_density, proposal, rng, draws)
    for _ in range(repairs):
        if drawn.reliable:
            break
        # A tail that the fewer draws had not shown.
        proposal = proposal.adapted(drawn.points, drawn.flattened(enough(dimension)))
        drawn = weighed(log_density, proposal, rng, draws)
    return drawn


def weighed(log_density: LogDensity, proposal: Proposal, rng: Generator, count: int) -> Weighted:
    """Draw so many points from a proposal and weigh them by a log density at points (k, d).

    Raises ComputationError if hardly a draw has a finite density.
    """
    points, log_proposal = proposal.draw(rng, count)
    return _weighted(points, log_density(points) - log_proposal)


def pooled(rounds: Sequence[tuple[Proposal, Weighted]]) -> Weighted:
    """Return the draws of all rounds, weighed by the mixture of their proposals.

    What one round has seen is not lost on the next (J.-M. Cornuet et al., Scandinavian Journal of Statistics 39 (2012)
    798).
    """
    points = np.concatenate([drawn.points for _, drawn in rounds])
    log_density = np.concatenate([drawn.log_weights + own.log_density(drawn.points) for own, drawn in rounds])
    each = [own.log_density(points) + math.log(len(drawn.points) / len(points)) for own, drawn in rounds]
    return _weighted(points, log_density - logsumexp(each, axis=0))


def _weighted(points: FloatArray, raw: FloatArray) -> Weighted:
    """Return draws (n, d) with log weights (n,)."""
    count = len(points)
    inside = np.isfinite(raw)
    raw[~inside] = -np.inf
    if inside.sum() < max(2 * points.shape[1], _TAIL):
        raise ComputationError(f"Of {count} draws around the fit only {int(inside.sum())} have a finite density.")
    smooth, k = smoothed(raw[inside])
    # The smallest weight is never smoothed: it tells by what all were divided.
    least = int(np.argmin(raw[inside]))
    log_sum = float(raw[inside][least] - smooth[least])
    weights = np.zeros(count)
    weights[inside] = np.exp(smooth)
    weights /= weights.sum()
    error = math.sqrt(max(float(np.sum(weights**2)) - 1.0 / count, 0.0))
    return Weighted(points, weights, raw, log_sum - math.log(count), error, k)


def smoothed(log_weights: FloatArray) -> tuple[FloatArray, float]:
    """Return log weights, the largest of them smoothed by a Pareto distribution, up to a constant, and its shape k."""
    from arviz_stats.base import array_stats

    with np.errstate(all="ignore"):
        # It wants what it calls log likelihoods, whose negative is the log weight.
        smooth, k = array_stats.psislw(-log_weights)
    if not np.isfinite(smooth).all():
        # The largest are so far above the others that there is no tail.
        return np.asarray(log_weights - logsumexp(log_weights)), math.inf
    return np.asarray(smooth), float(k) if math.isfinite(k) else math.inf
