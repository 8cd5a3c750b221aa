"""The model's own error: a smooth Gaussian process beside the instrument's white noise.

y = M(theta) + delta + eps, with delta a process of size a (Kennedy and O'Hagan, Journal of the Royal Statistical
Society B 63 (2001) 425) and Matern's covariance a^2 (1 + t / tau) exp(-t / tau) (Rasmussen and Williams, Gaussian
Processes for Machine Learning (2006), 4.2.1). What a wrong model leaves has a rate: the size of a process without one
would depend on the sampling. The likelihood is that of the innovations of a Kalman filter with two states (Hartikainen
and Sarkka, IEEE MLSP (2010) 379): exact for gaps and irregular times, and as cheap as reading the residual.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from discovery.foundation.arrays import BoolArray, FloatArray
from discovery.foundation.compiled_function import compiled

#: Memory of a model error over the natural time: a slower one takes the motion itself for an error.
_MEMORY = 1 / 9
#: Relative differences: of times between readings that are the same but for round-off, of gains that have settled.
_ROUND_OFF, _SETTLED = 1e-9, 1e-14


@dataclass(frozen=True)
class ModelError:
    """Size of the model error [noise sds] and its memory [s]."""

    size: float
    memory: float

    @classmethod
    def of(cls, size: float, natural_time: float) -> ModelError:
        """Return the model error of a motion with a natural time [s]."""
        return cls(size, _MEMORY * natural_time)


@compiled(nogil=True, error_model="numpy")
def _filtered(time, present, columns, power, rate, out):
    n, k = columns.shape
    mean, slope = np.zeros(k), np.zeros(k)
    # Variance of the process, of its slope over the rate, and their covariance.
    own, both, steep = power, 0.0, power
    f, g, h = 1.0, 0.0, 1.0
    gain, turn, scale, logarithm = 0.0, 0.0, 0.0, 0.0
    logarithms, last, apart, settled = 0.0, -1, -1.0, False
    for i in range(n):
        if not present[i]:
            out[i] = 0.0
            continue
        if last >= 0:
            away = (time[i] - time[last]) * rate
            # Times of a regular sampling differ by their round-off.
            if not abs(away - apart) <= _ROUND_OFF * away:
                apart, settled = away, False
                decay = np.exp(-apart)
                f, g, h = decay * (1.0 + apart), decay * apart, decay * (1.0 - apart)
        # Under a regular sampling the gains settle soon.
        if not settled:
            # What the stationary process keeps of its variance, less what the readings took from it.
            x, y, z = own - power, both, steep - power
            own = power + f * f * x + 2.0 * f * g * y + g * g * z
            both = -f * g * x + (f * h - g * g) * y + g * h * z
            steep = power + g * g * x - 2.0 * g * h * y + h * h * z
            total, before_gain, before_turn = own + 1.0, gain, turn
            gain, turn, scale, logarithm = own / total, both / total, 1.0 / np.sqrt(total), np.log(total)
            settled = abs(gain - before_gain) <= _SETTLED * gain and abs(turn - before_turn) <= _SETTLED * abs(turn)
            steep -= turn * both
            own, both = gain, turn
        for j in range(k):
            before = f * mean[j] + g * slope[j]
            off = columns[i, j] - before
            out[i, j] = off * scale
            slope[j] = -g * mean[j] + h * slope[j] + turn * off
            mean[j] = before + gain * off
        logarithms += logarithm
        last = i
    return logarithms


def whiten(time: FloatArray, present: BoolArray, columns: FloatArray, error: ModelError, out: FloatArray) -> float:
    """Make columns white into `out`, and return the log determinant of their covariance.

    `time` (n,): increasing times [s]. `present` (n,): which readings there are; `out` is zero at the others. `columns`
    (n, k): residuals, or derivatives of them, in noise sds. `error`: size and memory of the model error. `out` (n, k).
    """
    return float(_filtered(time, present, columns, error.size**2, 1.0 / error.memory, out))


def innovations(time: FloatArray, columns: FloatArray, error: ModelError) -> tuple[FloatArray, float]:
    """Return columns (n, k) made white, and the log determinant of their covariance; see `whiten`."""
    out = np.empty(columns.shape)
    return out, whiten(time, np.ones(time.size, bool), columns, error, out)


@dataclass(frozen=True)
class Channel:
    """One channel of one recording."""

    time: FloatArray  # (n,), times of its readings [s]
    columns: FloatArray  # (n, k), derivatives of the residual, then the residual [noise sds]

    @classmethod
    def each(cls, time: FloatArray, columns: FloatArray, present: BoolArray) -> list[Channel]:
        """Return the channels of columns (n, c, k) over their samples that are present, shape (n, c)."""
        return [cls(time[here], columns[here, c]) for c, here in enumerate(present.T) if here.any()]

    def gram(self, error: ModelError) -> tuple[FloatArray, float]:
        """Return scalar products (k, k) of the columns made white, and the log determinant of their covariance."""
        if error.size == 0.0:
            return self.columns.T @ self.columns, 0.0
        white, logarithms = innovations(self.time, self.columns, error)
        return white.T @ white, logarithms

    def left(self, step: FloatArray) -> FloatArray:
        """Return the residual (n,) after a step of the first parameters [noise sds]."""
        return self.columns[:, : step.size] @ step + self.columns[:, -1]
