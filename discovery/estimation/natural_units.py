"""Natural units of recordings: the sizes of time, motion and force, in which declarations are plain numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from discovery.declarations.parameters import Parameter, natural_scale
from discovery.declarations.units import dimension
from discovery.foundation.arrays import FloatArray
from discovery.foundation.sampling import median_step
from discovery.mechanics.place_sizes import place_sizes
from discovery.mechanics.systems import system_base
from discovery.recordings.experiment import Experiment, largest_deflection


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
    #: Time in which the largest known force, recorded or gravity, brings a body at rest by the coordinate; None where
    #: the motion tells its own.
    push: float | None = None
    #: Time in which the motion goes by the coordinate at its speed; that of its swings where there is None.
    passage: float | None = None
    #: Size of what is read; that of the coordinate where there is None.
    reading: float | None = None
    swept: float = 1.0  #: Part of the way from one side of zero to the other that is travelled.
    passes: float = 1.0  #: How often it is travelled in a recording.

    def pushed(self, gain: float) -> NaturalUnits:
        """Return the units where the recorded force, by an input gain, may be larger than what the motion asks for.

        A slow or strongly damped motion has small accelerations, and large forces that balance each other.
        """
        largest = abs(gain) * self.drive
        push = float(np.sqrt(self.coordinate / largest)) if largest > 0 else np.inf
        return replace(self, push=push) if push < self.time else self

    @property
    def read(self) -> float:
        """Size of what is read, in its unit."""
        return self.coordinate if self.reading is None else self.reading

    def reach(self, place: str) -> float:
        """Return half of the way that is travelled at a place of a declared system; without one, by the system."""
        return self.swept * next((q for name, q, *_ in self.places if name == place), self.coordinate)

    def scale(self, parameter: Parameter) -> float:
        """Return the size of one natural unit of a parameter, in the problem's units."""
        if parameter.physical:
            return 1.0
        q, time, weight = self.coordinate, self.time, 1.0
        if parameter.read:
            q = self.read
        elif parameter.place:
            q, own, inertia = next(size for name, *size in self.places if name == parameter.place)
            # Forces are of the size of those there; speeds and ages are those of the motion.
            time, weight = (own, inertia) if parameter.forced else (time, 1.0)
        elif self.push is not None and parameter.name != "g" and _weighs_force(parameter):
            # A force over powers of the speed: the force is that of the push, the speed that of the motion.
            time = self.passage or self.time
            weight = (time / self.push) ** 2
        unit = natural_scale(parameter.unit, time=time, coordinate=q, length=self.length, drive=self.drive)
        # What links a force to an acceleration scales with the size of the recorded force.
        given = {"g": 1.0 / self.drive, "m": self.drive, "m_0": self.drive}.get(parameter.name, 1.0)
        return unit * weight * given


def _weighs_force(parameter: Parameter) -> bool:
    """Return whether a parameter is that of a force, over the square of the time or the speed once or twice."""
    unit = dimension(parameter.unit)
    return not parameter.shape and (unit.get("s") in (-2, -1) or unit == {"q": -1})


#: Longest step between stamps that only jitter, over the median one; samples of a periodogram of uneven ones.
_GAP, _UNEVEN = 3.0, 20_000
_PARTS_OF_A_FALL = 4


def natural_units(experiments: Sequence[Experiment]) -> NaturalUnits:
    """Return the natural units of recordings: the inverse dominant angular frequency, amplitude and length.

    The frequency is that of the largest peak of the pooled periodogram of the deflection; an arm's natural angle is
    one radian, because its geometry is nonlinear on that scale.
    """
    motions = [_finite(e) for e in experiments]
    frequencies = [_dominant(*motion) for motion in motions]
    arm = experiments[0].system.has_rod
    # The way of a body is seen where its place is read.
    placed = not arm and "/s" not in experiments[0].coordinate_unit
    length = experiments[0].rig.length
    forces = [e.force for e in experiments if e.force is not None]
    time = 1.0 / float(np.median(frequencies))
    drive = 1.0 if arm or not forces else float(max(np.nanmax(np.abs(u)) for u in forces))
    deflection = largest_deflection(experiments)
    units = NaturalUnits(
        time=time,
        coordinate=1.0 if arm else deflection * time ** (2 * experiments[0].reads_acceleration),
        length=length.value if length is not None else 1.0,
        drive=drive,
        places=_places(experiments, 1.0 / time, drive),
        reading=1.0 if arm else drive if experiments[0].rig.view is not None else deflection,
        swept=_swept(experiments, deflection) if placed else 1.0,
        passes=max(_passes(*motion, time) for motion in motions) if placed else 1.0,
    )
    gravity = experiments[0].rig.gravity
    if gravity is None or not experiments[0].rig.traits.falls:
        return units
    return _falling(units, experiments, gravity.value)


def _swept(experiments: Sequence[Experiment], deflection: float) -> float:
    """Return the part of the way from one side of zero to the other that is travelled: half of it to one side."""
    ends = [np.nanquantile(e.deflection[e.fitted], (0.001, 0.999)) for e in experiments]
    return float(np.clip(max(high - low for low, high in ends) / max(2 * deflection, 1e-300), 0.0, 1.0))


def _passes(time: FloatArray, deflection: FloatArray, natural: float) -> float:
    """Return how often a way is travelled from one end to the other, by places a natural time apart."""
    seen = np.interp(np.arange(time[0], time[-1], natural), time, deflection)
    span = float(np.ptp(seen))
    return max(1.0, float(np.abs(np.diff(seen)).sum()) / span) if span > 0.0 else 1.0


def _falling(units: NaturalUnits, experiments: Sequence[Experiment], gravity: float) -> NaturalUnits:
    """Return the units of a fall: its forces are those of gravity, its speed is the largest of a part of it."""
    fastest = 0.0
    for e in experiments:
        time, height = _finite(e)
        ends = np.linspace(0, time.size - 1, _PARTS_OF_A_FALL + 1).astype(int)
        fastest = max(fastest, float(np.max(np.abs(np.diff(height[ends]) / np.diff(time[ends])))))
    return replace(units, push=float(np.sqrt(units.coordinate / gravity)), passage=units.coordinate / fastest)


def _places(
    experiments: Sequence[Experiment], frequency: float, drive: float
) -> tuple[tuple[str, float, float, float], ...]:
    """Return name, coordinate, time and inertia of every place of a declared system."""
    system = experiments[0].rig.system
    if system is None:
        return ()
    base = system_base(system)
    sizes = place_sizes(base, frequency, drive, largest_deflection(experiments))
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
