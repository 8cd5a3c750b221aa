"""Best subset selection: of all equations of k candidates the ones that explain most, for k = 1, 2, ...

References
----------
A. Miller, Subset Selection in Regression, 2nd ed., Chapman & Hall/CRC (2002).
"""

from __future__ import annotations

from itertools import combinations
from math import comb

import numpy as np

from discovery.foundation.arrays import FloatArray

_KEPT = 100  # equations of each size that are followed through the resamples


def best_subsets(
    gram: FloatArray, moment: FloatArray, energy: float, max_terms: int, signs: np.ndarray
) -> list[tuple[np.ndarray, FloatArray]]:
    """Return the sets of k candidates that explain most variance, for k = 1, 2, ...

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
