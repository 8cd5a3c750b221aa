"""Which part of a training recording is held out where no other recording judges."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from discovery.recordings.recording import Recording

__all__ = ["fitted_count", "motion_over_noise", "scatter_over", "stretches", "two_thirds"]

#: A recording is looked at in so many stretches.
_STRETCHES = 60
#: It moves where the readings of a stretch scatter by so many times their noise.
_MOVES = 3.0


def fitted_count(recording: Recording) -> int:
    """Return how many samples, from the first, are fitted: two thirds of those up to where the motion ends.

    The end of a free decay lies below the noise and would tell nothing about what shows in larger motion. It belongs to
    the part that is held out.
    """
    moving = [last for _, last, scatter in stretches(recording, 0) if scatter > _MOVES]
    return two_thirds(moving[-1] if moving else recording.time.size)


def two_thirds(samples: int) -> int:
    """Return how many samples are fitted of those in which something moves."""
    return 2 * samples // 3


def motion_over_noise(recording: Recording, first: int) -> float:
    """Return the largest scatter of any stretch from a sample on [noise sds]: how much its readings can tell."""
    return max(scatter for *_, scatter in stretches(recording, first))


def stretches(recording: Recording, first: int) -> list[tuple[int, int, float]]:
    """Return where each stretch begins and ends, and how far its readings scatter about their mean [noise sds]."""
    count = recording.time.size - first
    edges = np.linspace(first, recording.time.size, min(_STRETCHES, max(count // 8, 1)) + 1).astype(int)
    return [(a, b, scatter_over(recording, a, b)) for a, b in pairwise(edges.tolist())]


def scatter_over(recording: Recording, first: int, last: int) -> float:
    """Return the largest standard deviation of any channel over a range of samples [noise sds]; gaps count nothing."""
    channels = zip(recording.output[first:last].T, recording.noise.tolist(), strict=True)
    return max(float(np.std(c[np.isfinite(c)])) / noise if np.isfinite(c).any() else 0.0 for c, noise in channels)
