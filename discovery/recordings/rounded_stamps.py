"""Time stamps that a file rounds: the steady clock that explains all of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.optimize import linprog

from discovery.declarations.units import si_factor
from discovery.foundation.arrays import FloatArray
from discovery.foundation.sampling import median_step
from discovery.recordings.file_signals import Signals
from discovery.recordings.flags import Flag
from discovery.recordings.time_jitter import left_by_cubics
from discovery.rigs.rig import Rig

IntArray = npt.NDArray[np.intp]

_FEWEST = 20  # stamps that all lie on a clock by chance are fewer
_SOME = 10  # stamps that tell how many decimals those of their size have
_MOST_DECIMALS = 9
_EXACT = 1e-6  # of a step, by which numbers miss their last decimal in binary
_OVER = 1e-4  # of the rounding, by which a stamp between two decimals may go either way
_SEEN = 2e-3  # of a step: stamps that are off by less move no reading
_SHORTER = 0.95  # of the rounding, the longest step whose stamps repeat often: one that repeats alone is wrong
_ROUGHER = 1.1  # times the scatter on the stamps, beyond which readings were not taken on the clock


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
    second = si_factor(found.units["time"])
    channels = [*found.outputs.values()] + ([] if found.inputs is None else [found.inputs])
    clock = steady_clock(found.time / second, channels)
    if clock is None:
        return []
    found.time = clock.time * second
    return [Flag("times_rounded", numbers={"rounding": clock.rounding * second, "rate": 1.0 / (clock.step * second)})]


def steady_clock(stamps: FloatArray, channels: Sequence[FloatArray] = ()) -> SteadyClock | None:
    """Return the steady clock whose times, rounded as the stamps are, are the stamps.

    Parameters
    ----------
    stamps : array, shape (n,)
        As the file has them. All may have as many decimals, or as many digits; those of steps that are shorter than
        the rounding repeat.
    channels : sequence of array, shape (n,)
        Readings; NaN are gaps. They are as smooth on the clock as on the stamps if they were taken on it.

    Returns
    -------
    SteadyClock or None
        None where no clock does, where stamps are off by too little to matter, and where readings are rougher on it;
        also where stamps are missing or go back, and where a row stands twice.

    Examples
    --------
    >>> film = np.round(np.arange(60) / 29.97, 2)
    >>> clock = steady_clock(film)
    >>> round(1 / clock.step, 1), clock.rounding
    (30.0, 0.01)
    """
    steps = np.diff(stamps)
    if stamps.size < _FEWEST or not (steps >= 0.0).all() or not 0.0 < np.ptp(stamps) < np.inf:
        return None
    again = np.flatnonzero(steps == 0.0)
    if again.size and _stand_twice(again, channels):
        return None
    most, count = 0.5 * _resolutions(stamps), _counted(steps)
    line = np.polynomial.Polynomial.fit(count, stamps, 1, w=1.0 / most)
    off = np.abs(stamps - line(count))
    # No line lies much nearer than the one of least squares, which is cheap.
    if (off > 2.0 * most).any() or off.max() < _SEEN * np.median(steps):
        return None
    found = _nearest(count, stamps, most)
    if found is None or (again.size and found[1] > _SHORTER * 2.0 * most[again].min()):
        return None
    time, step = found
    # Where stamps repeat, no reading can be told from its neighbour by them.
    rougher = not again.size and _rougher(stamps, time, channels)
    return None if rougher else SteadyClock(time, step, 2.0 * float(most.max()))


def _counted(steps: FloatArray) -> FloatArray:
    """Return how many steps of the clock each reading is from the first: where stamps repeat, none was lost."""
    each = np.ones_like(steps) if (steps == 0.0).any() else np.round(steps / np.median(steps))
    return np.concatenate([[0.0], np.cumsum(each)])


def _stand_twice(again: IntArray, channels: Sequence[FloatArray]) -> bool:
    """Return whether most rows whose stamp repeats hold the same readings twice."""
    if not channels:
        return True
    same = np.all([np.equal(c[again], c[again + 1]) for c in channels], axis=0)
    return bool(2 * same.sum() > same.size)


def _resolutions(stamps: FloatArray) -> FloatArray:
    """Return the value of the last decimal of each stamp, where those of a size have as many."""
    decade = np.floor(np.log10(np.maximum(np.abs(stamps), 10.0**-_MOST_DECIMALS)))
    decimals = np.empty(stamps.size)
    below, least, step = np.inf, -_MOST_DECIMALS, median_step(stamps)
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
    """Return whether a channel misses the cubics through its neighbours by more on the clock than on the stamps."""
    for channel in channels:
        good = np.isfinite(channel)
        if good.sum() < _FEWEST:
            continue
        there, here = (np.median(np.abs(left_by_cubics(t[good], channel[good])[0])) for t in (stamps, time))
        if here > _ROUGHER * there:
            return True
    return False
