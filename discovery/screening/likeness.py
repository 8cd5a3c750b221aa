"""How candidates relate to each other: which pairs explain a residual together, and which cannot be told apart."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import orth

from discovery.foundation.arrays import FloatArray
from discovery.screening.attribution import Candidate


def likely_pairs(scored: Sequence[Candidate], target: FloatArray, keep: int) -> list[tuple[Candidate, Candidate]]:
    """Return the pairs of candidates whose best sensitivities together remove most of a residual, to first order.

    Parameters
    ----------
    scored : sequence of Candidate
        From `screen`.
    target : ndarray, shape (n,)
        The residual around which they were screened.
    keep : int
        Number of pairs.
    """
    bases = [c.sensitivity for c in scored]
    edges = np.cumsum([0, *(b.shape[1] for b in bases)])
    everything = np.concatenate(bases, axis=1)
    gram, push = everything.T @ everything, everything.T @ target
    gains = {}
    for i in range(len(scored)):
        for j in range(i):
            at = np.r_[edges[i] : edges[i + 1], edges[j] : edges[j + 1]]
            solution = np.linalg.lstsq(gram[np.ix_(at, at)], push[at], rcond=1e-9)[0]
            gains[j, i] = float(push[at] @ solution)
    best = sorted(gains, key=lambda pair: -gains[pair])[:keep]
    return [(scored[j], scored[i]) for j, i in best]


def similarity(first: FloatArray, second: FloatArray) -> float:
    """Return the largest principal cosine between two projected sensitivities: 1 when they cannot be told apart.

    What moves nothing is like nothing: 0.
    """
    a, b = (orth(columns) for columns in (first, second))
    return float(np.linalg.svd(a.T @ b, compute_uv=False).max(initial=0.0))
