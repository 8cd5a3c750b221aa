"""The noise of readings: scatter from one to the next, and noise that a filter hides from neighbours."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from discovery.foundation.arrays import FloatArray
from discovery.foundation.sampling import are_uneven, gaps, median_step
from discovery.recordings.flags import OVERSTATED, UNDERSTATED, Flag
from discovery.recordings.local_fits import CALMER, FAR, KEPT, SLOWEST, excess_scatter, misses
from discovery.recordings.rounding import are_marks, quantum, resolution

#: Bands of a spectrum by octave, from half the sampling rate down, and lines that the smallest one holds.
_BY_OCTAVE, _LINES = 2, 16
#: Bands of which a plateau consists at least, the ratio of the largest amplitude in it to the smallest, and how far the
#: mean power of a band may exceed what its median says: lines of a motion exceed it.
_BANDS, _FLAT, _NOISY = 4, 1.5, 1.5
#: The plateau stands so far above the scatter and above the last tenth of the spectrum, in amplitude.
_ABOVE, _LAST = 2.0, 0.45
#: Of the standard deviation of the readings, more than which is no noise.
_SMALL = 0.3
#: Part of its power that the input may move.
_MOVED = 0.01
#: Stretches between which noise of one size differs by no more than this ratio, and its kurtosis (a Gaussian's is 3).
_STRETCHES, _STEADY, _KURTOSIS = 8, 2.0, 4.0
#: Noise larger than this many times that of rounding makes it as random as itself.
_ROUNDED = 2.0
#: Share of readings that may be missing.
_MISSING = 0.02
#: Of the largest weight of the window, where what a filter leaves is looked at.
_INSIDE = 0.3

_FEWEST_READINGS = 200  # readings, fewer scatter too little to contradict a statement
_OTHER = 1.5  # ratio of noises that differ
_COARSE = 0.3  # of the noise
#: Over the root of the number of readings: of white noise, once in a thousand times local fits scatter less by more.
_CHANCE = 4.0
_SETTLED = 0.9  # of an estimate is left by the next order of differences where it holds no signal
_SAME = 0.8  # part of the largest estimate that the smallest is where all hold noise alone
_STILL, _RESTING = 9, 0.1  # readings alike, as many as the highest differences take; share of all that moves a median


@dataclass(frozen=True)
class BandNoise:
    """Noise that is white up to a frequency only."""

    sd: float  # standard deviation of a reading, in its unit
    #: Neighbouring readings that tell as much as one of independent noise of that size: the variance of a mean over
    #: many readings is so many times that of independent ones.
    alike: float
    cutoff: float  # frequency up to which it is white [Hz]


def band_noise(
    time: FloatArray, values: FloatArray, scatter: float, given: FloatArray | None = None
) -> BandNoise | None:
    """Find noise that readings (n,) show at a distance, and hide from one to the next; None where there is none.

    The spectrum of white noise is flat to its end. That of noise which a filter has passed is flat above the lines of
    the motion and falls beyond the filter's cut-off. Such a plateau is taken for noise where it spans two octaves,
    stands above the scatter from one reading to the next, is small against the motion, has one size throughout the
    recording, is Gaussian, and lies where the input, if there is one, moves nothing. Impacts and friction are none:
    they come at times. Errors of rounding are left to `lasting_rounding`. Nothing is
    found at times [s] that are not steady.
    """
    if np.mean(np.isfinite(values)) < 1.0 - _MISSING or gaps(time).any() or not np.nanmax(values) > np.nanmin(values):
        return None
    read = filled(values)
    power = np.abs(spectrum(read)) ** 2
    edges = _edges(values.size)
    sizes = [_typical(power[lower:upper]) for upper, lower in pairwise(edges)]
    found = _plateau(power, edges, sizes)
    if found is None:
        return None
    first, last = found
    inside = slice(edges[last], edges[first])
    level = float(np.mean(power[inside]))
    above = sum(size * (upper - lower) for size, (upper, lower) in zip(sizes[:first], pairwise(edges), strict=False))
    variance = (level * edges[first] + above) / power.size
    noise = BandNoise(float(np.sqrt(variance)), level / variance, edges[first] / (values.size * median_step(time)))
    clear = level >= _ABOVE**2 * max(_typical(power[int(2 * _LAST * power.size) :]), scatter**2)
    sized = _ROUNDED * resolution(values) < noise.sd < _SMALL * float(np.std(read))
    still = _moved(given, inside) * float(np.var(read)) <= _MOVED * variance
    return noise if clear and sized and still and _is_noise(read, inside) else None


def _typical(power: FloatArray) -> float:
    """Return the mean of the powers of noise, whatever lines stand among them."""
    return float(np.median(power) / np.log(2.0))


def _edges(n: int) -> list[int]:
    """Return the lines between bands of n readings, from the last line down."""
    edges = [n // 2 + 1]
    while (lower := int(edges[0] * 2.0 ** (-len(edges) / _BY_OCTAVE))) <= edges[-1] - _LINES:
        edges.append(lower)
    return edges


def _plateau(power: FloatArray, edges: list[int], sizes: list[float]) -> tuple[int, int] | None:
    """Return the edges, upper and lower, between which most bands in a row are of one size and hold no line."""
    noisy = [
        power[lower:upper].mean() <= _NOISY * size for size, (upper, lower) in zip(sizes, pairwise(edges), strict=True)
    ]

    def flat(first: int, last: int) -> bool:
        # Nothing beyond it stands out of it.
        return all(noisy[first:last]) and max(sizes[:last]) <= _FLAT**2 * min(sizes[first:last])

    runs = [(i, j) for i in range(len(sizes)) for j in range(i + _BANDS, len(sizes) + 1) if flat(i, j)]
    return max(runs, key=lambda run: run[1] - run[0], default=None)


def _is_noise(values: FloatArray, inside: slice) -> bool:
    """Return whether what a band of lines holds has one size throughout, and the kurtosis of Gaussian noise."""
    lines, window = spectrum(values), np.hanning(values.size)
    kept = np.zeros_like(lines)
    kept[inside] = lines[inside]
    held = window > _INSIDE
    left = np.fft.irfft(kept, values.size)[held] / window[held]
    sizes = [float(np.std(part)) for part in np.array_split(left, _STRETCHES)]
    kurtosis = float(np.mean(left**4) / np.mean(left**2) ** 2)
    return max(sizes) <= _STEADY * min(sizes) and kurtosis <= _KURTOSIS


def _moved(given: FloatArray | None, inside: slice) -> float:
    """Return which share of the power of an input a band of lines holds."""
    if given is None or np.ptp(given) == 0.0:
        return 0.0
    power = np.abs(spectrum(given)) ** 2
    return float(power[inside].sum() / power.sum())


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


def estimate_noise(values: FloatArray, time: FloatArray | None = None) -> float:
    """Estimate the standard deviation of white noise on a signal that is smooth from sample to sample, in its unit.

    Differences of order 2 to 8 suppress the signal more and more, and each, divided by the root of the sum of its
    squared binomial coefficients, has the variance of the noise. Their median absolute deviation (times 1.4826,
    Gaussian) does not see steps and outliers; the smallest estimate is the one that holds least of the signal. Where
    steps are uneven, plain differences keep some of the slope: there divided ones are taken beside them. Both are,
    because a stamp may err where the samples were steady. Of marks, which count one by one, only divided ones tell:
    what was read is when they passed. Without times, samples are equally spaced; NaN are skipped.
    Differences amplify errors that alternate from one sample to the next. Local fits through more samples than they
    need do not: where these scatter less, beyond chance, errors do alternate, and theirs is the estimate.
    The estimate is 0 for a signal without noise, NaN with fewer than 18 samples. A body at rest tells nothing of the
    noise of its motion where that exceeds the step of the readings.
    """
    values = _without_rests(values)
    if time is None or not are_uneven(good := time[np.isfinite(values)]):
        return _calmed(values, min(_estimates(values), default=float("nan")))
    divided = _estimates_at(good, read := values[np.isfinite(values)])
    if are_marks(good, read):
        return min(divided, default=float("nan"))
    return _calmed(values, min(_estimates(values) + divided, default=float("nan")))


def _without_rests(values: FloatArray) -> FloatArray:
    """Return readings (n,) with NaN for those that stand still on one value, where the noise of the others moves them.

    Noise of less than a step leaves readings alike: those that are do belong to it. Few hardly move a median. It is
    noise where differences of all orders tell the same; of a short motion they hold the motion.
    """
    good = np.isfinite(values)
    read = values[good]
    first = np.flatnonzero(np.diff(read, prepend=np.nan) != 0.0)
    lengths = np.diff(first, append=read.size)
    still = np.repeat(lengths >= _STILL, lengths)
    moving = np.where(still, np.nan, read)
    estimates = _estimates(moving)
    step, least, most = quantum(read), min(estimates, default=0.0), max(estimates, default=0.0)
    # Where most readings stand still and no step is seen, they tell no noise at all; those that move bound it.
    mute = 2 * still.sum() > still.size and step == 0.0 < least
    if not mute and (still.sum() <= _RESTING * still.size or not step < least >= _SAME * most):
        return values
    found = values.copy()
    found[good] = moving
    return found


def _calmed(values: FloatArray, differences: float) -> float:
    """Return the estimate of local fits where it is below that of differences beyond chance, otherwise the latter."""
    good = values[np.isfinite(values)]
    below = (1.0 - _CHANCE / np.sqrt(max(good.size, 1))) * differences
    if not below > 0.0:
        return differences
    fits = [misses(good, *fit) for fit in CALMER + SLOWEST if good.size >= 2 * fit[1]]
    calm = min((_scatter(missed) for missed in fits), default=differences)
    return calm if calm < below else differences


def _scatter(values: FloatArray) -> float:
    """Return the standard deviation of values, some of which are wild: by their median deviation, or by their squares.

    The former is that of Gaussian ones, and too large for those that jump between two readings.
    """
    middle = np.abs(values - np.median(values))
    usual = float(1.4826 * np.median(middle))
    return min(usual, float(np.sqrt(np.mean(np.minimum(middle, FAR * usual) ** 2) / KEPT)))


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


def noise_flags(
    label: str,
    unit: str,
    time: FloatArray,
    values: FloatArray,
    stated: float,
    *,
    band: BandNoise | None = None,
    jitter: float = 0.0,
) -> list[Flag]:
    """Tell where the scatter of readings is not the noise that the rig file states.

    Nothing is said of few readings, of coarse ones unless the noise is stated as well above their step, nor where the
    scatter is larger but may be the signal's. `band` is noise that the scatter from sample to sample does not show;
    errors of time stamps by `jitter` [s] explain a part of it. NaN are gaps, and marks say nothing.
    """
    values = _without_rests(values)
    estimates = _estimates(values) if band is None else [band.sd]
    scatter = min(estimates, default=0.0)
    scatter = _calmed(values, scatter) if band is None else scatter
    good = np.isfinite(values)
    if good.sum() < _FEWEST_READINGS or np.ptp(values[good]) == 0.0 or are_marks(time[good], values[good]):
        return []
    rounding = resolution(values, time)
    if rounding > _COARSE * scatter and stated <= _OTHER * np.sqrt(12.0) * rounding:
        return []
    scatter = max(scatter, rounding)
    if stated / _OTHER <= scatter <= stated * _OTHER:
        return []
    if jitter > 0.0 and scatter > stated and not excess_scatter(time, values, stated, jitter) > _OTHER:
        return []
    even = not are_uneven(time[good])
    settled = band is not None or (even and estimates[-1] >= _SETTLED * estimates[-2])
    if scatter > stated and not settled:
        return []
    code = UNDERSTATED if scatter > stated else OVERSTATED
    return [Flag(code, label, unit, {"scatter": scatter, "stated": float(stated)})]
