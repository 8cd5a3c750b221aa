"""When one equation explains the data better than another, although what both leave is no white noise.

The residual of an incomplete equation is systematic: it is measured by its spectrum at the frequencies of the motion,
and once it exceeds the instrument's noise there, likelihoods count whole stretches instead of samples.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from math import comb

import numpy as np

from discovery.foundation.arrays import FloatArray

CANNOT_TELL = 10.0
"""Rivals within this ratio of likelihoods fit equally."""

MISFIT = 2.0
"""Ratio of residual to instrument noise beyond which an equation counts as incomplete."""

_KEPT = 100  # equations of each size that are followed through the resamples


def loudness(residual: FloatArray, target: FloatArray) -> float:
    """Spectral density of unit-noise residuals at the frequencies of the target; one for the instrument's noise alone.

    What a wrong model leaves is correlated: its variance as a regression sees it is its spectrum where the target is.
    """
    power = np.abs(np.fft.rfft(residual)) ** 2 / residual.size
    width = max(5, round(np.sqrt(residual.size) / 4.0))
    smoothed = np.convolve(np.pad(power, width, mode="reflect"), np.ones(width) / width, mode="same")[width:-width]
    weight = np.abs(np.fft.rfft(target)) ** 2
    return max(1.0, float(np.sum(smoothed * weight) / np.sum(weight)))


@dataclass(frozen=True)
class Choice:
    """The rule by which one equation is preferred, on the full data and on every resample alike."""

    complexity: tuple[FloatArray, ...]  # of the candidate equations, for each size k, shape (m,)
    #: (k_max + 1,): variance of what is left over that of the instrument's noise at each size, index zero for no term.
    noise: FloatArray
    stretches: int  # number of independent stretches of the recordings
    price: float  # chi squared that a term must gain

    def preferred(self, rss: Sequence[FloatArray], size: int) -> int:
        """Index of the simplest equation among those that cannot be told from the best."""
        return int(min(self.near(rss, size), key=lambda i: (self.complexity[size - 1][i], rss[size - 1][i])))

    def near(self, rss: Sequence[FloatArray], size: int) -> np.ndarray:
        """Return the indices of the equations of one size that fit as well as the best."""
        return np.flatnonzero(self.evidence(rss, size) <= np.log(CANNOT_TELL))

    def evidence(self, rss: Sequence[FloatArray], size: int) -> FloatArray:
        """Return the log likelihood ratio of the best equation of one size over each of that size."""
        return log_ratio(rss[size - 1], float(rss[size - 1].min()), float(self.noise[size]), self.stretches)

    def size(self, energy: float, rss: Sequence[FloatArray]) -> int:
        """Return the number of terms after which no further one pays its price."""
        return stopping_size(np.array([energy, *(values.min() for values in rss)]), self.price * self.noise)


def log_ratio(rss: FloatArray, best: float, noise: float, stretches: int) -> FloatArray:
    """Log likelihood ratio of the best equation over others of its size.

    Against the instrument's noise if that is all that is left. Else all of them are wrong, what they leave is
    systematic, and each stretch counts for two independent numbers only, an amplitude and a phase.
    """
    white = (rss - best) / (2.0 * noise)
    return white if noise <= MISFIT else np.minimum(white, stretches * np.log(np.maximum(rss / best, 1.0)))


def best_subsets(
    gram: FloatArray, moment: FloatArray, energy: float, max_terms: int, signs: np.ndarray
) -> list[tuple[np.ndarray, FloatArray]]:
    """Return the sets of k candidates that explain most variance, for k = 1, 2, ...

    A. Miller, Subset Selection in Regression, 2nd ed., Chapman & Hall/CRC (2002).

    Parameters
    ----------
    gram, moment, energy : ndarray (p, p), ndarray (p,), float
        Scalar products of the candidates, of each with the target, of the target.
    max_terms : int
        Largest equation looked at.
    signs : ndarray of int, shape (p,)
        1 for a coefficient that must not be negative, -1 for one that must not be positive, 0 for any.

    Returns
    -------
    list of tuple
        For each k the best equations: indices (m, k) and residual sums of squares (m,), best first.
    """
    table: list[tuple[np.ndarray, FloatArray]] = []
    for k in range(1, min(max_terms, moment.size) + 1):
        rivals = _subsets(moment.size, k, table[-1][0] if table else None)
        rss = residual_sums(gram, moment, energy, rivals, signs)
        order = np.argsort(rss)[:_KEPT]
        table.append((rivals[order], rss[order]))
    return table


def _subsets(p: int, k: int, smaller: np.ndarray | None) -> np.ndarray:
    """Every set of k candidates, or beyond 200 000 of them every extension of the best smaller ones."""
    if comb(p, k) <= 200_000 or smaller is None:
        return np.array(list(combinations(range(p), k)))
    grown = {tuple(sorted((*s, j))) for s in smaller.tolist() for j in range(p) if j not in s}
    return np.array(sorted(grown))


def residual_sums(
    gram: FloatArray, moment: FloatArray, energy: float, sets: np.ndarray, signs: np.ndarray
) -> FloatArray:
    """Residual sum of squares of each set; infinite where a coefficient has the wrong sign."""
    scale = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    unit = gram / np.outer(scale, scale) + 1e-12 * np.eye(scale.size)
    right = (moment / scale)[sets]
    coefficients = np.linalg.solve(unit[sets[:, :, None], sets[:, None, :]], right[..., None])[..., 0]
    rss = np.maximum(energy - np.sum(coefficients * right, axis=1), 0.0)
    return np.where(np.any(coefficients * signs[sets] < 0.0, axis=1), np.inf, rss)


def stopping_size(best: FloatArray, cost: FloatArray) -> int:
    """Smallest number of terms after which neither one more nor two more pay their cost.

    ``best[k]`` is the residual sum of squares of the best equation of k terms, ``cost[k]`` the price of a k-th term.
    """
    for k in range(best.size - 1):
        ahead = best[k] - best[k + 1 : k + 3]
        if np.all(ahead < cost[k + 1 : k + 3] * np.arange(1, ahead.size + 1)):
            return k
    return best.size - 1
