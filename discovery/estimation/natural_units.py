"""Natural units of recordings: the sizes of time, motion and force, in which declarations are plain numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from discovery.declarations.parameters import Parameter, natural_scale
from discovery.declarations.units import dimension
from discovery.foundation.sampling import median_step
from discovery.mechanics.systems import system_base
from discovery.recordings.experiment import Experiment, largest_deflection

__all__ = ["NaturalUnits", "natural_units"]

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class NaturalUnits:
    """Natural time [s], coordinate [q] and length [m] of a problem; declarations are numbers in these."""

    time: float
    coordinate: float
    length: float
    #: Size of the input of an oscillator, in its unit.
    drive: float = 1.0
    #: Of a declared system: name, coordinate, time and inertia of every place.
    places: tuple[tuple[str, float, float, float], ...] = ()
    #: Time in which the recorded force brings a body at rest by the coordinate; None where the motion tells its own.
    push: float | None = None

    def pushed(self, gain: float) -> NaturalUnits:
        """Return the units where the recorded force, by an input gain, may be larger than what the motion asks for.

        A slow or strongly damped motion has small accelerations, and large forces that balance each other.
        """
        largest = abs(gain) * self.drive
        push = float(np.sqrt(self.coordinate / largest)) if largest > 0 else np.inf
        return replace(self, push=push) if push < self.time else self

    def reach(self, place: str) -> float:
        """Return the natural coordinate at a place of a declared system; where there is none, that of the system."""
        return next((q for name, q, *_ in self.places if name == place), self.coordinate)

    def scale(self, parameter: Parameter) -> float:
        """Return the size of one natural unit of a parameter, in the problem's units."""
        if parameter.physical:
            return 1.0
        q, time, weight = self.coordinate, self.time, 1.0
        if parameter.place:
            q, own, weight = next(size for name, *size in self.places if name == parameter.place)
            # Forces are of the size of those there; speeds and ages are those of the motion.
            time = own if parameter.forced else time
        elif self.push is not None and parameter.name != "g" and dimension(parameter.unit).get("s") == -2:
            time = self.push
        unit = natural_scale(parameter.unit, time=time, coordinate=q, length=self.length, drive=self.drive)
        unit *= weight if parameter.forced else 1.0
        # What links a force to an acceleration scales with the size of the recorded force.
        inertia = parameter.name in ("m", "m_0")
        return unit / self.drive if parameter.name == "g" else unit * self.drive if inertia else unit


#: Longest step between stamps that only jitter, over the median one; samples of a periodogram of uneven ones.
_GAP, _UNEVEN = 3.0, 20_000


def natural_units(experiments: Sequence[Experiment]) -> NaturalUnits:
    """Return the natural units of recordings: the inverse dominant angular frequency, amplitude and length.

    The frequency is that of the largest peak of the pooled periodogram of the deflection; an arm's natural angle is
    one radian, because its geometry is nonlinear on that scale.
    """
    frequencies = [_dominant(*_finite(e)) for e in experiments]
    arm = experiments[0].system.has_rod
    length = experiments[0].rig.length
    forces = [e.force for e in experiments if e.force is not None]
    time = 1.0 / float(np.median(frequencies))
    drive = 1.0 if arm or not forces else float(max(np.nanmax(np.abs(u)) for u in forces))
    return NaturalUnits(
        time=time,
        coordinate=1.0 if arm else largest_deflection(experiments) * time ** (2 * experiments[0].reads_acceleration),
        length=length.value if length is not None else 1.0,
        drive=drive,
        places=_places(experiments, 1.0 / time, drive),
    )


def _places(
    experiments: Sequence[Experiment], frequency: float, drive: float
) -> tuple[tuple[str, float, float, float], ...]:
    """Return name, coordinate, time and inertia of every place of a declared system."""
    system = experiments[0].rig.system
    if system is None:
        return ()
    base = system_base(system)
    sizes = base.sizes(frequency, drive, largest_deflection(experiments))
    return tuple((name, *size, base.places()[name].inertia) for name, size in sizes.items())


def _finite(experiment: Experiment) -> tuple[FloatArray, FloatArray]:
    """Return times and deflections of the fitted samples without gaps, about their mean."""
    time, deflection = experiment.recording.time[experiment.fitted], experiment.deflection[experiment.fitted]
    good = np.isfinite(deflection)
    return time[good], deflection[good] - deflection[good].mean()


def _dominant(time: FloatArray, deflection: FloatArray) -> float:
    """Return the angular frequency of the largest peak of a periodogram, from two periods in the recording on."""
    steps, span = np.diff(time), time[-1] - time[0]
    if not np.allclose(steps, steps.mean(), rtol=1e-3):
        if steps.max() >= _GAP * np.median(steps):
            return _dominant_of_uneven(time, deflection)
        # Stamps that jitter: the spectrum of a motion that is far slower does not feel it.
        deflection = np.interp(np.linspace(time[0], time[-1], time.size), time, deflection)
    power = np.abs(np.fft.rfft(deflection * np.hanning(deflection.size), 4 * deflection.size)) ** 2
    grid = 2 * np.pi * np.fft.rfftfreq(4 * deflection.size, float(steps.mean()))
    first = int(np.searchsorted(grid, 4 * np.pi / span))
    return float(grid[first + np.argmax(power[first:])])


def _dominant_of_uneven(time: FloatArray, deflection: FloatArray) -> float:
    """Return the same of uneven times, by the periodogram of Lomb."""
    from scipy.signal import lombscargle

    keep = slice(None, None, max(1, time.size // _UNEVEN))
    grid = np.linspace(4 * np.pi / (time[-1] - time[0]), 0.5 * np.pi / median_step(time[keep]), 4000)
    return float(grid[np.argmax(lombscargle(time[keep], deflection[keep], grid))])
