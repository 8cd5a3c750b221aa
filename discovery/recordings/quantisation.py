"""The steps in which an instrument reads."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import uniform_filter1d

from discovery.foundation.arrays import FloatArray

_CANDIDATES = (0.05, 0.25, 0.5, 0.0)
_TOLERANCE = 0.05
_AGREEING = 0.98
_NEAR = 20.0
_FEWEST = 2  # distinct readings: of two, the difference is the step
_TELLING = 0.1  # share of the differences that small multiples must be
_NEIGHBOURS = 25  # readings over which the speed is seen
_ALIKE = 0.21  # steps between readings whose errors are correlated


def quantum(values: FloatArray) -> float:
    """Give the step of an instrument whose readings are all multiples of one, in their unit; 0 where there is none.

    The differences between neighbouring distinct readings of a quantised signal are small multiples of the step. Their
    lower quantiles are tried as the step and refined on all of them; the step is believed if nearly all differences are
    within a twentieth of a multiple. NaN are skipped.
    """
    finite = values[np.isfinite(values)]
    distinct = np.unique(finite)
    if distinct.size < _FEWEST:
        return 0.0
    gaps = np.diff(distinct)
    # Conversions of units leave twins of one reading that differ in the last bits.
    gaps = gaps[gaps > 1e-9 * (distinct[-1] - distinct[0])]
    for share in _CANDIDATES:
        step = float(np.quantile(gaps, share, method="lower"))
        near = gaps[gaps < _NEAR * step]
        step = float(near.sum() / np.round(near / step).sum())
        multiple = gaps[gaps < _NEAR * step] / step
        told = multiple.size >= max(1.0, _TELLING * gaps.size)
        if told and np.mean(np.abs(multiple - np.round(multiple)) < _TOLERANCE) >= _AGREEING:
            return step
    return 0.0


def resolution(values: FloatArray) -> float:
    """Give the standard deviation of rounding, the smallest error that readings can have.

    It is the quantum over sqrt(12), or where there is none, the last bit's. NaN are skipped.
    """
    finite = values[np.isfinite(values)]
    bit = float(np.spacing(np.max(np.abs(finite), initial=np.finfo(float).tiny)))
    return max(quantum(values), bit) / float(np.sqrt(12.0))


def lasting_rounding(values: FloatArray, noise: float) -> float:
    """Give the part of a noise that errs alike in neighbouring readings: the rounding of a slow motion.

    Noise far larger than a step makes its rounding as random as itself, and so does a motion by a fifth of a step or
    more between readings. `noise` is the standard deviation of readings, that of rounding included, and so is what is
    returned, in their unit; 0 where there is no step. NaN are skipped.
    """
    step = quantum(values)
    rounding = step / float(np.sqrt(12.0))
    if not noise < 2.0 * rounding:
        return 0.0
    apart = np.abs(np.diff(values[np.isfinite(values)])) / step
    moved = uniform_filter1d(apart, _NEIGHBOURS)
    # Errors of a motion by this part of a step are correlated so: they are those of a saw tooth.
    shared = np.where(moved < _ALIKE, 1.0 - 6.0 * moved + 6.0 * moved**2, 0.0)
    return min(rounding, noise) * float(np.sqrt(shared.mean()))
