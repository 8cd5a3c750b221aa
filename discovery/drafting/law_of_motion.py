"""Whether a motion is pulled back, and against what it is read, told before any model is chosen."""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid
from scipy.signal import lfilter, lombscargle

from discovery.declarations.units import si_symbol
from discovery.foundation.arrays import FloatArray
from discovery.foundation.sampling import median_step

#: Passages through the middle that are enough: over more of them, twice integrated noise outgrows the motion.
_PASSAGES = 40
#: Factor by which the squared error must fall with a spring in the law. Measured drives reach 1.6, what lies beside an
#: oscillator of a laboratory or a simulation with friction, drag or play 7 and more.
_GAIN = 4.0
#: Samples of half a window, at least: noise is averaged over them.
_SHORTEST = 8
#: Periods that a recording must hold: a slow drift looks like the begin of a slow swing.
_PERIODS = 3.0
#: Factor between the squared errors of the two readings, and share of the motion's square that the better one may
#: leave: a recording beyond these does not tell them apart.
_CLEAR, _LEFT = 3.0, 0.03
#: Ratio of the frequencies between which nine tenths of the base's motion lie: at one frequency, both readings fit.
_BROAD = 1.5
#: Share of the base's acceleration that a body may feel; it is 1 for a point mass.
_SHARE = (0.5, 2.0)
#: What a recording says, for people.
LOOKS = {
    True: "The recording looks relative, too.",
    False: "But the recording looks like a motion against the floor.",
    None: "The recording does not tell which it is.",
}
#: A line is sought from so many times shorter to as many times longer periods, at so many of them, from so many
#: readings.
_NEXT, _TRIED, _ENOUGH = 1.4, 400, 600
#: The least loss that is sought, over a recording, how many are tried up to one a reading,
_LEAST_LOSS, _LOSSES, _FEWEST = 0.1, 60, 10  # and how few readings tell none


