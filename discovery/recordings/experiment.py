"""A recording made ready for simulation: its smooth drive, its noise, and how readings become its channels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from discovery.declarations.parameters import Parameter
from discovery.declarations.system import System
from discovery.declarations.units import in_coordinate
from discovery.foundation.arguments import check_whole
from discovery.foundation.arrays import FloatArray, within_half_a_turn
from discovery.foundation.start_names import start_name
from discovery.recordings.force_view import sampling_rate, zero_phase
from discovery.recordings.recording import Recording
from discovery.rigs.rig import Rig
from discovery.simulation.grid import DriveLike, Pace

#: Readings among which a channel is first read, if what it begins with is to be told.
_LATE = 8


@dataclass(frozen=True, repr=False)
class Experiment:
    """One recording with its smooth input."""

    recording: Recording
    drive: DriveLike | None
    rig: Rig
    #: Only so many samples, from the first, are fitted; the rest is held out. None: all. Of a recording that is held
    #: out as a whole its start alone is fitted, to these.
    fitted_samples: int | None = None
    pace: Pace | None = None  # where the steps of its simulations are shorter than elsewhere; None: nowhere

    def __repr__(self) -> str:
        """Return the recording, its rig and how much of it is fitted."""
        size = self.recording.time.size
        part = f", {self.fitted_samples} of them fitted" if self.fitted_samples is not None else ""
        return f"<Experiment {self.recording.name!r} of {self.rig.name!r} ({self.rig.kind}): {size} readings{part}>"

    @property
    def fitted(self) -> slice:
        """Samples that may be fitted."""
        return slice(0, self.fitted_samples)

    @property
    def initial_names(self) -> tuple[str, str]:
        """Names of the deflection and the rate at its first sample, as a fit has them beside its parameters."""
        return start_name("delta", self.recording.name), start_name("rate", self.recording.name)

    def first(self, count: int) -> Experiment:
        """Return the experiment of the first so many samples, at least one, all of them fitted."""
        check_whole(count, "count", 1)
        return replace(self, recording=self.recording.part(slice(count)), fitted_samples=None)

    def beginning(self, count: int, least: int) -> Experiment:
        """Return the first so many samples as `first` does, or more: enough to hold `least` readings between gaps."""
        present = np.flatnonzero(np.isfinite(self.recording.output[self.fitted]).any(axis=1))[:least]
        held = int(present[-1]) + 1 if present.size else 0
        return self.first(max(least, held, count))

    @property
    def fitted_part(self) -> Experiment:
        """The experiment to its last fitted sample: no residual needs more, but where readings pass a filter."""
        cut = self.fitted_samples and self.rig.view is None
        return self.first(len(self.recording.time[self.fitted])) if cut else self

    @property
    def system(self) -> System:
        """Kind of system."""
        return System.of(self.rig.kind)

    @cached_property
    def motor_angle(self) -> FloatArray:
        """Smooth motor angle at the samples [rad], zeros for an oscillator, shape (n,)."""
        if not self.system.has_rod or self.drive is None:
            return np.zeros(self.recording.time.size)
        return self.drive.evaluate(self.recording.time)[0]

    def channels(self, reading: FloatArray) -> FloatArray:
        """Return the recorded channels (n, c, k) for simulated readings (n, r, k).

        A reading is tip x, y [m] of an arm, or what another system reads.
        """
        names = self.recording.channels
        if self.rig.view is not None:
            # The computed force passes the low-pass that the measured one did.
            return zero_phase(reading, self._rate, self.rig.view.cutoff)
        if names == ("tip_x", "tip_y") or not self.system.has_rod:
            return reading
        x, y = reading[:, 0], reading[:, 1]
        if names == ("tip_angle",):
            # The turn nearest to the motor: a tip cannot be half a turn ahead of its hub.
            base = self.motor_angle[:, None]
            return (base + (np.arctan2(y, x) - base + np.pi) % (2 * np.pi) - np.pi)[:, None]
        c, s = np.cos(self.motor_angle)[:, None], np.sin(self.motor_angle)[:, None]
        return (c * y - s * x)[:, None]

    @cached_property
    def _rate(self) -> float:
        return sampling_rate(self.recording.time, self.recording.source)

    @property
    def force(self) -> FloatArray | None:
        """What was recorded of the force on an oscillator, shape (n,): its input, or the output of inverse dynamics."""
        return self.recording.input if self.rig.view is None else self.recording.output[:, 0]

    @property
    def reads_acceleration(self) -> bool:
        """Whether the output is the second derivative of the coordinate."""
        return self.rig.columns.output.reads == "acceleration"

    @property
    def coordinate_unit(self) -> str:
        """SI unit of the coordinate."""
        return in_coordinate("q s^2", self.deflection_unit) if self.reads_acceleration else self.deflection_unit

    @property
    def deflection_unit(self) -> str:
        """SI unit of `deflection`: of the coordinate, or of the acceleration that is read."""
        return self.reading_unit if self.rig.view is None else self.input_unit

    @property
    def reading_unit(self) -> str:
        """SI unit of what is read; of an arm, whose frame turns, that of an angle."""
        return self.system.coordinate_unit(self.recording.units[0])

    @property
    def input_unit(self) -> str:
        """SI unit of the recorded input; empty without one."""
        return self.rig.input_unit

    def unit_of(self, parameter: Parameter) -> str:
        """Return the SI unit of the values of a parameter."""
        coordinate = self.reading_unit if parameter.read else self.coordinate_unit
        return in_coordinate(parameter.value_unit, coordinate, self.input_unit or "u")

    @cached_property
    def deflection(self) -> FloatArray:
        """Measured deflection theta_t - theta_m [rad] (an oscillator: its coordinate), NaN in gaps, shape (n,)."""
        if self.rig.view is not None and self.recording.input is not None:
            return self.recording.input
        out = self.recording.output
        names = self.recording.channels
        if names == ("tip_x", "tip_y"):
            return within_half_a_turn(np.arctan2(out[:, 1], out[:, 0]) - self.motor_angle)
        if names == ("tip_angle",):
            return out[:, 0] - self.motor_angle
        if names == ("tip_deflection",):
            assert self.rig.length is not None
            return np.arcsin(np.clip(out[:, 0] / self.rig.length.value, -1, 1))
        return out[:, 0]

    @cached_property
    def initial_guess(self) -> tuple[float, float]:
        """Deflection and its rate at the first sample, from a parabola through the first samples; rest if not read."""
        return (0.0, 0.0) if self.reads_acceleration else self._first_reading

    def initial_state(self, natural_time: float) -> tuple[float, float]:
        """Return where a fit begins: `initial_guess`, or of a free swing whose acceleration is read, what swings so.

        `natural_time` is the inverse angular frequency of the swing [s].
        """
        if not self.reads_acceleration or self.drive is not None:
            return self.initial_guess
        acceleration, rate = self._first_reading
        read = self.deflection[np.isfinite(self.deflection)]
        middle = float(read.mean()) if read.size else 0.0
        return (middle - acceleration) * natural_time**2, -rate * natural_time**2

    @cached_property
    def _first_reading(self) -> tuple[float, float]:
        """Reading and its rate at the first sample; zero where nothing was read."""
        lever = self.rig.length.value if self.rig.length else 1.0
        noise = np.nanmax(self.recording.noise[self.recording.judged]) / lever
        return _begins(self.recording.time, self.deflection, noise)

    @cached_property
    def first_readings(self) -> FloatArray:
        """First value of every channel, and its rate, shape (c, 2); NaN of one that is not read among the first."""
        r = self.recording
        first = np.asarray(np.isfinite(r.output[:_LATE]).any(axis=0))
        found = np.array([_begins(r.time, read, noise) for read, noise in zip(r.output.T, r.noise, strict=True)])
        return np.where(first[:, None], found, np.nan)

    def weights(self) -> FloatArray:
        """Return 1/noise of every fitted sample and channel, zero in gaps and held-out parts, shape (n, c)."""
        out = self.recording.output
        weights = np.where(np.isfinite(out), 1.0 / self.recording.scatter, 0.0)
        if self.fitted_samples is not None:
            weights[self.fitted_samples :] = 0.0
        return weights


def _begins(t: FloatArray, d: FloatArray, noise: float) -> tuple[float, float]:
    """Return what a parabola through the first readings (n,) gives at the first time, and its slope there."""
    good = np.flatnonzero(np.isfinite(d))
    if not good.size:
        return 0.0, 0.0
    first = good[: max(4, min(9, good.size))]
    # More samples while a parabola still describes them within the noise.
    for count in (16, 32, 64):
        if count > good.size:
            break
        part = good[:count]
        line = np.polynomial.Polynomial.fit(t[part], d[part], 2)
        if np.std(d[part] - line(t[part])) > 1.5 * noise:
            break
        first = part
    fit = np.polynomial.Polynomial.fit(t[first], d[first], min(2, first.size - 1))
    return float(fit(t[0])), float(fit.deriv()(t[0]))


def make_experiment(recording: Recording, rig: Rig, *, fitted_samples: int | None = None) -> Experiment:
    """Return the experiment of a recording: its input is made smooth here, once."""
    from discovery.recordings.smooth_input import build_drive

    return Experiment(recording, build_drive(recording, rig), rig, fitted_samples)


def largest_deflection(experiments: Sequence[Experiment], *, whole: bool = False) -> float:
    """Return the largest measured deflection of the fitted samples, or of all [q], robust against single outliers."""
    parts = [e.deflection if whole else e.deflection[e.fitted] for e in experiments]
    return max(float(np.nanquantile(np.abs(part), 0.999)) for part in parts)
