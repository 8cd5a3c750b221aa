"""What a model leaves, as cautions: where in time it lies, and whether it looks like noise of the instrument."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from discovery.diagnosis.caution import SCATTERED, Caution
from discovery.estimation.fit import Fit
from discovery.estimation.residual import ResidualReport, memory
from discovery.recordings.recording import Recording
from discovery.results.judging import judged_rms

__all__ = ["burst", "like_noise", "not_carried", "scattered"]

FloatArray = NDArray[np.float64]

#: Half of what is left of a recording is a burst where it lies within this share of it.
_SHORT = 0.1
#: What is left may be noise with a memory up to so many noise sds, and is told apart in time from so many on.
_LITTLE, _LARGE = 3.0, 2.0
#: Errors are white where the variance of their mean is less than so many times that of independent ones.
_WHITE = 2.0
#: Noise is as large held out as in training, within this factor.
_ALIKE = 1.5
#: An error that falls in training falls as well held out, by this share of its logarithm at least; chance, as that of
#: the fitted starts, moves a held-out one by this factor.
_CARRIED, _CHANCE = 0.25, 1.05


def burst(fitted: Fit) -> Caution | None:
    """Return the shortest stretch that holds half of what a fit leaves of a recording; None where that is no short one.

    Parameters
    ----------
    fitted : Fit
        The final model.
    """
    bench = fitted.problem.bench
    left = np.square(fitted.minimum.residual[: bench.n_rows])
    found = []
    for e, (rows, used) in zip(bench.experiments, bench.blocks(), strict=True):
        part = np.where(used, left[rows].reshape(used.shape), 0.0).sum(axis=1)
        if _LARGE**2 * used.sum() < (whole := float(part.sum())) < math.inf:
            begin, end = _shortest(e.recording.time[: part.size], part, 0.5 * whole)
            share = (end - begin) / float(e.recording.time[part.size - 1] - e.recording.time[0])
            found += [(whole, e.recording.name, begin, end)] if share <= _SHORT else []
    if not found:
        return None
    _, name, begin, end = max(found)
    return Caution("burst", name, numbers={"start": begin, "stop": end, "share": 0.5})


def _shortest(time: FloatArray, part: FloatArray, sought: float) -> tuple[float, float]:
    """Return the shortest stretch of time that holds so much."""
    so_far = np.concatenate([[0.0], np.cumsum(part)])
    # From each sample on to the one that completes it.
    last = np.searchsorted(so_far, so_far[:-1] + sought) - 1
    first = np.flatnonzero(last < time.size)
    best = first[np.argmin(time[last[first]] - time[first])]
    return float(time[best]), float(time[last[best]])


def like_noise(
    report: ResidualReport, depends_on: Sequence[str], *, left: float, held: float, noise: float
) -> Caution | None:
    """Return that what is left may be noise of the instrument; None where it is large or depends on the motion.

    Parameters
    ----------
    report : ResidualReport
        Of the final model in training.
    depends_on : sequence of str
        States that explain a part of what is left.
    left, held, noise : float
        Model error in training and held out, zero without any, and the smallest noise [unit of the output].
    """
    alike = held == 0.0 or left / _ALIKE <= held <= _ALIKE * left
    if report.rms > _LITTLE or depends_on or not alike:
        return None
    return Caution("like_noise", numbers={"ratio": left / noise, "autocorrelation": report.autocorrelation})


def not_carried(errors: Mapping[str, Any]) -> Caution | None:
    """Return that an error falls in training and hardly held out, or grows there; None where it falls as well.

    Parameters
    ----------
    errors : mapping
        Of loop.json.
    """
    pairs = [(errors[when]["train"]["rms"], judged_rms(errors, when)) for when in ("before", "after")]
    if not all(0 < value < math.inf for pair in pairs for value in pair):
        return None
    train, held = (before / after for before, after in zip(*pairs, strict=True))
    if math.log(_CHANCE * held) >= _CARRIED * math.log(max(train, 1.0)):
        return None
    return Caution("not_carried", numbers={"train": train, "held": held})


def scattered(errors: Mapping[str, Any], left: Sequence[tuple[Recording, FloatArray]]) -> Caution | None:
    """Return that held-out readings lie farther off than their noise; None where they do not.

    Parameters
    ----------
    errors : mapping
        Of loop.json.
    left : sequence of (Recording, ndarray)
        The recordings that judge, and what the final model leaves of each, shape (n, c): NaN where it does not count.
    """
    rms = judged_rms(errors)
    # The error is a distance over all channels, and recordings may differ in their noise.
    floor = max((float(np.linalg.norm(recording.noise)) for recording, _ in left), default=math.inf)
    if not SCATTERED * floor < rms < math.inf:
        return None
    length = float(np.mean([memory(c[np.isfinite(c)]) for _, part in left for c in part.T]))
    numbers = {"rms": rms, "unit": errors["unit"], "ratio": rms / floor, "noise": floor, "memory": length}
    estimated = any(recording.noise_estimated for recording, _ in left)
    return Caution("scattered", numbers={**numbers, "estimated": estimated, "white": length < _WHITE})
