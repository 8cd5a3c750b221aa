"""Readings made ready for their spectrum: gaps closed, trend and ends taken off."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from discovery.foundation.arrays import FloatArray


def filled(values: FloatArray) -> FloatArray:
    """Return readings, shape (n,), with straight lines across their gaps, which are NaN."""
    good = np.isfinite(values)
    return np.interp(np.arange(values.size), np.flatnonzero(good), values[good])


def spectrum(values: FloatArray) -> npt.NDArray[np.complex128]:
    """Return the spectrum of values less their trend in a window, of unit variance for white noise of that."""
    n = values.size
    window = np.hanning(n)
    line = np.polynomial.Polynomial.fit(np.arange(n), values, 1)(np.arange(n))
    return np.asarray(np.fft.rfft(window * (values - line)) / np.sqrt(np.sum(window**2)))