def own_period(time: FloatArray, output: FloatArray, given: FloatArray | None) -> float | None:
    """Return the period with which a system swings about its rest, None where nothing pulls it back.

    The law q'' = -d q' - k q + b u + c + e t is fitted in its weak form, once with a spring and once without: weighted
    by smooth functions that are zero outside a short window, every derivative moves over to them by parts, so that none
    of a noisy reading is needed (Shinbrot, Transactions of the ASME 79 (1957) 447; Messenger and Bortz, Multiscale
    Modeling and Simulation 19 (2021) 1474). The place of rest may creep, by e, where the motion passes through its
    middle often enough to be told from a creep.

    `time`, `output` (n,): times [s] and motion; NaN marks gaps. `given` (n,): the input, if there is one.

    Examples
    --------
    >>> t = np.linspace(0, 20, 2001)
    >>> period = own_period(t, np.exp(-0.1 * t) * np.cos(2 * np.pi * t), None)
    >>> round(period, 2)
    1.0
    """
    good = telling_part(output)
    if good.size < 50 or (step := median_step(time[good])) <= 0.0:
        return None
    grid = np.arange(time[good[0]], time[good[-1]] + 0.5 * step, step)
    y = np.interp(grid, time[good], output[good] - np.mean(output[good]))
    side = y > np.median(y)
    passages = int(np.count_nonzero(side[1:] != side[:-1]))
    # Half a window is half the time between every other passage through the middle.
    half = max(2, min(max(_SHORTEST, y.size // max(1, passages)), (y.size - 1) // 6))
    s = np.linspace(-1.0, 1.0, 2 * half + 1)
    weight = np.polynomial.Polynomial([1.0, 0.0, -1.0]) ** 4
    # Integrals over a window of y'', -y', 1, t, u and -y.
    pulled = _windows(y, weight.deriv(2)(s) / (half * step) ** 2, half)
    columns = [_windows(y, weight.deriv(1)(s) / (half * step), half), np.ones_like(pulled)]
    if passages >= 2.0 * _PERIODS:
        columns.append(np.linspace(-1.0, 1.0, pulled.size))
    if given is not None:
        columns.append(_windows(np.interp(grid, time[good], given[good]), weight(s), half))
    without = least_squares(np.column_stack(columns), pulled)[0]
    left, weights = least_squares(np.column_stack([*columns, _windows(y, weight(s), half)]), pulled)
    if weights[-1] >= 0.0 or without < _GAIN * left:
        return None
    period = float(2.0 * np.pi / np.sqrt(-weights[-1]))
    if given is None:
        period = _strongest(time[good], output[good], period)
    return period if _PERIODS * period < grid[-1] - grid[0] else None


def _strongest(time: FloatArray, output: FloatArray, period: float) -> float:
    """Return the period of the strongest line of a motion next to a rough one, at any times; that one if it has none.

    Readings that are few a swing, or late, hide what pulls, but not how often it swings.
    """
    some = slice(None, None, max(1, time.size // _ENOUGH))
    rates = 2.0 * np.pi / (period * np.linspace(1.0 / _NEXT, _NEXT, _TRIED))
    strongest = int(np.argmax(lombscargle(time[some], output[some] - output[some].mean(), rates)))
    return float(2.0 * np.pi / rates[strongest]) if 0 < strongest < _TRIED - 1 else period


def _windows(values: FloatArray, weight: FloatArray, half: int) -> FloatArray:
    """Return the weighted sums over windows that begin a quarter of their half apart."""
    return np.convolve(values, weight[::-1], "valid")[:: max(1, half // 4)]


def rates_of(
    time: FloatArray, output: FloatArray, given: FloatArray | None, *, speed: bool = False, spring: bool = False
) -> tuple[float, float]:
    """Return d [1/s] and b of q'' = -d q' - k q + b u: a place for a fit to begin.

    `time`, `output` (n,): times [s] and q, or q' where a `speed` is read; NaN marks gaps. `given` (n,): the input u;
    without one, b is 0. `speed`, `spring`: whether the output is a speed, and whether something pulls back.

    Examples
    --------
    >>> t = np.linspace(0, 5, 1001)
    >>> d, b = rates_of(t, 3.0 * (1.0 - np.exp(-2.0 * t)), np.ones_like(t), speed=True)
    >>> round(d, 2), round(b, 2)
    (2.0, 6.0)
    """
    good = telling_part(output)
    t, y = time[good] - time[good[0]], output[good]
    integral = partial(cumulative_trapezoid, x=t, initial=0)
    u = integral(np.zeros_like(t) if given is None else given[good])
    columns = [integral(y), u if speed else integral(u), np.ones_like(t)]
    # Friction and limits of an input that changes are as a constant force; of one that does not they are its gain.
    if not speed:
        columns += [t, t**2]
    elif given is not None and np.ptp(given[good]) > 0.0:
        columns += [t]
    columns += [integral(integral(y))] if spring else []
    weights = least_squares(np.column_stack(columns), y)[1]
    if weights[0] < 0.0 or given is None or spring:
        return float(-weights[0]), float(weights[1])
    return _lossy_rates(t, y, given[good], speed=speed)


def _lossy_rates(time: FloatArray, output: FloatArray, given: FloatArray, *, speed: bool) -> tuple[float, float]:
    """Return d and b of the motion with a loss that comes nearest to what was read; see `rates_of`.

    An input that a controller chose follows what was read, and least squares of the law itself then find it driving
    itself. The motion that such a law predicts does not.
    """
    back = np.flatnonzero(np.diff(time) <= 0.0)  # where another trial begins
    time = time[: int(back[0]) + 1 if back.size else time.size]
    if time.size < _FEWEST:
        return 0.0, 0.0
    output, given, grid = output[: time.size], given[: time.size], np.linspace(0.0, time[-1], time.size)
    y, u, step = np.interp(grid, time, output), np.interp(grid, time, given), grid[1]
    best = (np.inf, 0.0, 0.0)
    for d in np.geomspace(_LEAST_LOSS / time[-1], 1.0 / step, _LOSSES):
        kept = np.exp(-d * step)
        driven, coasting = lfilter(np.full(2, (1.0 - kept) / (2.0 * d)), [1.0, -kept], u), np.exp(-d * grid)
        if not speed:
            driven, coasting = (cumulative_trapezoid(x, grid, initial=0) for x in (driven, coasting))
        left, weights = least_squares(np.column_stack([driven, coasting, *([] if speed else [np.ones_like(grid)])]), y)
        best = min(best, (left, float(d), float(weights[0])))
    return best[1:]


def telling_part(output: FloatArray) -> NDArray[np.intp]:
    """Return the readings around the largest one, with no more passages through the middle than are needed."""
    good = np.flatnonzero(np.isfinite(output))
    side = output[good] > np.median(output[good])
    passages = np.flatnonzero(side[1:] != side[:-1])
    if passages.size <= _PASSAGES:
        return good
    largest = int(np.argmax(np.abs(output[good] - np.median(output[good]))))
    first = min(max(0, int(np.searchsorted(passages, largest)) - _PASSAGES // 2), passages.size - _PASSAGES)
    return good[passages[first] : passages[first + _PASSAGES - 1]]


def acceleration_of(time: FloatArray, output: FloatArray) -> tuple[float, float]:
    """Return the acceleration of the parabola next to a motion, and what that leaves over how far the motion goes.

    `time`, `output` (n,): times [s] and places; NaN marks gaps.

    Examples
    --------
    >>> t = np.linspace(0, 1, 50)
    >>> fall, left = acceleration_of(t, 2.0 + t - 4.9 * t**2)
    >>> round(fall, 6), left < 1e-9
    (-9.8, True)
    """
    good = np.isfinite(output)
    t, y = time[good] - time[good][0], output[good]
    weights = np.polynomial.polynomial.polyfit(t, y, 2)
    left = y - np.polynomial.polynomial.polyval(t, weights)
    return 2.0 * float(weights[2]), float(np.std(left) / max(np.ptp(y), np.finfo(float).tiny))


def least_squares(columns: FloatArray, y: FloatArray) -> tuple[float, FloatArray]:
    """Return the sum of squares that least squares leave, and the weight of each column."""
    size = np.linalg.norm(columns, axis=0)
    size[size == 0.0] = 1.0
    weights = np.linalg.lstsq(columns / size, y, rcond=None)[0]
    return float(np.sum((y - (columns / size) @ weights) ** 2)), weights / size


def is_one_line(base: str, output: str) -> bool:
    """Whether a base and what is above it move along one line or about one axis, as their units tell."""
    return si_symbol(base) == si_symbol(output) in ("m", "rad")


def is_relative(time: FloatArray, output: FloatArray, base: FloatArray) -> bool | None:
    """Return whether an output is relative to the base, None where the recording does not tell.

    On a spring and a damper, the way z of a mass from its base obeys z'' = -d z' - k z - p u''. Integrated twice, this
    is fitted with z as the output itself and with z as the output less the base. Far below the own frequency the one
    says that the output stays near 0, the other that it follows the base.

    `time`, `output`, `base` (n,): times [s] and both motions in one unit; NaN marks gaps.

    Examples
    --------
    >>> t = np.linspace(0, 20, 2001)
    >>> slow, fast = np.sin(t), np.sin(3 * t)  # below the own frequency of 4 rad/s
    >>> base, above = slow + fast, slow / 15 + fast * 9 / 7
    >>> is_relative(t, base + above, base), is_relative(t, above, base)
    (False, True)
    """
    good = telling_part(output)
    if good.size < 50 or not _is_broad(base[good]):
        return None
    t, y, u = time[good] - time[good[0]], output[good], base[good]
    relative, absolute = _error(t, y, u), _error(t, y - u, u)
    better, worse = sorted((relative, absolute))
    if worse < _CLEAR * better or better > _LEFT * float(np.sum((y - y.mean()) ** 2)):
        return None
    return relative < absolute


def _error(t: FloatArray, z: FloatArray, u: FloatArray) -> float:
    """Return the squared error of the law; infinite where its spring would push."""
    integral, scale = partial(cumulative_trapezoid, x=t, initial=0), float(t[-1])
    once = integral(z)
    twice = integral(once)
    columns = [np.ones_like(t), t / scale, (t / scale) ** 2, once, twice]
    squares, weights = least_squares(np.column_stack([*columns, u]), z)
    share = float(np.clip(-weights[-1], *_SHARE))
    if share != -weights[-1]:
        squares, weights = least_squares(np.column_stack(columns), z + share * u)
    return squares if weights[4] < 0.0 else np.inf


def _is_broad(u: FloatArray) -> bool:
    power = np.cumsum(np.abs(np.fft.rfft(u - u.mean())) ** 2)
    low, high = np.searchsorted(power, [0.05 * power[-1], 0.95 * power[-1]])
    return bool(power[-1] > 0.0 and high > _BROAD * low + 2)  # a sine leaks into its neighbours
