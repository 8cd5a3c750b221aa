"""The model's own error: a Gaussian process correlated over the natural time, beside the instrument's white noise.

y = M(theta) + delta + eps, with delta an Ornstein-Uhlenbeck process of size a and memory tau (Kennedy and O'Hagan,
Journal of the Royal Statistical Society B 63 (2001) 425). Its likelihood is that of the innovations of a Kalman filter
with one state (R. Kalman, Trans. ASME J. Basic Engineering 82 (1960) 35): exact for gaps and irregular times, and as
cheap as reading the residual.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from discovery.foundation.compiled_function import compiled

__all__ = ["Channel", "ModelError", "innovations"]

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class ModelError:
    """Size of the model error [noise sds] and its memory [s]."""

    size: float
    memory: float


@compiled(nogil=True, error_model="numpy")
def _filtered(time, columns, power, memory, out):
    n, k = columns.shape
    mean = np.zeros(k)
    variance, logarithms = power, 0.0
    for i in range(n):
        if i > 0:
            decay = np.exp((time[i - 1] - time[i]) / memory)
            variance = power + decay * decay * (variance - power)
            for j in range(k):
                mean[j] *= decay
        total = variance + 1.0
        gain, scale = variance / total, 1.0 / np.sqrt(total)
        for j in range(k):
            off = columns[i, j] - mean[j]
            out[i, j] = off * scale
            mean[j] += gain * off
        variance = gain
        logarithms += np.log(total)
    return logarithms


def innovations(time: FloatArray, columns: FloatArray, error: ModelError) -> tuple[FloatArray, float]:
    """Return columns made white, and the log determinant of their covariance.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Increasing times [s].
    columns : ndarray, shape (n, k)
        Residuals, or derivatives of them, in noise sds.
    error : ModelError
        Size and memory of the model error.

    Returns
    -------
    ndarray, shape (n, k), and float
    """
    out = np.empty(columns.shape)
    logarithms = _filtered(time, np.ascontiguousarray(columns), error.size**2, error.memory, out)
    return out, float(logarithms)


@dataclass(frozen=True)
class Channel:
    """One channel of one recording.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Times of its readings [s].
    columns : ndarray, shape (n, k)
        Derivatives of the residual, then the residual [noise sds].
    """

    time: FloatArray
    columns: FloatArray

    def gram(self, error: ModelError) -> tuple[FloatArray, float]:
        """Return scalar products (k, k) of the columns made white, and the log determinant of their covariance."""
        if error.size == 0.0:
            return self.columns.T @ self.columns, 0.0
        white, logarithms = innovations(self.time, self.columns, error)
        return white.T @ white, logarithms
