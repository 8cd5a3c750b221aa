"""By how much the stamps of a recording err: as the rig file states, else as its readings show."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from discovery.declarations.units import si_factor
from discovery.foundation.sampling import median_step
from discovery.recordings.file_signals import Signals
from discovery.recordings.flags import Flag
from discovery.recordings.rounding import resolution
from discovery.recordings.time_stamps import estimate_jitter, is_steady
from discovery.recordings.timing_errors import timing_error
from discovery.rigs.rig import Rig


def jitter_of(rig: Rig, found: Signals, noise: list[float], stated: Sequence[float | None]) -> tuple[float, list[Flag]]:
    """Return by how much stamps err [s], told where nobody stated it; a filtered force does not feel it.

    An estimate in `noise` (c,) that holds errors of steady stamps becomes that of readings at rest; `stated` are those
    of the rig file.
    """
    if rig.view is not None or not found.outputs:
        return 0.0, []
    if rig.columns.time.jitter is not None:
        return rig.columns.time.jitter, []
    if is_steady(found.time):
        return _at_other_times(found, noise, stated)
    read = np.column_stack([found.outputs[channel] for channel in found.channels])
    jitter = estimate_jitter(found.time, read, np.array(noise))
    numbers = {"jitter": jitter, "step": median_step(found.time)}
    return jitter, [Flag("stamps_err", numbers=numbers)] if jitter > 0.0 else []


def _at_other_times(found: Signals, noise: list[float], stated: Sequence[float | None]) -> tuple[float, list[Flag]]:
    """Return by how much the times of readings at steady stamps err [s], the median of the channels, and tell it."""
    errors = []
    for channel, known in zip(found.channels, stated, strict=True):
        values = found.outputs[channel]
        errors.append(timing_error(found.time, values, resolution(values, found.time) if known is None else known))
    jitter = float(np.median([0.0 if error is None else error.sd for error in errors]))
    if jitter == 0.0:
        return 0.0, []
    for k, (error, known) in enumerate(zip(errors, stated, strict=True)):
        if error is not None and known is None:
            noise[k] = error.noise
    unit = found.units.get("time", "s")
    numbers = {"jitter": jitter, "step": median_step(found.time), "entry": float(f"{jitter / si_factor(unit):.2g}")}
    return jitter, [Flag("times_err", found.names.get("time", ""), unit, numbers)]
