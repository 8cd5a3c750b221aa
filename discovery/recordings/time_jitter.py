"""Errors of time stamps: readings that were taken a little earlier or later than their stamp says."""

from __future__ import annotations

import numpy as np

from discovery.foundation.arrays import FloatArray
from discovery.foundation.sampling import gaps, median_step

_FEWEST = 200  # readings, fewer scatter too little to tell their noise from that of their stamps
_SURE = 4.0  # standard deviations
_ROUNDED = 2e-3  # of the median step
_SHARE = 1 / 3  # of the readings are compared, the slowest with the fastest ones


def scatter(time: FloatArray, output: FloatArray, noise: FloatArray, jitter: float) -> FloatArray:
    """Return the sd (n, c) of each reading: its noise and, in quadrature, slope times error of its stamp.

    `noise` (c,) is that of readings that do not move, `jitter` the standard deviation of the error of a stamp [s]. NaN
    are gaps of the output (n, c).
    """
    still = np.broadcast_to(noise, output.shape)
    if jitter == 0.0:
        return still
    return np.asarray(np.hypot(still, jitter * np.stack([_slope(time, c) for c in output.T], axis=1)))


def stamp_deviation(time: FloatArray) -> float:
    """Return how far stamps lie from those of a steady clock [s]: the most that they may err, if samples are steady."""
    near = np.diff(time)[~gaps(time)]
    return float(np.std(near) / np.sqrt(2.0)) if near.size > 1 else 0.0


def estimate_jitter(time: FloatArray, output: FloatArray, noise: FloatArray) -> float:
    """Estimate by how much stamps err [s], from how much more readings scatter where they move fast; see `scatter`.

    Stamps that deviate from a steady clock may be right, for then the samples were not steady, or err. They err where
    a reading lies off the cubic through its neighbours by more in the fastest third of a recording than in the
    slowest, beyond chance; they err by no more than they deviate. The estimate is the median of the channels, zero for
    steady stamps, and for those that do not seem to err.
    """
    most = stamp_deviation(time)
    # Rounded stamps deviate as well, and by far less than would be seen in any reading.
    if most < _ROUNDED * median_step(time):
        return 0.0
    return min(most, float(np.median([_of_channel(time, c, sd) for c, sd in zip(output.T, noise, strict=True)])))


def _slope(time: FloatArray, channel: FloatArray) -> FloatArray:
    """Return how fast a channel moves at each reading, on straight lines across its gaps."""
    good = np.isfinite(channel)
    if good.sum() < 2 or time.size < 3:
        return np.zeros_like(channel)
    return np.asarray(np.gradient(np.interp(time, time[good], channel[good]), time, edge_order=2))


def _of_channel(time: FloatArray, channel: FloatArray, noise: float) -> float:
    """Return the error of stamps that one channel shows [s]."""
    good = np.isfinite(channel)
    if good.sum() < _FEWEST:
        return 0.0
    error, speed = left_by_cubics(time[good], channel[good])
    order, part = np.argsort(np.abs(speed)), int(_SHARE * speed.size)
    slow, fast = order[:part], order[-part:]
    base = max(_variance(error[slow]), noise**2)
    excess = _variance(error[fast]) - base
    # A variance from a median deviation is known to 1.6 sqrt(2 / n) of itself.
    if excess < _SURE * 1.6 * np.sqrt(2.0 / part) * base:
        return 0.0
    return float(np.sqrt(excess / np.median(speed[fast] ** 2)))


def left_by_cubics(time: FloatArray, channel: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return by how much readings miss the cubic through two neighbours on either side, and the slopes there, (n - 4,).

    They are those of the third reading to the last but two; a miss has the standard deviation of one reading, and is
    NaN next to a gap.
    """
    at = np.stack([time[:-4], time[1:-3], time[3:-1], time[4:]]) - time[2:-2]
    near = np.stack([channel[:-4], channel[1:-3], channel[3:-1], channel[4:]])
    weight = np.ones_like(at)
    for k in range(4):
        for j in range(4):
            if j != k:
                weight[k] *= at[j] / (at[j] - at[k])
    error = (channel[2:-2] - (weight * near).sum(axis=0)) / np.sqrt(1.0 + np.square(weight).sum(axis=0))
    return error, (near[2] - near[1]) / (at[2] - at[1])


def _variance(values: FloatArray) -> float:
    """Return the variance of Gaussian values, some of which are wild."""
    return float((1.4826 * np.median(np.abs(values - np.median(values)))) ** 2)
