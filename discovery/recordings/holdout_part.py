"""Which part of a training recording is held out where no other recording judges."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np

from discovery.recordings.recording import Recording

#: A recording is looked at in so many stretches.
_STRETCHES = 60
#: It moves where the readings of a stretch scatter by so many times their noise.
_MOVES = 3.0
#: Units of speeds, which are zero at rest.
_SPEEDS = ("m/s", "rad/s")
#: A speed or an input below this share of its largest is none.
_NONE = 0.1


def fitted_count(recording: Recording, *, pushed: bool = True) -> int:
    """Return how many samples, from the first, are fitted.

    They are two thirds of those up to where the system rests, and at least half of the motion: before a step there is
    nothing to learn. The end of a free decay lies below the noise and would tell nothing about what shows in larger
    motion. It belongs to the part that is held out. A level that an input holds is no rest, where it is `pushed`, a
    force: the levels of a motion do nothing.
    """
    end = motion_end(recording, lambda _: _MOVES, _MOVES, pushed=pushed)
    first, seen = _begin(recording)
    half = max(seen, (first + _last_moving(recording, lambda _: _MOVES)) // 2) if first else 0
    return max(two_thirds(end), half)


def motion_begin(recording: Recording) -> int:
    """Return up to which sample a recording rests, or stays as it is, before anything is seen to move."""
    return _begin(recording)[0]


def motion_end(recording: Recording, moves: Callable[[int], float], rests: float, *, pushed: bool = True) -> int:
    """Return how many samples, from the first, tell of the motion; all where nothing is seen to move, or to rest.

    Parameters
    ----------
    moves : callable
        Scatter beyond which a stretch of so many readings moves [noise sds].
    rests : float
        All that lies behind the last stretch that moves rests where it scatters by no more [noise sds]: what is slow
        moves by less than its noise in any stretch alone. It does not where a force or a voltage holds it there, nor at
        a steady speed.
    pushed : bool
        Whether the input is a force or a voltage.
    """
    count = recording.time.size
    end = _last_moving(recording, moves)
    settles = end == count or _scatter(recording, end, count) <= rests
    return end if settles and not _is_held(recording, end, pushed=pushed) else count


def two_thirds(samples: int) -> int:
    """Return how many samples are fitted of those in which something moves."""
    return 2 * samples // 3


def motion_over_noise(recording: Recording, first: int) -> float:
    """Return the largest scatter of any stretch from a sample on [noise sds]: how much its readings can tell."""
    return max(scatter for *_, scatter in _stretches(recording, first))


def _last_moving(recording: Recording, moves: Callable[[int], float]) -> int:
    """Return where the last stretch that moves ends; the end of the recording where none does."""
    ends = (last for first, last, scatter in _stretches(recording, 0) if scatter > moves(last - first))
    return max(ends, default=recording.time.size)


def _begin(recording: Recording) -> tuple[int, int]:
    """Return up to where nothing has moved, and by where something is seen to have; zero where nothing ever is."""
    stretches = (s[:2] for s in _stretches(recording, 0))
    return next((s for s in stretches if _scatter(recording, 0, s[1]) > _MOVES), (0, 0))


def _is_held(recording: Recording, first: int, *, pushed: bool) -> bool:
    """Return whether what is steady from a sample on is a speed, or pushed: it tells of losses or of stiffness."""
    steady = [recording.input] if pushed and recording.input is not None else []
    steady += [c for c, unit in zip(recording.output.T, recording.units, strict=True) if unit in _SPEEDS]
    return any(
        np.isfinite(c[first:]).any() and abs(np.nanmedian(c[first:])) > _NONE * np.nanmax(np.abs(c)) for c in steady
    )


def _stretches(recording: Recording, first: int) -> list[tuple[int, int, float]]:
    """Return where each stretch begins and ends, and how far its readings scatter about their mean [noise sds]."""
    count = recording.time.size - first
    edges = np.linspace(first, recording.time.size, min(_STRETCHES, max(count // 8, 1)) + 1).astype(int)
    return [(a, b, _scatter(recording, a, b)) for a, b in pairwise(edges.tolist())]


def _scatter(recording: Recording, first: int, last: int) -> float:
    """Return the largest standard deviation of any channel over a range of samples [noise sds]; gaps count nothing."""
    channels = zip(recording.output[first:last].T, recording.noise.tolist(), strict=True)
    return max(float(np.std(c[np.isfinite(c)])) / noise if np.isfinite(c).any() else 0.0 for c, noise in channels)
