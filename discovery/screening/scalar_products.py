"""Scalar products of many long vectors, a few at a time: those of the amplitudes of each shape of an effect."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from discovery.foundation.arrays import FloatArray, IntArray
from discovery.foundation.compiled_function import compiled


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
