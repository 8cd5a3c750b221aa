"""Readings that are those of another signal, noise and all: no instrument repeats its noise."""

from __future__ import annotations

import numpy as np
from scipy.signal import correlate, correlation_lags

from discovery.foundation.arrays import FloatArray
from discovery.recordings.quantisation import quantum
from discovery.recordings.reading_noise import white_noise

#: Of the noise: what two signals with noises of their own never come down to.
_NEAR = 0.3
#: Share of Gaussian values that is below so many standard deviations.
_MOST, _SIGMAS = 0.9, 1.645
#: Readings in common that are needed, at least and as a share of the shorter signal.
_FEWEST, _MUCH = 60, 0.1


def copied(first: FloatArray, second: FloatArray) -> int | None:
    """Return the row of the second signal from which on it is a part of the first, but for less than its own noise.

    The signals are read at equal steps; NaN are gaps. None also where the noise cannot be told from the motion or from
    rounding.
    """
    noise = _own_noise(second)
    if noise is None:
        return None
    lag = _lag(first, second)
    begin = max(lag, 0)
    common = min(second.size, first.size + lag) - begin
    if common < max(_FEWEST, _MUCH * min(first.size, second.size)):
        return None
    apart = second[begin : begin + common] - first[begin - lag : begin - lag + common]
    return begin if _size(apart) < _NEAR * noise else None


def scaled_copy(first: FloatArray, second: FloatArray) -> bool:
    """Return whether the second signal is the first, row by row, but for scale, zero and less than its own noise."""
    noise = _own_noise(second)
    good = np.isfinite(first) & np.isfinite(second)
    if noise is None or good.sum() < _FEWEST or np.ptp(first[good]) == 0.0:
        return False
    line = np.polynomial.Polynomial.fit(first[good], second[good], 1)
    return _size(second[good] - line(first[good])) < _NEAR * noise


def _own_noise(values: FloatArray) -> float | None:
    """Return the noise of readings; None where it is not that of single readings, or less than a step of rounding."""
    noise = white_noise(values)
    return noise if noise is not None and noise > quantum(values) else None


def _lag(first: FloatArray, second: FloatArray) -> int:
    """Return by how many rows the second signal comes later where the noises of both are most alike."""
    one, other = (np.nan_to_num(np.diff(values, 4)) for values in (first, second))
    alike = correlate(other, one, method="fft")
    return int(correlation_lags(other.size, one.size)[np.argmax(alike)])


def _size(values: FloatArray) -> float:
    """Return the root mean square of values by a quantile that few bad ones do not move; infinite without any.

    Steady readings in coarse steps agree by chance in more than half of the rows, and in their median.
    """
    finite = np.abs(values[np.isfinite(values)])
    return float(np.quantile(finite, _MOST)) / _SIGMAS if finite.size >= _FEWEST else np.inf
