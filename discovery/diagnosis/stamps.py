"""Time stamps that err: what a model leaves then goes with how far they lie from a steady clock."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.interpolate import CubicSpline

from discovery.diagnosis.caution import Caution
from discovery.foundation.arrays import FloatArray
from discovery.recordings.recording import Recording
from discovery.recordings.time_stamps import is_steady

_FEWEST = 30  # readings
_SURE = 6.0  # standard deviations
_WHOLLY = (0.5, 1.5)  # slope times deviation that readings are off by, where stamps err and the clock is right
_PART = 0.1  # of what is left
_MANY = 16  # steps
_FOLLOW = 0.2  # of how far a stamp is off, by which the clock that is sought moves


def erring_stamps(left: Sequence[tuple[Recording, FloatArray]]) -> Caution | None:
    """Return that readings were taken on a steady clock from which stamps deviate; None where they were not.

    A reading f(t - d) whose stamp t is off by d misses the prediction f(t) by d f'(t). The slope is that of the model,
    so that a few readings in a swing are enough. Nothing is said where the rig file states how stamps err.

    `left`: recordings, and what the model leaves of each, prediction less reading, (n, c); NaN where it does not count.
    """
    judged = [(recording, part, *_clock(recording.time)) for recording, part in left if _may_err(recording)]
    if not judged:
        return None
    pairs = [_expected(recording, part, behind) for recording, part, _, behind in judged]
    found, expected = (np.concatenate(each) for each in zip(*pairs, strict=True))
    push, power = float(expected @ found), float(expected @ expected)
    if found.size < _FEWEST or not 0.0 < power < np.inf or not np.isfinite(push):
        return None
    size = push / power
    sd = float(np.sqrt(np.square(found - size * expected).sum() / (found.size - 1) / power))
    part = size * push / float(found @ found)
    if not (_WHOLLY[0] < size < _WHOLLY[1] and size > _SURE * sd and part > _PART):
        return None
    recording, _, step, behind = max(judged, key=lambda each: each[0].time.size)
    numbers = {"deviation": float(np.std(behind)), "share": part, "step": step}
    return Caution("stamps", recording.name, numbers=numbers)


def _may_err(recording: Recording) -> bool:
    return recording.jitter == 0.0 and recording.time.size > _FEWEST and not is_steady(recording.time)


def _expected(recording: Recording, left: FloatArray, behind: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return what is left of the readings, and what it would be if their stamps erred, in noise sds.

    `behind` (n,): how far stamps lie behind the clock [s].
    """
    found, expected, time = [], [], recording.time
    for k, noise in enumerate(recording.noise):
        good = np.isfinite(left[:, k]) & np.isfinite(recording.output[:, k])
        if good.sum() > _FEWEST:
            slope = CubicSpline(time[good], (recording.output + left)[good, k])(time[good], 1)
            found.append(left[good, k] / noise)
            expected.append(slope * behind[good] / noise)
    return np.concatenate([np.empty(0), *found]), np.concatenate([np.empty(0), *expected])


def _clock(time: FloatArray) -> tuple[float, FloatArray]:
    """Return the step of the steady clock nearest to some stamps, and how far each lies behind it [s]."""
    # None is lost, or some are.
    counts = [np.arange(time.size, dtype=np.float64), _counted(time)]
    lines = [np.polynomial.Polynomial.fit(count, time, 1) for count in counts]
    behind = [time - line(count) for line, count in zip(lines, counts, strict=True)]
    best = min((0, 1), key=lambda k: float(behind[k].std()))
    return float(lines[best].convert().coef[1]), behind[best]


def _counted(time: FloatArray) -> FloatArray:
    """Return how many steps each stamp is from the first, where samples are lost."""
    # Over many steps errors of stamps hardly count.
    step, count, expected = float(np.median(time[_MANY:] - time[:-_MANY])) / _MANY, [0.0], float(time[0])
    for stamp in time[1:].tolist():
        # A stamp may err by half a step: the clock follows slowly.
        count.append(count[-1] + max(1.0, round((stamp - expected) / step)))
        expected += (count[-1] - count[-2]) * step
        expected += _FOLLOW * (stamp - expected)
    return np.array(count)
