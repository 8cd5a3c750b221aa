"""The noise of readings as their scatter from sample to sample shows it, and where the rig file states another."""

from __future__ import annotations

import numpy as np

from discovery.foundation.arrays import FloatArray
from discovery.recordings.band_noise import BandNoise, resolution
from discovery.recordings.flags import OVERSTATED, UNDERSTATED, Flag

_FEWEST = 200  # readings, fewer scatter too little to contradict a statement
_OTHER = 1.5  # ratio of noises that differ
_COARSE = 0.3  # of the noise
_SETTLED = 0.9  # of an estimate is left by the next order of differences where it holds no signal
_JITTER = 0.05  # of a step


def estimate_noise(values: FloatArray, time: FloatArray | None = None) -> float:
    """Estimate the standard deviation of white noise on a signal that is smooth from sample to sample, in its unit.

    Differences of order 2 to 8 suppress the signal more and more, and each, divided by the root of the sum of its
    squared binomial coefficients, has the variance of the noise. Their median absolute deviation (times 1.4826,
    Gaussian) does not see steps and outliers; the smallest estimate is the one that holds least of the signal. Where
    steps are uneven, plain differences keep some of the slope: there divided ones are taken beside them. Both are,
    because a stamp may err where the samples were steady. Without times, samples are equally spaced; NaN are skipped.
    The estimate is 0 for a signal without noise, NaN with fewer than 18 samples.
    """
    estimates = _estimates(values)
    if time is not None and _uneven(good := time[np.isfinite(values)]):
        estimates += _estimates_at(good, values[np.isfinite(values)])
    return min(estimates, default=float("nan"))


def white_noise(values: FloatArray) -> float | None:
    """Return the noise of single readings; None where differences still hold the motion, or there are too few."""
    estimates = _estimates(values)
    settled = len(estimates) > 1 and estimates[-1] >= _SETTLED * estimates[-2] > 0.0
    return min(estimates) if settled else None


def _estimates(values: FloatArray) -> list[float]:
    """Estimates by the order of differences, from 2 on; none with fewer than 18 samples."""
    estimates: list[float] = []
    difference = np.asarray(values, np.float64)
    difference = difference[np.isfinite(difference)]
    if difference.size < 18:
        return estimates
    square_sum = 1.0  # central binomial coefficient (2k choose k), built up with the order k
    for order in range(1, 9):
        difference = np.diff(difference)
        square_sum *= 2.0 * (2.0 * order - 1.0) / order
        if order > 1:
            deviation = float(np.median(np.abs(difference - np.median(difference))))
            estimates.append(float(1.4826 * deviation / np.sqrt(square_sum)))
    return estimates


def _estimates_at(time: FloatArray, values: FloatArray) -> list[float]:
    """Estimates by the order of divided differences, scaled each to the variance of the noise; none with too few."""
    estimates: list[float] = []
    if values.size < 18:
        return estimates
    scaled = time / np.median(np.diff(time))
    for order in range(2, 9):
        size = values.size - order
        instants = [scaled[k : k + size] for k in range(order + 1)]
        difference, square_sum = np.zeros(size), np.zeros(size)
        for k, at in enumerate(instants):
            weight = 1.0 / np.prod([at - other for j, other in enumerate(instants) if j != k], axis=0)
            difference += weight * values[k : k + size]
            square_sum += weight**2
        difference /= np.sqrt(square_sum)
        estimates.append(float(1.4826 * np.median(np.abs(difference - np.median(difference)))))
    return estimates


def _uneven(time: FloatArray) -> bool:
    """Say whether times increase, and more than one step in twenty is not like the others."""
    steps = np.diff(time)
    return bool(
        steps.size
        and steps.min() > 0.0
        and np.quantile(np.abs(steps - np.median(steps)), 0.95) > _JITTER * np.median(steps)
    )


def noise_flags(
    label: str, unit: str, time: FloatArray, values: FloatArray, stated: float, band: BandNoise | None = None
) -> list[Flag]:
    """Tell where the scatter of readings is not the noise that the rig file states.

    Nothing is said of few or coarse readings, nor where the scatter is larger but may be the signal's. `band` is noise
    that the scatter from sample to sample does not show. NaN are gaps.
    """
    estimates = _estimates(values) if band is None else [band.sd]
    scatter = min(estimates, default=0.0)
    if np.isfinite(values).sum() < _FEWEST or resolution(values) > _COARSE * scatter:
        return []
    if stated / _OTHER <= scatter <= stated * _OTHER:
        return []
    settled = band is not None or (not _uneven(time[np.isfinite(values)]) and estimates[-1] >= _SETTLED * estimates[-2])
    if scatter > stated and not settled:
        return []
    code = UNDERSTATED if scatter > stated else OVERSTATED
    return [Flag(code, label, unit, {"scatter": scatter, "stated": float(stated)})]
