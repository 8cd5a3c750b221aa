"""An oscillator whose acceleration is read."""

from __future__ import annotations

from discovery import symbols as s
from discovery.mechanics.one_coordinate import OneCoordinate
from discovery.parameters import Normal, Parameter

__all__ = ["BASE", "Accelerometer"]


class Accelerometer(OneCoordinate):
    r"""A force-driven coordinate, q'' = g u(t) + effects, of which an instrument reads the acceleration q''."""

    name = "accelerometer"
    reads_state = False

    g = Parameter("s^-2 q", "acceleration per unit of input", (-1e4, 1e4), Normal(0.0, 10.0), starts=(1.0,), latex="g")

    def pull(self):
        """Return g u."""
        return self.g * s.u

    def reading(self, closure, rod=None):
        """Return the acceleration."""
        return (s.acceleration,)

    def push(self):
        """Return the same."""
        return self.pull()


BASE = Accelerometer()
