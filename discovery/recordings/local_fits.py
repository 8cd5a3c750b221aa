"""Polynomials through the neighbours of a reading: by how much it misses them, how fast the motion is there.

Readings that were taken at other times than steady stamps say miss them the more, the faster they move.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from discovery.foundation.arrays import FloatArray
from discovery.foundation.sampling import gaps, median_step

#: Degree and readings. Those of two readings more than the degree are differences, which suppress a motion the most;
#: those of more readings do not amplify errors that alternate from one reading to the next.
_DIFFERENCES = ((3, 5), (5, 7), (7, 9))
CALMER = ((3, 9), (5, 13), (5, 17), (7, 17))
SLOWEST = ((1, 9), (1, 17), (3, 17))  # where hardly anything moves
_LONGEST = 17  # readings
#: A miss beyond so many standard deviations counts as one of as many, which keeps this of Gaussian variance.
FAR, KEPT = 3.0, 0.9733
_SLOPE = (5, 13)

_FEWEST = 200  # readings, fewer scatter too little to tell their noise from errors of timing
_SURE = 4.0  # standard deviations
_ALIKE = 1.5  # ratio of noises that differ
_ROUNDS = 50
_TINY = 1e-6  # of the variance, which any reading has


def misses(values: FloatArray, degree: int, readings: int) -> FloatArray:
    """Return by how much each of n values misses a polynomial through it and its neighbours, (n - readings + 1,).

    Values are equally spaced. A miss has the standard deviation of one reading's white noise, in their unit. NaN are
    gaps, and so is what is near one.
    """
    return np.convolve(values, _miss_weights(degree, readings), "valid")


@lru_cache
def _miss_weights(degree: int, readings: int) -> FloatArray:
    """Return the weights of readings in the miss of the one in their middle, (readings,); their squares sum to one."""
    # Orthonormal polynomials at equally spaced readings, (readings, degree + 1).
    basis = np.linalg.qr(np.polynomial.legendre.legvander(np.linspace(-1.0, 1.0, readings), degree))[0]
    weights = -basis[readings // 2] @ basis.T
    weights[readings // 2] += 1.0
    return np.asarray(weights / np.linalg.norm(weights))


def _slopes(values: FloatArray, step: float) -> FloatArray:
    """Return how fast n equally spaced values move at each of them, (n,), in their unit over that of the step.

    They are those of polynomials through so many neighbours that white noise moves them little, and NaN at the ends
    and near gaps.
    """
    degree, readings = _SLOPE
    at = np.arange(readings) - readings // 2
    weights = np.linalg.pinv(np.vander(at.astype(np.float64), degree + 1, increasing=True))[1]
    found = np.full(values.shape, np.nan)
    found[readings // 2 : values.size - readings // 2] = np.convolve(values, weights[::-1], "valid") / step
    return found


@dataclass(frozen=True)
class TimingError:
    """Errors of the times at which the readings of one channel were taken."""

    sd: float  # standard deviation of these times [s]
    noise: float  # standard deviation of a reading that does not move, in its unit; the most, where it is not sure


@dataclass(frozen=True)
class _Variance:
    """Variance of misses, ``still + timing * speed^2``, with standard deviations, as one kind of local fit shows it."""

    still: float
    still_sd: float
    timing: float
    timing_sd: float


def timing_error(time: FloatArray, channel: FloatArray, least: float) -> TimingError | None:
    """Find errors in the times of readings (n,) at steady stamps (n,) [s]; None where there are none.

    `least` is what readings err by at rest, at the least: their rounding, or the noise that is stated.

    A reading that was taken at another time misses its neighbours by slope times that. So does one of a motion that is
    sampled too coarsely to be followed, or by an encoder that rounds. Errors of timing are told from both: polynomials
    of any degree and length find the same size, misses grow as the speed does throughout, and where the motion is
    fast they are more than all else, of most readings. Times that erred by more than a step would not be in order.
    """
    if np.isfinite(channel).sum() < _FEWEST:
        return None
    laws: list[tuple[_Variance, float]] = []
    for missed, speed in _missed(time, channel):
        law = _law(missed, speed, least)
        if law is None:
            return None
        laws.append(law)
    sizes = [law.timing for law, _ in laws]
    if max(sizes) > _ALIKE**2 * min(sizes) or min(sizes) > median_step(time) ** 2:
        return None
    # That which holds least of the motion, and amplifies least what alternates.
    best, _ = min(laws, key=lambda law: law[1])
    still = float(np.median([max(law.still, law.still_sd) for law, _ in laws]))
    return TimingError(float(np.sqrt(best.timing)), float(np.sqrt(max(still, least**2))))


def excess_scatter(time: FloatArray, channel: FloatArray, noise: float, jitter: float) -> float:
    """Return how many times as far readings (n,) scatter as their noise and the jitter of steady stamps [s] explain.

    It is the smallest of all local fits; NaN with too few readings.
    """
    found = [
        _spread(missed / np.sqrt(noise**2 + jitter**2 * speed))
        for missed, speed in _missed(time, channel)
        if missed.size >= _FEWEST // 2
    ]
    return min(found, default=float("nan"))


def alternation(values: FloatArray) -> float:
    """Return how many times as far readings (n,) miss a cubic through few neighbours as polynomials through more.

    It is one for white noise, more for errors that alternate from one reading to the next, less for a motion, and of
    too few readings. NaN are gaps.
    """
    if np.isfinite(values).sum() < _FEWEST:
        return 0.0
    missed = [misses(values, *fit) for fit in (_DIFFERENCES[0], *CALMER)]
    shortest, *longer = (_spread(m[np.isfinite(m)]) if np.isfinite(m).any() else 0.0 for m in missed)
    return shortest / max(longer) if min(longer) > 0.0 else 0.0


def _missed(time: FloatArray, channel: FloatArray) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Yield by how much readings miss each local fit, (m,), and the mean squared speed that counts in each miss, (m,).

    No fit reaches across missing samples.
    """
    values = np.insert(channel, np.repeat(np.flatnonzero(gaps(time)) + 1, _LONGEST), np.nan)
    squares = _slopes(values, median_step(time)) ** 2
    for fit in _DIFFERENCES + CALMER:
        missed = misses(values, *fit)
        speed = np.convolve(squares, _miss_weights(*fit) ** 2, "valid")
        good = np.isfinite(missed) & np.isfinite(speed)
        yield missed[good], speed[good]


