"""Noise that recordings of one sensor do not share: of held or smoothed readings none shows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from discovery.recordings.flags import Flag
from discovery.recordings.recording import Recording
from discovery.rigs.rig import Rig

#: Times by which the noise of one sensor does not differ.
_UNEVEN = 10.0


def with_uneven_noise(rig: Rig, found: Mapping[str, list[Recording]]) -> dict[str, list[Recording]]:
    """Return the recordings of each role, with a flag on each whose estimated noise is far below another's."""
    every = [r for listed in found.values() for r in listed]
    if rig.view or rig.traits.has_rod or not all(r.noise_estimated for r in every):
        return dict(found)
    largest = [every[most] for most in np.argmax([r.noise for r in every], axis=0)]

    def flagged(r: Recording) -> Recording:
        flags = list(r.flags)
        for i, (column, other) in enumerate(zip(rig.columns.read.values(), largest, strict=True)):
            own, most = float(r.noise[i]), float(other.noise[i])
            if _UNEVEN * own < most:
                numbers = {"sd": own, "larger": most, "other": other.name}
                flags.append(Flag("noise_uneven", column.name, column.unit, numbers))
        return replace(r, flags=tuple(flags))

    return {role: [flagged(r) for r in listed] for role, listed in found.items()}
