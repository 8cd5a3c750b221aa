"""Free motions that have come to rest: readings of a body that no longer moves tell nothing of how it moves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from discovery.recordings.flags import Flag
from discovery.recordings.holdout_part import motion_end
from discovery.recordings.recording import Recording

#: A stretch moves where it scatters beyond its noise by so many standard errors of its scatter.
_BEYOND = 4.0
#: What is left behind the last of them rests where all of it scatters by no more than so many times the noise.
_RESTS = 1.5
#: So much of the motion's length is kept of the rest behind it, which shows where the body stays.
_KEPT = 0.1


def moving_count(recording: Recording) -> int | None:
    """Return how many samples, from the first, hold a free motion and a tenth of its length of the rest behind it.

    A law of friction is smooth near zero speed: a body that it holds creeps, however slowly, for as long as the
    recording lasts. None where the motion lasts, or where an input, which may push what rests, is recorded.
    """
    if recording.input is not None:
        return None
    count = recording.time.size
    kept = int(np.ceil((1 + _KEPT) * motion_end(recording, _moves, _RESTS)))
    return kept if kept < count else None


def moving_part(recording: Recording) -> Recording:
    """Return a recording up to there, with a flag that says so where that is not all of it."""
    kept = moving_count(recording)
    if kept is None:
        return recording
    last, end = recording.time[[kept - 1, -1]].tolist()
    flag = Flag("at_rest", numbers={"count": recording.time.size, "kept": kept, "last": last, "end": end})
    output = recording.output[:kept]
    return replace(recording, time=recording.time[:kept], output=output, flags=(*recording.flags, flag))


def _moves(count: int) -> float:
    """Return beyond which scatter a stretch of so many readings moves [noise sds]."""
    return 1.0 + _BEYOND / float(np.sqrt(2.0 * count))
