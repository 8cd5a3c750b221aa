"""Noise that recordings of one sensor do not share: of held or smoothed readings none shows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from discovery.recordings.flags import Flag
from discovery.recordings.recording import Recording
from discovery.rigs.rig import Rig

#: Times by which the noise of one sensor does not differ.
_UNEVEN = 10.0


def with_uneven_noise(rig: Rig, recordings: Sequence[Recording]) -> list[Recording]:
    """Return recordings that are fitted together, with a flag on each whose estimated noise is far below another's."""
    if rig.view or rig.traits.has_rod or not all(r.noise_estimated for r in recordings):
        return list(recordings)
    noise = np.array([r.noise for r in recordings])
    largest, found = np.argmax(noise, axis=0), []
    for r, own in zip(recordings, noise, strict=True):
        flags = list(r.flags)
        for name, column, sd, most in zip(r.channels, rig.columns.read.values(), own, largest, strict=True):
            other = recordings[most]
            if _UNEVEN * sd < (larger := float(other.noise[r.channels.index(name)])):
                numbers = {"sd": float(sd), "larger": larger, "other": other.name}
                flags.append(Flag("noise_uneven", column.name, column.unit, numbers))
        found.append(replace(r, flags=tuple(flags)))
    return found
