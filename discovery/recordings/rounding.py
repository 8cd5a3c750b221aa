"""Rounding of readings: the step of an instrument, and the errors that it makes."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import uniform_filter1d

from discovery.foundation.arrays import FloatArray
from discovery.foundation.sampling import are_uneven
from discovery.recordings.running_on import goes_back

_CANDIDATES = (0.05, 0.25, 0.5, 0.0)
_DIVISORS, _DIVIDED = (2, 3), 12  # parts of the smallest difference that may be the step, of so many differences
_TOLERANCE = 0.05
_AGREEING = 0.98
_NEAR_GAPS = 20.0
_DISTINCT = 2  # distinct readings: of two, the difference is the step
_TELLING = 0.1  # share of the differences that small multiples must be
_NEIGHBOURS = 25  # readings over which the speed is seen
_SHARED_STEPS = 0.21  # steps between readings whose errors are correlated
_LEVELS, _VISITS, _PRINTED = 6, 4, 6.0  # gaps, readings a gap, and finer steps in a step that was rounded once more
_OFF = 0.75  # finer steps by which such a reading lies off its step
_ALIKE, _SIZES = 1e-6, 3  # steps by which sizes are told apart, and how many those that are printed have
_MARKS = 8  # steps that tell marks from readings at a rate


def quantum(values: FloatArray, time: FloatArray | None = None) -> float:
    """Give the step to which an instrument rounds its readings, in their unit; 0 where it does not.

    Those that follow each other by one step each, at uneven times (n,), are not rounded: they were stamped when a mark
    passed, as before a light barrier, and are as good as the mark.

    The differences between neighbouring distinct readings of a quantised signal are small multiples of the step. Their
    lower quantiles are tried as the step and refined on all of them; the step is believed if nearly all differences are
    within a twentieth of a multiple. NaN are skipped.
    """
    good = np.isfinite(values)
    finite = values[good]
    distinct = np.unique(finite)
    if distinct.size < _DISTINCT or (time is not None and are_marks(time[good], finite)):
        return 0.0
    gaps = np.diff(distinct)
    # Conversions of units leave twins of one reading that differ in the last bits.
    gaps = gaps[gaps > 1e-9 * (distinct[-1] - distinct[0])]
    least = float(gaps.min())
    # Of few readings of a fast motion none may follow another by one step.
    again = distinct.size < finite.size
    parts = [least / k for k in _DIVISORS if again and np.sum(gaps < _NEAR_GAPS * least / k) >= _DIVIDED]
    for step in (*(float(np.quantile(gaps, share, method="lower")) for share in _CANDIDATES), *parts):
        near = gaps[gaps < _NEAR_GAPS * step]
        step = float(near.sum() / np.round(near / step).sum())
        multiple = gaps[gaps < _NEAR_GAPS * step] / step
        told = multiple.size >= max(1.0, _TELLING * gaps.size)
        apart = max(_TOLERANCE, _printed(finite, gaps, step) / step)
        whole = np.round(multiple)
        # What moves on by about as much each time, as a ramp, is never read twice, and its gaps are of many sizes.
        once = distinct.size == finite.size and whole.max() <= 1.0
        ramp = once and np.unique(np.round(near / (_ALIKE * step))).size > _SIZES
        if told and not ramp and np.mean(np.abs(multiple - whole) <= apart) >= _AGREEING:
            return step
    return 0.0


def _printed(values: FloatArray, gaps: FloatArray, step: float) -> float:
    """Give the finer step to which readings in steps were rounded once more, as counts printed in whole rpm; 0 without.

    Then steps are of two sizes that differ by it, and readings come again, or all lie on one line over the number of
    their step. Those of a ramp do that by themselves.
    """
    apart = np.diff(np.sort(gaps))
    finer = float(np.min(apart[apart > 1e-6 * step], initial=np.inf))
    if gaps.size < _LEVELS or step < _PRINTED * finer:
        return 0.0
    if values.size < _VISITS * gaps.size:
        number, read = np.cumsum(np.round(gaps / step)), np.cumsum(gaps)
        off = np.abs(read - np.polyval(np.polyfit(number, read, 1), number))
        if not goes_back(values) or np.mean(off <= _OFF * finer) < _AGREEING:
            return 0.0
    multiple = gaps / finer
    return finer if np.all(np.abs(multiple - np.round(multiple)) < _TOLERANCE) else 0.0


def are_marks(time: FloatArray, values: FloatArray) -> bool:
    """Return whether readings (n,) come one by one where a mark passes, as at a light barrier: times [s] are read.

    What turns between two marks passes the last one twice.
    """
    moved = np.diff(values)
    back = np.zeros(moved.size, dtype=bool)
    back[1:-1] = (moved[1:-1] == 0.0) & (moved[:-2] * moved[2:] < 0.0)
    steps = np.abs(moved[~back])
    if steps.size < _MARKS or not are_uneven(time):
        return False
    return bool(np.mean(np.abs(steps - np.median(steps)) < _TOLERANCE * np.median(steps)) >= _AGREEING)


def resolution(values: FloatArray, time: FloatArray | None = None) -> float:
    """Give the standard deviation of rounding, the smallest error that readings can have.

    It is the `quantum` over sqrt(12), or where there is none, the last bit's. NaN are skipped.
    """
    finite = values[np.isfinite(values)]
    bit = float(np.spacing(np.max(np.abs(finite), initial=np.finfo(float).tiny)))
    return max(quantum(values, time), bit) / float(np.sqrt(12.0))


def lasting_rounding(values: FloatArray, noise: float, step: float) -> float:
    """Give the part of a noise that errs alike in neighbouring readings: the rounding of a slow motion.

    Noise far larger than a step makes its rounding as random as itself, and so does a motion by a fifth of a step or
    more between readings. `noise` is the standard deviation of readings, that of rounding to `step` included, and so
    is what is returned, in their unit; 0 where there is no step. NaN are skipped.
    """
    rounding = step / float(np.sqrt(12.0))
    if not noise < 2.0 * rounding:
        return 0.0
    apart = np.abs(np.diff(values[np.isfinite(values)])) / step
    moved = uniform_filter1d(apart, _NEIGHBOURS)
    # Errors of a motion by this part of a step are correlated so: they are those of a saw tooth.
    shared = np.where(moved < _SHARED_STEPS, 1.0 - 6.0 * moved + 6.0 * moved**2, 0.0)
    return min(rounding, noise) * float(np.sqrt(shared.mean()))
