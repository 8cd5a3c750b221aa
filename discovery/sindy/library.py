"""Rows of the sparse regression from all recordings: candidate terms on smoothed motion against the measured motion.

The equation is theta_t'' + sum_j c_j f_j = 0 for an arm (the paper's form, equation 15) and q'' + sum_j c_j f_j = b u
for an oscillator, seen through the oscillator nearest to it, see `discovery.sindy.rows`.

While the base of an arm moves, inertial forces act that depend on its rate and acceleration and that no candidate in
delta and theta_t' describes; they would be spread over those that are there. Rows of an arm are therefore taken where
the base rests, if it does for long enough.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from discovery.foundation.errors import InputError
from discovery.signals.differentiate import FloatArray
from discovery.signals.motion import Motion
from discovery.sindy.candidates import Candidates, Term
from discovery.sindy.rows import response_rows

__all__ = ["Library", "build_library", "stretches"]

#: Samples after which rows start from a new initial state.
_WINDOW = 4000


@dataclass(frozen=True)
class Library:
    """Whitened regression rows: ``target = columns @ coefficients + unit noise``.

    Attributes
    ----------
    terms : tuple of Term, length p
        Candidates.
    columns : ndarray, shape (n, p)
        Candidates, sign included, in standard deviations of the row.
    target : ndarray, shape (n,)
        Left-hand side in standard deviations of the row.
    blocks : ndarray of int, shape (n,)
        Contiguous stretch of a recording to which the row belongs; stretches are resampled whole.
    at_rest : bool
        Only rows where an arm's base rests were taken.
    """

    terms: tuple[Term, ...]
    columns: FloatArray
    target: FloatArray
    blocks: np.ndarray
    at_rest: bool

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the terms."""
        return tuple(term.name for term in self.terms)


def _runs(motion: Motion, at_rest: bool, shortest: float) -> list[np.ndarray]:
    """Return the samples to use in contiguous runs; where the base rests, of at least ``shortest`` seconds."""
    time = motion.coordinate.time
    if not at_rest or motion.drive is None:
        return [np.arange(time.size)]
    rate = np.abs(motion.drive.evaluate(time)[1])
    rests = rate < 2e-3 * rate.max() if rate.max() > 0.0 else np.ones(time.size, bool)
    runs = np.split(np.arange(time.size), np.flatnonzero(np.diff(rests.astype(int))) + 1)
    return [run for run in runs if rests[run[0]] and run.size >= 20 and time[run[-1]] - time[run[0]] >= shortest]


def _rests_half_the_time(motions: Sequence[Motion]) -> bool:
    at_rest = sum(run.size for motion in motions for run in _runs(motion, True, 0.0))
    return 2 * at_rest >= sum(motion.coordinate.time.size for motion in motions)


def build_library(motions: Sequence[Motion]) -> Library:
    """Evaluate the candidate terms on smoothed recordings.

    Rows of an arm are taken only where its base rests, if that leaves half of the samples.

    Parameters
    ----------
    motions : sequence of Motion
        Recordings of one system.

    Returns
    -------
    Library
        Columns, target and stretches of all recordings, one below the other.

    Raises
    ------
    InputError
        Without recordings, with recordings of different kinds, or if no row is left.
    """
    arm = bool(motions) and motions[0].system.has_rod
    at_rest = arm and _rests_half_the_time(motions)
    candidates = Candidates(motions, at_rest=at_rest)
    oscillator = candidates.nearest_oscillator(motions)
    longest = max(float(motion.coordinate.time[-1] - motion.coordinate.time[0]) for motion in motions)
    period = 2.0 * np.pi / np.sqrt(oscillator[0]) if oscillator[0] > 0.0 else longest
    parts = [
        response_rows(motion, cut, candidates, oscillator)
        for motion in motions
        for run in _runs(motion, at_rest, min(period / 2.0, longest / 5.0))
        for cut in np.array_split(run, -(-run.size // _WINDOW))
    ]
    if not parts:
        raise InputError(
            "The base never rests for half a period. Use `discovery loop`, which compares free-run predictions."
        )
    # Stretches that are resampled whole last about a period.
    stretch = float(np.clip(period, longest / 50.0, longest / 5.0))
    return Library(
        terms=candidates.terms,
        columns=np.vstack([part[1] for part in parts]),
        target=np.concatenate([part[2] for part in parts]),
        blocks=stretches([part[0] for part in parts], stretch),
        at_rest=at_rest,
    )


def stretches(times: Sequence[FloatArray], length: float) -> np.ndarray:
    """Return the number of the stretch, of about ``length`` seconds, in which each time of each recording lies."""
    labels, start = [], 0
    for t in times:
        count = max(round((t[-1] - t[0]) / length), 1)
        index = np.minimum((count * (t - t[0]) / (t[-1] - t[0])).astype(int), count - 1)
        labels.append(start + index)
        start += count
    return np.concatenate(labels)
