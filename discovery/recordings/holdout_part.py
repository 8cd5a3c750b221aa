"""Which part of a training recording is held out where no other recording judges."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np

from discovery.recordings.recording import Recording

__all__ = ["fitted_count", "motion_end", "motion_over_noise", "two_thirds"]

#: A recording is looked at in so many stretches.
_STRETCHES = 60
#: It moves where the readings of a stretch scatter by so many times their noise.
_MOVES = 3.0


def fitted_count(recording: Recording) -> int:
    """Return how many samples, from the first, are fitted: two thirds of those up to where the motion ends.

    The end of a free decay lies below the noise and would tell nothing about what shows in larger motion. It belongs to
    the part that is held out.
    """
    return two_thirds(motion_end(recording, lambda _: _MOVES, _MOVES))


def motion_end(recording: Recording, moves: Callable[[int], float], rests: float) -> int:
    """Return how many samples, from the first, hold the motion; all where nothing is seen to move, or to rest.

    Parameters
    ----------
    recording : Recording
        What was read.
    moves : callable
        Scatter beyond which a stretch of so many readings moves [noise sds].
    rests : float
        All that lies behind the last stretch that moves rests where it scatters by no more [noise sds]: what is slow
        moves by less than its noise in any stretch alone.
    """
    count = recording.time.size
    end = max(
        (last for first, last, scatter in _stretches(recording, 0) if scatter > moves(last - first)), default=count
    )
    return end if end == count or _scatter(recording, end, count) <= rests else count


def two_thirds(samples: int) -> int:
    """Return how many samples are fitted of those in which something moves."""
    return 2 * samples // 3


def motion_over_noise(recording: Recording, first: int) -> float:
    """Return the largest scatter of any stretch from a sample on [noise sds]: how much its readings can tell."""
    return max(scatter for *_, scatter in _stretches(recording, first))


def _stretches(recording: Recording, first: int) -> list[tuple[int, int, float]]:
    """Return where each stretch begins and ends, and how far its readings scatter about their mean [noise sds]."""
    count = recording.time.size - first
    edges = np.linspace(first, recording.time.size, min(_STRETCHES, max(count // 8, 1)) + 1).astype(int)
    return [(a, b, _scatter(recording, a, b)) for a, b in pairwise(edges.tolist())]


def _scatter(recording: Recording, first: int, last: int) -> float:
    """Return the largest standard deviation of any channel over a range of samples [noise sds]; gaps count nothing."""
    channels = zip(recording.output[first:last].T, recording.noise.tolist(), strict=True)
    return max(float(np.std(c[np.isfinite(c)])) / noise if np.isfinite(c).any() else 0.0 for c, noise in channels)
