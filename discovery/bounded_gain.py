"""Stacks of small least-squares problems within bounds: what a few amplitudes of many shapes could remove."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

__all__ = ["bounded_gains"]

FloatArray = NDArray[np.float64]
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
    if push.shape[1] == 1:
        scaled = np.clip(scaled, low, high)
    for i in np.flatnonzero(((scaled < low) | (scaled > high)).any(axis=1)):
        scaled[i] = lsq_linear(factor[i], wanted[i], (low[i], high[i]), method="bvls", tol=1e-10).x
    left = np.einsum("tlk,tk->tl", factor, scaled) - wanted
    gain = np.sum(wanted**2, axis=1) - np.sum(left**2, axis=1)
    return gain, scaled / norm, transform
