"""What no sensor measured is left out of a recording, and the noise of the rest and the errors of its stamps told."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict

import numpy as np

from discovery.declarations.registry import get_effect
from discovery.declarations.units import si_factor, si_symbol
from discovery.foundation.sampling import median_step
from discovery.mechanics import get_base
from discovery.recordings.file_signals import Signals, judged_channels
from discovery.recordings.flags import Flag
from discovery.recordings.local_fits import alternation, timing_error
from discovery.recordings.reading_flags import clean_output, gap_flags, without_unread
from discovery.recordings.reading_noise import BandNoise, band_noise, estimate_noise, noise_flags
from discovery.recordings.rounding import resolution
from discovery.recordings.time_stamps import estimate_jitter, is_steady
from discovery.rigs.rig import Rig

Bands = list[BandNoise | None]
_ALTERNATES = 1.4  # ratio of noises from which readings err in opposite directions: that of white noise is 1.0 +- 0.1
_IDLE = 0.02  # part of its largest value by which an input hardly pushes
#: SI units of what is no position.
_OTHERS = {
    **dict.fromkeys(("m/s", "rad/s"), "a speed"),
    **dict.fromkeys(("m/s^2", "rad/s^2"), "an acceleration"),
    **dict.fromkeys(("N", "N m"), "a force"),
}


def cleaned(rig: Rig, found: Signals, stated: Sequence[float | None]) -> tuple[list[float], Bands, list[Flag]]:
    """Leave out what no sensor measured; return the noise of each channel, its band, and what is unusual about it."""
    noise: list[float] = []
    bands: Bands = []
    flags: list[Flag] = []
    returns = rig.traits.returns and rig.view is None
    base = get_base(rig.base)
    orders = dict(zip(base.channels, base.orders, strict=True))
    position = base.order == 0 and rig.view is None and rig.columns.output.reads == "position"
    driven = position and found.inputs is not None and not rig.traits.has_rod
    still = None
    if driven and found.inputs is not None and base.drifts(map(get_effect, rig.declared)):
        still = np.abs(found.inputs) <= _IDLE * np.nanmax(np.abs(found.inputs))  # it may stop anywhere
    for channel, known in zip(found.channels, stated, strict=True):
        if channel not in found.outputs:
            noise.append(1.0 if known is None else known)
            bands.append(None)
            continue
        name, unit, values = found.names[channel], found.units[channel], found.outputs[channel]
        flags += gap_flags(name, found.time, found.table.numbers(name))
        order = orders.get(channel, base.order)
        if position and rig.system is None and order == 0 and (what := _OTHERS.get(si_symbol(unit))):
            flags.append(Flag("rate_as_position", name, unit, {"what": what}))
        if rig.view is None:  # a force of friction is flat by itself
            values, told = without_unread(name, unit, found.time, values, still)
            flags += told
        given, scatter = found.inputs, estimate_noise(values, found.time)
        # A view passes filters of its own.
        band = band_noise(found.time, values, scatter, given) if rig.view is None else None
        seen = scatter if band is None else band.sd
        # A noise of zero would give its samples infinite weight: fall back on the resolution of the readings.
        noise.append(max(seen if known is None else known, resolution(values, found.time)))
        bands.append(band)
        if band is not None:
            flags.append(Flag("noise_alike", name, unit, {"scatter": scatter, **asdict(band)}))
        elif rig.view is None and (ratio := alternation(values)) > _ALTERNATES:
            flags.append(Flag("noise_alternates", name, unit, {"ratio": ratio}))
        values, told = clean_output(
            name, unit, found.time, values, noise[-1], returns, given=given, rate=order == 1, driven=driven, still=still
        )
        found.outputs[channel] = values
        flags += told
    return noise, bands, flags


def timed(
    rig: Rig,
    found: Signals,
    noise: list[float],
    stated: Sequence[float | None],
    bands: Bands,
    repeats: Sequence[Flag] = (),
) -> tuple[float, list[Flag]]:
    """Return by how much stamps err [s], and tell it, and where scatter is not the noise that is stated with that.

    What `repeats` tell of a sensor that was asked too often tells of its times, too.
    """
    if any(flag.numbers["moved"] for flag in repeats) and rig.columns.time.jitter is None:
        jitter, flags = 0.0, list[Flag]()
    else:
        jitter, flags = _jitter(rig, found, noise, stated)
        flags = [] if repeats else flags
    for channel, known, band in zip(found.channels, stated, bands, strict=True):
        if known is not None and channel in found.outputs:
            label, unit, values = found.names[channel], found.units[channel], found.outputs[channel]
            flags += noise_flags(label, unit, found.time, values, known, band=band, jitter=jitter)
    return jitter, flags


def _jitter(rig: Rig, found: Signals, noise: list[float], stated: Sequence[float | None]) -> tuple[float, list[Flag]]:
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
    read = (found.outputs[channel] for channel in found.channels)
    errors = [estimate_jitter(found.time, column, sd) for column, sd in zip(read, noise, strict=True)]
    jitter = _of_instruments(found.channels, errors)
    numbers = {"jitter": jitter, "step": median_step(found.time)}
    return jitter, [Flag("stamps_err", numbers=numbers)] if jitter > 0.0 else []


def _of_instruments(channels: Sequence[str], errors: Sequence[float]) -> float:
    """Return by how much stamps err [s] by what each channel shows: the median of one instrument, the most of several.

    What moves slowly, or is read coarsely, shows nothing.
    """
    own = judged_channels(channels)
    return max(float(np.median(errors[own])), *errors[own.stop :], 0.0)


def _at_other_times(found: Signals, noise: list[float], stated: Sequence[float | None]) -> tuple[float, list[Flag]]:
    """Return by how much the times of readings at steady stamps err [s], and tell it."""
    errors = []
    for channel, known in zip(found.channels, stated, strict=True):
        values = found.outputs[channel]
        errors.append(timing_error(found.time, values, resolution(values, found.time) if known is None else known))
    jitter = _of_instruments(found.channels, [0.0 if error is None else error.sd for error in errors])
    if jitter == 0.0:
        return 0.0, []
    for k, (error, known) in enumerate(zip(errors, stated, strict=True)):
        if error is not None and known is None:
            noise[k] = error.noise
    unit = found.units.get("time", "s")
    numbers = {"jitter": jitter, "step": median_step(found.time), "entry": float(f"{jitter / si_factor(unit):.2g}")}
    return jitter, [Flag("times_err", found.names.get("time", ""), unit, numbers)]
