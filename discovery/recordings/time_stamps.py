"""Errors of time stamps: taken earlier or later than they say, or rounded, which a steady clock explains."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linprog

from discovery.declarations.units import si_factor
from discovery.foundation.arrays import FloatArray, IntArray
from discovery.foundation.sampling import gaps, median_step
from discovery.recordings.file_signals import Signals
from discovery.recordings.flags import Flag
from discovery.rigs.rig import Rig

_FEWEST = 200  # readings, fewer scatter too little to tell their noise from that of their stamps
_SURE = 4.0  # standard deviations
_ROUNDED = 2e-3  # of the median step
_SHARE = 1 / 3  # of the readings are compared, the slowest with the fastest ones

_FEWEST_STAMPS = 20  # stamps that all lie on a clock by chance are fewer
_SOME = 10  # stamps that tell how many decimals those of their size have
_MOST_DECIMALS = 9
_EXACT = 1e-6  # of a step, by which numbers miss their last decimal in binary
_OVER = 1e-4  # of the rounding, by which a stamp between two decimals may go either way
_SEEN = 2e-3  # of a step: stamps that are off by less move no reading
_SHORTER = 0.95  # of the rounding, the longest step whose stamps repeat often: one that repeats alone is wrong
_ROUGHER = 1.1  # times the scatter on the stamps, beyond which readings were not taken on the clock


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


def is_steady(time: FloatArray) -> bool:
    """Return whether stamps lie on a steady clock: rounded ones deviate by far less than is seen in any reading."""
    return stamp_deviation(time) < _ROUNDED * median_step(time)


def estimate_jitter(time: FloatArray, channel: FloatArray, noise: float) -> float:
    """Estimate by how much stamps err [s], from how much more readings (n,) scatter where they move fast.

    Stamps that deviate from a steady clock may be right, for then the samples were not steady, or err. They err where
    a reading lies off the cubic through its neighbours by more in the fastest third of a recording than in the
    slowest, beyond chance; they err by no more than they deviate. The estimate is zero for those that do not seem to
    err, and for steady stamps: see `discovery.recordings.local_fits`.
    """
    if is_steady(time):
        return 0.0
    most = stamp_deviation(time)
    return min(most, _of_channel(time, channel, noise))


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


@dataclass(frozen=True)
class SteadyClock:
    """Times (n,) of a steady clock, its step, and the rounding of the coarsest stamp, in the stamps' unit."""

    time: FloatArray
    step: float
    rounding: float


def on_its_clock(rig: Rig, found: Signals) -> list[Flag]:
    """Take the times of the clock that explains rounded stamps, also where they repeat, and tell it.

    Where the rig states how stamps err, they stay as they are.
    """
    if rig.columns.time.jitter is not None or "time" not in found.names:
        return []
    # As the file has them, for their decimals.
    second, zero = rig.columns.time.scale * si_factor(found.units["time"]), rig.columns.time.zero
    channels = [*found.outputs.values()] + ([] if found.inputs is None else [found.inputs])
    clock = steady_clock((found.time + zero) / second, channels)
    if clock is None:
        return []
    found.time = clock.time * second - zero
    return [Flag("times_rounded", numbers={"rounding": clock.rounding * second, "rate": 1.0 / (clock.step * second)})]


