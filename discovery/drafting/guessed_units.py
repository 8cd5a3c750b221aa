"""The unit of a signal whose name does not state it, guessed from words and numbers, and what is said of a guess."""

from __future__ import annotations

import numpy as np

from discovery.drafting.names import Meaning, meaning_of, words_of
from discovery.foundation.arrays import FloatArray
from discovery.foundation.sampling import median_step

_FEW = 1000  # readings: fewer, a thousand a second, would be of less than a second
_FRAMES = {"frame", "frames"}
#: Words for an angle, and for what turns, beside a velocity.
_ANGLES = {"angle", "theta", "phi", "swing", "rotation", "winkel"}
#: Words of what turns: its speed is that of an angle.
_TURNING = _ANGLES | {"angular", "ang", "rotational", "rot", "omega", "gyro"}
#: Words of what goes along a line, and how far in metres, at most: a picture or a ruler counts more of its units.
_ALONG, _METRES = {"x", "z", "weg", "distance", "dist", "stroke", "elongation"}, 10.0
#: Where an angle in degrees has no unit: more than two turns in radians.
_TURNS = 4.0 * np.pi


def angle_unit(values: FloatArray) -> str:
    """Return the unit of an angle where nothing but its size tells it."""
    return "deg" if float(np.nanmax(np.abs(values))) > _TURNS else "rad"


def counts_frames(name: str, values: FloatArray) -> bool:
    """Return whether a column holds the numbers (n,) of a film's frames.

    Examples
    --------
    >>> counts_frames("frame_num", np.array([7.0, 8.0, 10.0])), counts_frames("frame_time", np.array([0.0, 0.04, 0.08]))
    (True, False)
    """
    named = not _FRAMES.isdisjoint(words_of(name)) and meaning_of(name).role == ""
    return named and np.array_equal(values, np.round(values)) and bool((np.diff(values) > 0).all())


def guessed_unit(name: str, meaning: Meaning, role: str, values: FloatArray) -> str:
    """Return the unit of a column of which the name states none, "1" where nothing tells it.

    `role`: ``"time"``, ``"input"`` or ``"output"``. `values` (n,): its numbers; NaN are gaps.

    Examples
    --------
    >>> [guessed_unit(n, Meaning("motion", None), "output", np.array([0.0, 0.4])) for n in ("theta", "x", "reading")]
    ['rad', 'm', '1']
    """
    words = words_of(name)
    if role == "time":
        if counts_frames(name, values):
            return "s"
        step = median_step(values)
        # Hardly a motion is read once a second: whole numbers count milliseconds or microseconds, unless they are few.
        seconds = step < 1.0 or (step == 1.0 and values.size < _FEW)
        return "s" if seconds else "ms" if step < 500.0 else "us"
    if role == "output" and _ANGLES.intersection(words):
        return angle_unit(values)
    if role == "output" and meaning.role == "speed":
        slides = "vel" in name.lower() and not _TURNING.intersection(words)
        return "m/s" if slides else "rad/s"
    along = _ALONG.intersection(words) and float(np.nanmax(np.abs(values))) <= _METRES
    if role == "output" and (meaning.role == "height" or (meaning.role in ("motion", "") and along)):
        return "m"
    return "V" if "volt" in name.lower() else "1"


def said_of(name: str, unit: str, values: FloatArray) -> str:
    """Return the words for a guessed unit, and for one that nobody can know, what then holds."""
    words = words_of(name)
    if unit == "s" and counts_frames(name, values):
        return "FILL IN scale = 1 over the frames a second: it counts frames; "
    if unit in ("s", "ms") and median_step(values) == 1.0:
        return "FILL IN the unit, s or ms, which neither name nor numbers tell; "
    if unit in ("m/s", "rad/s") and not _TURNING.intersection(words):
        return "FILL IN the unit, m/s or rad/s, which neither name nor numbers tell; guesses above are in it; "
    if unit == "deg" and np.array_equal(values, np.round(values), equal_nan=True):
        return "FILL IN the unit: of an encoder's counts it is rev, scale = 1 over those of a turn; "
    if unit in ("deg", "rad") and not _TURNING.intersection(words):
        return "FILL IN the unit of an angle; a place along an axis is none: --kind oscillator reads it; "
    unknown = unit == "1" or (unit == "m" and _ALONG.intersection(words))
    return "FILL IN the unit, which the name does not state; " if unknown else "unit guessed; "
