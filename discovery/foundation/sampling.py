"""How samples lie in time: the step between them, and where some are missing."""

from __future__ import annotations

import numpy as np

from discovery.foundation.arrays import BoolArray, FloatArray, IntArray

#: Stamps that only jitter are nearer than this, over the median step; where one sample is lost they are twice as far.
_GAP = 1.5
#: So many steps together scatter by less than this part of what samples lost by chance would make of them,
_TOGETHER, _STEADY = 40, 0.5
#: where they last so much longer than as many median ones, in these.
_LONGER = 0.05
#: Steps of a clock that is rounded differ by a tick, no less than this part of the median one, and equal ones in so
#: many digits.
_COARSE, _DIGITS = 0.2, 5
#: Of the median step, by which others may differ.
_UNEVEN = 0.05


def median_step(time: FloatArray) -> float:
    """Return the median step between instants, in their unit."""
    return float(np.median(np.diff(time)))


def mean_rate(time: FloatArray) -> float:
    """Return how many instants there are per unit of their time, from the first to the last: that tells of any steps.

    Examples
    --------
    >>> mean_rate(np.array([0.0, 0.1, 0.3, 0.4, 0.5]))
    8.0
    """
    return float((time.size - 1) / (time[-1] - time[0]))


def stride(rows: IntArray) -> int:
    """Return of how many samples each is one that is used: of every sample 1, and 1 of none or where it slips.

    Examples
    --------
    >>> stride(np.array([0, 6, 12, 18])), stride(np.array([0, 1, 2, 9])), stride(np.array([0, 6, 12, 19, 25]))
    (6, 1, 1)
    """
    every = int(np.median(np.diff(rows))) if rows.size > 1 else 1
    return every if (rows % every == rows[:1] % every).all() else 1


def stretches(inside: BoolArray) -> list[tuple[int, int]]:
    """Return the first sample of every stretch of those (n,) that are `inside`, and the one after its last.

    Examples
    --------
    >>> stretches(np.array([True, False, True, True]))
    [(0, 1), (2, 4)]
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], inside, [False]]).astype(np.int8))).tolist()
    return list(zip(edges[0::2], edges[1::2], strict=True))


def gaps(time: FloatArray, step: float | None = None) -> BoolArray:
    """Return for each of the n - 1 steps between n instants whether samples are missing in it.

    That is by its length over `step`, which is their usual one where none is given.

    Examples
    --------
    >>> gaps(np.array([0.0, 0.1, 0.2, 0.4, 0.5])).tolist()
    [False, False, True, False]
    """
    return np.asarray(np.diff(time) > (_longest(time) if step is None else _GAP * step))


def _longest(time: FloatArray) -> float:
    """Return the longest step in which no sample is missing.

    Of a clock that ticks every 1.4 ms and is read in whole milliseconds steps are of one and of two. What many of them
    last together tells them from lost samples: it differs by little more than a rounding, where losses add up.
    """
    median, spans = median_step(time), time[_TOGETHER:] - time[:-_TOGETHER]
    tick = np.diff(np.unique(np.round(np.diff(time) / median, _DIGITS))).min(initial=np.inf)
    if spans.size < _TOGETHER or not _COARSE < tick < np.inf:
        return _GAP * median
    low, usual, high = np.quantile(spans, [0.16, 0.5, 0.84]) / median
    more = usual / _TOGETHER - 1.0
    by_chance = np.sqrt(_TOGETHER * max(more, 0.0) * (1.0 + more))
    rounded = more > _LONGER and (high - low) / 2 < _STEADY * by_chance
    return median * float(1.0 + more + tick if rounded else _GAP)  # rounding makes none longer by a tick


def are_uneven(time: FloatArray) -> bool:
    """Return whether instants increase, and more than one step in twenty is not like the others.

    Examples
    --------
    >>> are_uneven(np.array([0.0, 0.1, 0.25, 0.3]))
    True
    """
    steps = np.diff(time)
    return bool(
        steps.size
        and steps.min() > 0.0
        and np.quantile(np.abs(steps - np.median(steps)), 0.95) > _UNEVEN * np.median(steps)
    )
