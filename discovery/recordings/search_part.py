"""The part of long recordings on which effects are searched: more readings would only cost time and memory."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from discovery.recordings.experiment import Experiment
from discovery.recordings.flags import Flag
from discovery.recordings.holdout_part import motion_begin

#: Readings of all recordings together that a search uses, and of one of them at least.
SEARCHED, _FEWEST = 16_000, 2_000
#: Where there are no more than so many times these, one fit to the whole costs more than the search saves.
_WORTH = 2.0


def searched_part(experiments: Sequence[Experiment]) -> tuple[Experiment, ...]:
    """Return the first parts of recordings, in proportion, with as many readings as a search uses.

    What is held out of a recording stays the same share of it. Where the part would end before anything moves, the rest
    before comes on top. Readings that passed a filter are few already.
    """
    total = sum(e.recording.time.size for e in experiments)
    if total <= _WORTH * SEARCHED or any(e.rig.view is not None for e in experiments):
        return tuple(experiments)
    return tuple(_first(e, SEARCHED / total) for e in experiments)


def with_flag(experiments: Sequence[Experiment]) -> tuple[Experiment, ...]:
    """Return recordings with a note on each of which a search uses a part."""
    found = []
    for whole, part in zip(experiments, searched_part(experiments), strict=True):
        r, used = whole.recording, part.recording.time.size
        told = Flag("searched_in_part", numbers={"searched": used, "count": r.time.size})
        found.append(whole if used == r.time.size else replace(whole, recording=replace(r, flags=(*r.flags, told))))
    return tuple(found)


def _first(experiment: Experiment, share: float) -> Experiment:
    size, fitted = experiment.recording.time.size, experiment.fitted_samples
    begin = motion_begin(experiment.recording)
    # Of what rests first, a part may hold no motion.
    rest = begin if begin >= share * (size if fitted is None else fitted) else 0
    count = min(size, max(_FEWEST, rest + math.ceil(share * (size - rest))))
    part = experiment.first(count)
    if fitted is None:
        return part
    return replace(part, fitted_samples=max(1, rest + round((fitted - rest) * (count - rest) / (size - rest))))
