"""What amplitudes of many shapes could remove: scalar products of long vectors, small problems within bounds."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from discovery.foundation.arrays import FloatArray, IntArray
from discovery.foundation.compiled_function import compiled

#: Eigenvalue of a correlation matrix below which a direction is rounding alone.
_FLAT = 1e-12


def bounded_gains(
    gram: FloatArray, push: FloatArray, lower: FloatArray, upper: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the largest fall of |target + parts x|^2 over lower <= x <= upper, for many small problems.

    Parameters
    ----------
    gram : ndarray, shape (t, k, k)
        Scalar products of the k vectors of each problem, its parts.
    push : ndarray, shape (t, k)
        Scalar products of the vectors with the target, what is to be removed.
    lower, upper : ndarray, shape (t, k)
        Bounds.

    Returns
    -------
    gain : ndarray, shape (t,)
        The fall.
    solution : ndarray, shape (t, k)
        Where it is reached.
    transform : ndarray, shape (t, k, k)
        ``transform @ parts`` is an orthonormal basis of the vectors, with rows of zeros where they span less.
    """
    # What is smaller than this is nothing, and its inverse would not fit into single precision.
    norm = np.maximum(np.sqrt(np.einsum("tkk->tk", gram)), 1e-30)
    values, vectors = np.linalg.eigh(gram / (norm[:, :, None] * norm[:, None, :]))
    spanned = values > _FLAT
    root = np.sqrt(np.where(spanned, values, 1.0))
    # The normalised vectors are basis @ factor; the inverse makes a basis of them.
    factor = (root * spanned)[:, :, None] * vectors.transpose(0, 2, 1)
    inverse = vectors * (spanned / root)[:, None, :]
    transform = (inverse / norm[:, :, None]).transpose(0, 2, 1)
    wanted = -np.einsum("tlk,tk->tl", transform, push)
    low, high = lower * norm, upper * norm
    scaled = np.einsum("tkl,tl->tk", inverse, wanted)
    outside = np.flatnonzero(((scaled < low) | (scaled > high)).any(axis=1))
    if push.shape[1] == 1:
        scaled = np.clip(scaled, low, high)
    elif push.shape[1] == 2:
        scaled[outside] = _on_an_edge(factor[outside], wanted[outside], low[outside], high[outside])
    else:
        for i in outside:
            scaled[i] = lsq_linear(factor[i], wanted[i], (low[i], high[i]), method="bvls", tol=1e-10).x
    left = np.einsum("tlk,tk->tl", factor, scaled) - wanted
    gain = np.sum(wanted**2, axis=1) - np.sum(left**2, axis=1)
    return gain, scaled / norm, transform


def _on_an_edge(factor: FloatArray, wanted: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    """Return where |factor x - wanted|^2 is least on the edges of rectangles without a stationary point, (t, 2)."""
    best, least = np.clip(0.0, low, high), np.full(len(wanted), np.inf)
    for i, j in ((0, 1), (1, 0)):
        for end in (low, high):
            x = np.empty_like(low)
            # An edge that lies nowhere is no edge.
            x[:, i] = np.where(np.isfinite(end[:, i]), end[:, i], best[:, i])
            rest = wanted - factor[:, :, i] * x[:, i, None]
            own = factor[:, :, j]
            along = np.sum(own * rest, axis=1) / np.maximum(np.sum(own**2, axis=1), _FLAT)
            x[:, j] = np.clip(along, low[:, j], high[:, j])
            left = np.sum((rest - own * x[:, j, None]) ** 2, axis=1)
            better = left < least
            best[better], least[better] = x[better], left[better]
    return best


@njit(fastmath={"contract", "reassoc"}, forceinline=True)
def _product(a, b):
    total = 0.0
    for i in range(a.size):
        total += np.float64(a[i]) * np.float64(b[i])
    return total


@compiled(nogil=True)
def _grams(vectors, rows, target, gram, push):
    count, k = rows.shape
    squares, pushes = np.empty(len(vectors)), np.empty(len(vectors))
    for u in range(len(vectors)):
        squares[u] = _product(vectors[u], vectors[u])
        pushes[u] = _product(vectors[u], target)
    for t in range(count):
        for i in range(k):
            first = rows[t, i]
            gram[t, i, i], push[t, i] = squares[first], pushes[first]
            for j in range(i):
                gram[t, i, j] = gram[t, j, i] = _product(vectors[first], vectors[rows[t, j]])


def grams(vectors: NDArray[np.float32], rows: IntArray, target: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the scalar products within groups of vectors, and with a target, in double precision.

    `vectors` (u, n): all vectors. `rows` (t, k): which of them make each group; groups may share some. `target` (n,):
    what they are compared with. Returned: `gram` (t, k, k): products of the vectors of each group with each other;
    `push` (t, k): products with the target.
    """
    count, k = rows.shape
    gram, push = np.empty((count, k, k)), np.empty((count, k))
    _grams(vectors, rows, target, gram, push)
    return gram, push
