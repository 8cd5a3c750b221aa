"""An oscillator whose acceleration is read."""

from __future__ import annotations

from discovery.declarations import symbols as s
from discovery.mechanics.one_coordinate import ForceDriven


class Accelerometer(ForceDriven):
    r"""A force-driven coordinate, q'' = g u(t) + effects, of which an instrument reads the acceleration q''."""

    name = "accelerometer"
    reads = "acceleration"

    def reading(self, closure, rod=None):
        """Return the acceleration."""
        return (s.acceleration,)


BASE = Accelerometer()
