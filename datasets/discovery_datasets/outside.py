"""Trouble that no catalogue of effects describes: what a laboratory has, and no textbook term stands for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from discovery_datasets.quick_effects import QuickDisturbance

FloatArray = NDArray[np.float64]


def _half_sine(time: FloatArray, start: float, duration: float) -> FloatArray:
    phase = (time - start) / duration
    return np.where((phase > 0) & (phase < 1), np.sin(np.pi * np.clip(phase, 0, 1)), 0.0)


@dataclass(frozen=True)
class Magnet(QuickDisturbance):
    """Screw under the table that attracts the disc to (x, y) [m] within `radius` [m], with `pull` [N]."""

    x: float
    y: float
    radius: float
    pull: float
    id: ClassVar[str] = "magnet"
    acts: ClassVar[Mapping[str, str]] = {"place_x": "x", "place_y": "y", "place_radius": "radius", "place_pull": "pull"}


@dataclass(frozen=True)
class RoughPlace(QuickDisturbance):
    """Table whose air holes are blocked about (x, y) within `radius` [m]: dry friction of up to `force` [N] there."""

    x: float
    y: float
    radius: float
    force: float
    id: ClassVar[str] = "rough_place"
    acts: ClassVar[Mapping[str, str]] = {
        "place_x": "x",
        "place_y": "y",
        "place_radius": "radius",
        "place_friction": "force",
    }


@dataclass(frozen=True)
class StickyPlace(RoughPlace):
    """The same on a small spot: tape on the table."""

    id: ClassVar[str] = "sticky_place"


@dataclass(frozen=True)
class Cable(QuickDisturbance):
    """Cable to the disc, slack until the hub has turned beyond `slack` [rad] from zero on either side.

    Then it pulls towards (x, y) [m] with `stiffness` [N/rad].
    """

    x: float
    y: float
    slack: float
    stiffness: float
    id: ClassVar[str] = "cable"
    acts: ClassVar[Mapping[str, str]] = {"anchor_x": "x", "anchor_y": "y"}

    def tension(self, hub_angle: FloatArray) -> FloatArray:
        """See the base class."""
        return self.stiffness * np.maximum(np.abs(hub_angle) - self.slack, 0.0)


@dataclass(frozen=True)
class Bump(QuickDisturbance):
    """Something runs into the disc once, at `time` [s] for `duration` [s], with `force` [N] along `direction` [rad]."""

    time: float
    duration: float
    force: float
    direction: float
    id: ClassVar[str] = "bump"

    def push(self, time: FloatArray) -> NDArray[np.complex128]:
        """See the base class."""
        return self.force * np.exp(1j * self.direction) * _half_sine(time, self.time, self.duration)


@dataclass(frozen=True)
class Gust(Bump):
    """The same for half a second: a door is opened."""

    id: ClassVar[str] = "gust"


@dataclass(frozen=True)
class DrippingMass(QuickDisturbance):
    """Tip that loses `drop` [kg] at each of the `times` [s]."""

    drop: float
    times: tuple[float, ...]
    id: ClassVar[str] = "dripping_mass"

    def lost_mass(self, time: FloatArray) -> FloatArray:
        """See the base class."""
        return self.drop * np.searchsorted(np.asarray(self.times), time).astype(np.float64)


@dataclass(frozen=True)
class PulsingAir(QuickDisturbance):
    """Air supply that pulses irregularly: jets push the disc with `force` [N], the direction turning with the pressure.

    The pressure is a sum of sines of the given `frequencies` [rad/s] and `phases` [rad].
    """

    force: float
    direction: float
    frequencies: tuple[float, ...]
    phases: tuple[float, ...]
    id: ClassVar[str] = "pulsing_air"

    def pressure(self, time: FloatArray) -> FloatArray:
        """Pressure about its mean, of about unit size."""
        frequencies, phases = np.array(self.frequencies), np.array(self.phases)
        return np.sin(np.multiply.outer(time, frequencies) + phases).mean(axis=-1) * np.sqrt(2 * frequencies.size)

    def push(self, time: FloatArray) -> NDArray[np.complex128]:
        """See the base class."""
        pressure = self.pressure(time)
        return self.force * pressure * np.exp(1j * (self.direction + 0.7 * pressure))

    def friction_factor(self, time: FloatArray) -> FloatArray:
        """See the base class."""
        return np.exp(-0.5 * self.pressure(time)) if self.force else np.ones(time.shape)


OUTSIDE = {kind.id: kind for kind in (Magnet, RoughPlace, StickyPlace, Cable, Bump, Gust, DrippingMass, PulsingAir)}
"""Trouble outside every catalogue, by name."""
