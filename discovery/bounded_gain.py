"""Stacks of small least-squares problems within bounds: what a few amplitudes of many shapes could remove."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

__all__ = ["bounded_gains"]

FloatArray = NDArray[np.float64]
#: Smallest eigenvalue of a correlation matrix whose square root is exact to eight digits; flatter ones are factored.
_FLAT = 1e-8


def bounded_gains(
    parts: FloatArray, target: FloatArray, lower: FloatArray, upper: FloatArray
) -> tuple[FloatArray, FloatArray, NDArray[np.float32]]:
    """Return the largest fall of |target + parts x|^2 over lower <= x <= upper, for many small problems.

    Parameters
    ----------
    parts : ndarray, shape (t, k, n)
        Vectors of each problem, k of them.
    target : ndarray, shape (n,)
        What is to be removed.
    lower, upper : ndarray, shape (t, k)
        Bounds.

    Returns
    -------
    gain : ndarray, shape (t,)
        The fall.
    solution : ndarray, shape (t, k)
        Where it is reached.
    basis : ndarray of float32, shape (t, k, n)
        Orthonormal basis of the vectors.
    """
    gram = parts @ parts.transpose(0, 2, 1)
    norm = np.maximum(np.sqrt(np.einsum("tkk->tk", gram)), 1e-150)
    values, vectors = np.linalg.eigh(gram / (norm[:, :, None] * norm[:, None, :]))
    root = np.sqrt(np.maximum(values, _FLAT))
    # The normalised vectors are basis @ factor; the inverse makes a basis of them.
    factor = root[:, :, None] * vectors.transpose(0, 2, 1)
    inverse = vectors / root[:, None, :]
    basis = (inverse / norm[:, :, None]).transpose(0, 2, 1) @ parts
    flat = values[:, 0] < _FLAT
    for i in np.flatnonzero(flat):
        orthonormal, factor[i] = np.linalg.qr((parts[i] / norm[i, :, None]).T)
        basis[i] = orthonormal.T
    wanted = -(basis @ target)
    low, high = lower * norm, upper * norm
    scaled = np.einsum("tkl,tl->tk", inverse, wanted)
    if parts.shape[1] == 1:
        scaled = np.clip(scaled, low, high)
    for i in np.flatnonzero(flat | ((scaled < low) | (scaled > high)).any(axis=1)):
        scaled[i] = lsq_linear(factor[i], wanted[i], (low[i], high[i]), method="bvls", tol=1e-10).x
    left = np.einsum("tkl,tl->tk", factor, scaled) - wanted
    gain = np.sum(wanted**2, axis=1) - np.sum(left**2, axis=1)
    return gain, scaled / norm, basis.astype(np.float32)
