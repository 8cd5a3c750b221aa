"""The noise of readings as their scatter from sample to sample shows it, and where the rig file states another."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping

import numpy as np
import numpy.typing as npt

from discovery.declarations.units import quoted
from discovery.recordings.quantisation import resolution
from discovery.recordings.repeated_notes import by_fault

__all__ = ["estimate_noise", "misstated", "noise_note", "understated"]

FloatArray = npt.NDArray[np.float64]

_FEWEST = 200  # readings, fewer scatter too little to contradict a statement
_OTHER = 1.5  # ratio of noises that differ
_FAR = 2.0  # ratio of a stated noise to a smaller one that hides what is sought
_COARSE = 0.3  # of the noise
_SETTLED = 0.9  # of an estimate is left by the next order of differences where it holds no signal
_JITTER = 0.05  # of a step
_TOO_SMALL = "If that is too small, the rest of the noise looks like something missing."
_TOO_LARGE = "If that is too large, small effects stay unseen; if the readings were smoothed, take raw ones."
_NOTE = re.compile(r"(?P<label>.+?) scatters by (?P<scatter>\S+)(?P<rest>.* from .* a noise of (?P<stated>[^ ,]+).*)")


def estimate_noise(values: FloatArray) -> float:
    """Estimate the standard deviation of white noise on a signal that is smooth from sample to sample.

    Differences of order 2 to 8 suppress the signal more and more, and each, divided by the root of the sum of its
    squared binomial coefficients, has the variance of the noise. Their median absolute deviation (times 1.4826,
    Gaussian) does not see steps and outliers; the smallest estimate is the one that holds least of the signal.

    Parameters
    ----------
    values : array, shape (n,)
        Samples, about equally spaced; NaN are skipped.

    Returns
    -------
    float
        The estimate in the unit of `values`; 0 for a signal without noise, NaN with fewer than 18 samples.
    """
    return min(_estimates(values), default=float("nan"))


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


def noise_note(label: str, unit: str, time: FloatArray, values: FloatArray, stated: float) -> list[str]:
    """Tell where the scatter from sample to sample is not the noise that the rig file states.

    Nothing is said of few or coarse readings, nor where the scatter is larger but may be the signal's.

    Parameters
    ----------
    label, unit : str
        Column and its unit in the file, for the sentence.
    time, values : array, shape (n,)
        Times [s] and readings; NaN are gaps.
    stated : float
        Standard deviation of a reading, as the rig file states it.
    """
    estimates = _estimates(values)
    scatter = min(estimates, default=0.0)
    if np.isfinite(values).sum() < _FEWEST or resolution(values) > _COARSE * scatter:
        return []
    if stated / _OTHER <= scatter <= stated * _OTHER:
        return []
    if scatter > stated:
        steps = np.diff(time[np.isfinite(values)])
        irregular = np.quantile(np.abs(steps - np.median(steps)), 0.95) > _JITTER * np.median(steps)
        if irregular or estimates[-1] < _SETTLED * estimates[-2]:
            return []
        doubt = _TOO_SMALL
    else:
        doubt = _TOO_LARGE
    return [
        f"{label!r} scatters by {quoted(scatter, unit)} from sample to sample, but the rig file states a noise of "
        f"{quoted(stated, unit)}, which is used. {doubt}"
    ]


def understated(notes: Iterable[str]) -> list[str]:
    """Return those notes on a recording by which its noise is larger than the rig file states."""
    return [note for note in notes if note.endswith(_TOO_SMALL)]


def misstated(notes: Mapping[str, Iterable[str]]) -> list[str]:
    """Return a sentence for each stated noise that notes, by recording, contradict, with all their columns."""
    sentences = []
    for rest, entries in by_fault(notes, _misstatement).items():
        names = ", ".join(dict.fromkeys(name for name, _ in entries))
        labels = ", ".join(dict.fromkeys(label for _, (label, _) in entries))
        sizes = sorted({scatter for _, (_, scatter) in entries}, key=float)
        verb = "scatters" if len(entries) == 1 else "scatter"
        sentences.append(f"{names}: {labels} {verb} by {' to '.join(dict.fromkeys((sizes[0], sizes[-1])))}{rest}")
    return sentences


def _misstatement(note: str) -> tuple[str, tuple[str, str]] | None:
    """Return what a note says of the stated noise, and the column with its scatter, if that noise hides anything."""
    found = _NOTE.fullmatch(note) if note.endswith((_TOO_SMALL, _TOO_LARGE)) else None
    if not found or float(found["scatter"]) <= float(found["stated"]) < _FAR * float(found["scatter"]):
        return None
    return found["rest"], (found["label"], found["scatter"])