def _law(missed: FloatArray, speed: FloatArray, least: float) -> tuple[_Variance, float] | None:
    """Return what misses say of noise and timing, and their rms; None where they are not as errors of timing make them.

    They are not, either, where they are few, most are none, or the speed is one.
    """
    spread = _spread(missed) if missed.size >= _FEWEST // 2 else 0.0
    if spread == 0.0 or not np.ptp(speed) > _TINY * np.median(speed) > 0.0:
        return None
    found = _fitted(missed, speed, max(least**2, _TINY * spread**2))
    standard = np.clip(missed / np.sqrt(found.still + found.timing * speed), -FAR, FAR)
    by_speed = np.array_split(np.argsort(speed), 3)
    thirds = [standard[part] for part in by_speed]
    sizes = [float(np.sqrt(np.mean(third**2))) for third in thirds]
    timely = (
        found.timing > _SURE * found.timing_sd
        and max(sizes) < _ALIKE * min(sizes)
        and found.timing * float(np.median(speed[by_speed[-1]])) > found.still
        # A clock that was late a few times says nothing of all other readings.
        and sizes[-1] < _ALIKE * _spread(thirds[-1])
    )
    return (found, float(np.sqrt(np.minimum(missed**2, (FAR * spread) ** 2).mean()))) if timely else None


def _fitted(missed: FloatArray, speed: FloatArray, floor: float) -> _Variance:
    """Fit the variance of misses by least squares of their squares, weighted by the variances found, again and again.

    That of readings at rest is no smaller than `floor`.
    """
    scale, still = float(np.median(speed)), max(0.5 * _spread(missed) ** 2, floor)
    x, timing = speed / scale, 0.5 * _spread(missed) ** 2
    before = None
    for _ in range(_ROUNDS):
        # The next round would be this one again.
        if (still, timing) == before:
            break
        before, variance = (still, timing), still + timing * x
        squares, w = np.minimum(missed**2, FAR**2 * variance) / KEPT, variance**-2.0
        one, by, twice = float(w.sum()), float(w @ x), float(w @ x**2)
        sums, by_sums = float(w @ squares), float((w * x) @ squares)
        timing = max((one * by_sums - by * sums) / (one * twice - by**2), 0.0)
        still = (sums - timing * by) / one
        if still < floor:
            still, timing = floor, max((by_sums - floor * by) / twice, 0.0)
    sds = (float(np.sqrt(2.0 / (a - by**2 / b))) for a, b in ((one, twice), (twice, one)))
    return _Variance(still, next(sds), timing / scale, next(sds) / scale)


def _spread(values: FloatArray) -> float:
    """Return the standard deviation of Gaussian values about zero, some of which are wild."""
    return 1.4826 * float(np.median(np.abs(values)))
