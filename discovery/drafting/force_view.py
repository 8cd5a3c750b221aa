"""A motion that is imposed, and the force that it takes: the table [view] of a draft."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Sequence

import numpy as np

from discovery.declarations.units import si_symbol
from discovery.drafting.signals import Signals
from discovery.foundation.estimate_text import figures
from discovery.foundation.sampling import median_step
from discovery.recordings.force_view import cutoff_for
from discovery.recordings.reading_noise import filled, spectrum
from discovery.rigs.kinds import KINDS

_FORCE_OF = {"m": "N", "m/s": "N", "rad": "N m", "rad/s": "N m"}
#: Share of the square of a speed below the frequency of a motion, and multiples of that frequency up to which its force
#: counts: friction that turns over has many.
_MOSTLY, _MULTIPLES = 0.9, 20.0
#: Over the cutoff of the force, that of the motion; and of the sampling rate, the largest that is guessed.
_WIDER, _LARGEST = 2.0, 0.4


def is_seen_as_force(found: Signals) -> bool:
    """Return whether what is read is a force or torque, and what is given the motion that takes it."""
    given = None if found.input is None else si_symbol(found.input.unit)
    return _FORCE_OF.get(given or "") == si_symbol(found.output.unit)


def view(recordings: Sequence[Signals], *, third: bool) -> Iterator[str]:
    """Yield the lines of a table [view]; the cutoffs are multiples of the frequency of the fastest motion.

    `third`: whether the last third of each recording is held out.
    """
    frequency, rate = max(map(_frequency, recordings)), 1.0 / median_step(recordings[0].seconds)
    # Of a short recording at a low rate as much is taken as leaves readings enough.
    least = max(cutoff_for(KINDS["oscillator"].fewest + 1, float(np.ptp(r.seconds)), third=third) for r in recordings)
    cutoff = min(max(min(_MULTIPLES * frequency, _LARGEST / _WIDER * rate), least), _LARGEST * rate)
    yield "[view]"
    yield 'output = "force"   # the motion is imposed, and the force that it takes is compared'
    motion = min(_WIDER * cutoff, _LARGEST * rate)
    yield f"motion_cutoff_hz = {figures(motion, 2)}   # guessed: the motion is differentiated below it"
    times = f"{cutoff / frequency:.0f} times the frequency of the motion"
    yield f"cutoff_hz = {figures(cutoff, 2)}   # guessed: about {times}"


def _frequency(found: Signals) -> float:
    """Return the frequency below which most of a speed lies [Hz]."""
    assert found.input is not None
    step = median_step(found.seconds)
    given = filled(found.input.si)
    rate = given if si_symbol(found.input.unit).endswith("/s") else np.gradient(given, step)
    power = np.cumsum(np.abs(spectrum(rate)) ** 2)
    return float(np.searchsorted(power, _MOSTLY * power[-1]) + 1) / (rate.size * step)


def other_way(found: Signals) -> Iterator[str]:
    """Yield how to draft a force that answers, where a force was taken to drive a place."""
    if found.input is None or _FORCE_OF.get(si_symbol(found.output.unit)) != si_symbol(found.input.unit):
        return
    names = (found.path.name, found.input.name, found.output.name)
    file, force, place = map(shlex.quote, names)
    yield "# If a machine imposes the motion, and the force is what it takes:"
    yield f"#     discovery init {file} --output {force} --input {place}"