def steady_clock(stamps: FloatArray, channels: Sequence[FloatArray] = ()) -> SteadyClock | None:
    """Return the steady clock whose times, rounded as the stamps are, are the stamps.

    None where no clock does, where stamps are off by too little to matter, where every one lies halfway between two of
    its decimals, and where readings that move are rougher on it; also where stamps are missing or go back, and where a
    row stands twice.

    `stamps` (n,): as the file has them. All may have as many decimals, or as many digits; those of steps that are
    shorter than the rounding repeat. `channels` (n,) each: readings; NaN are gaps. They are as smooth on the clock as
    on the stamps if they were taken on it.

    Examples
    --------
    >>> film = np.round(np.arange(60) / 29.97, 2)
    >>> clock = steady_clock(film)
    >>> round(1 / clock.step, 1), clock.rounding
    (29.9, 0.01)
    """
    steps = np.diff(stamps)
    if stamps.size < _FEWEST_STAMPS or not (steps >= 0.0).all() or not 0.0 < np.ptp(stamps) < np.inf:
        return None
    again = np.flatnonzero(steps == 0.0)
    if again.size and _stand_twice(again, channels):
        return None
    typical = float(np.median(steps[steps > 0.0]))  # most may be none
    # How many steps of the clock each reading is from the first: where stamps repeat, none was lost.
    each = np.ones_like(steps) if again.size else np.round(steps / typical)
    most, count = 0.5 * _resolutions(stamps, typical), np.concatenate([[0.0], np.cumsum(each)])
    line = np.polynomial.Polynomial.fit(count, stamps, 1, w=1.0 / most)
    off = np.abs(stamps - line(count))
    # No line lies much nearer than the one of least squares, which is cheap.
    if (off > 2.0 * most).any() or off.max() < _SEEN * typical:
        return None
    found = _nearest(count, stamps, most)
    if found is None or (again.size and found[1] > _SHORTER * 2.0 * most[again].min()):
        return None
    time, step = found
    if (np.abs(stamps - time) > (1.0 - _OVER) * most.min()).all():
        return None  # between two decimals each, so that any of even stamps may be off by one
    # Where stamps repeat, no reading can be told from its neighbour by them.
    rougher = not again.size and _rougher(stamps, time, channels)
    return None if rougher else SteadyClock(time, step, 2.0 * float(most.max()))


def _stand_twice(again: IntArray, channels: Sequence[FloatArray]) -> bool:
    """Return whether most rows whose stamp repeats hold the same readings twice."""
    if not channels:
        return True
    same = np.all([np.equal(c[again], c[again + 1]) for c in channels], axis=0)
    return bool(2 * same.sum() > same.size)


def _resolutions(stamps: FloatArray, step: float) -> FloatArray:
    """Return the value of the last decimal of each stamp, where those of a size have as many, a typical step apart."""
    decade = np.floor(np.log10(np.maximum(np.abs(stamps), 10.0**-_MOST_DECIMALS)))
    decimals = np.empty(stamps.size)
    below, least = np.inf, -_MOST_DECIMALS
    for size in np.unique(decade)[::-1]:
        here = (decade >= size) & (decade < below)
        if here.sum() < _SOME and size > decade.min():
            continue  # so few may end in zeros
        # Larger numbers never have more decimals.
        least = next((d for d in range(least, _MOST_DECIMALS) if _ends(stamps[here], d, step)), _MOST_DECIMALS)
        decimals[here], below = least, size
    return np.asarray(10.0**-decimals, np.float64)


def _ends(values: FloatArray, decimals: int, step: float) -> bool:
    return bool((np.abs(values - np.round(values * 10.0**decimals) / 10.0**decimals) < _EXACT * step).all())


def _nearest(count: FloatArray, stamps: FloatArray, most: FloatArray) -> tuple[FloatArray, float] | None:
    """Return times and step of the clock that lies nearest to all stamps; None where that is beyond their rounding."""
    rows = np.column_stack([np.ones_like(count), count, -most])
    rows = np.concatenate([rows, rows * [-1.0, -1.0, 1.0]])
    bounds = [(None, None), (0.0, None), (0.0, None)]
    line = linprog([0.0, 0.0, 1.0], A_ub=rows, b_ub=np.concatenate([stamps, -stamps]), bounds=bounds)
    if line.x is None or line.x[2] > 1.0 + _OVER:
        return None
    start, step = float(line.x[0]), float(line.x[1])
    return start + step * count, step


def _rougher(stamps: FloatArray, time: FloatArray, channels: Sequence[FloatArray]) -> bool:
    """Return whether a channel misses the cubics through its neighbours by more on the clock than on the stamps.

    A reading counts by how much its miss depends on the choice: those of a body at rest say nothing of it. So many
    count alike at the most that what is beside a wild reading or a jump does not decide.
    """
    for channel in channels:
        good = np.isfinite(channel)
        if good.sum() < _FEWEST_STAMPS:
            continue
        there, here = (left_by_cubics(t[good], channel[good])[0] for t in (stamps, time))
        weights = np.abs(here - there)
        weights[weights < _EXACT * np.ptp(channel[good])] = 0.0
        weights = np.minimum(weights, np.sort(weights)[-min(_FEWEST_STAMPS, weights.size)])
        if _middle(np.abs(here), weights) > _ROUGHER * _middle(np.abs(there), weights):
            return True
    return False


def _middle(values: FloatArray, weights: FloatArray) -> float:
    """Return the weighted median of values."""
    order = np.argsort(values)
    share = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(share, 0.5 * share[-1])])
