"""A unit inertia with a measured force-like input or none."""

from __future__ import annotations

from discovery import symbols as s
from discovery.mechanics.one_coordinate import OneCoordinate
from discovery.parameters import Normal, Parameter

__all__ = ["BASE", "Oscillator"]


class Oscillator(OneCoordinate):
    r"""One coordinate q with unit inertia: q'' = g u(t) + effects, with the recorded input u (none in a free decay)."""

    name = "oscillator"

    g = Parameter("s^-2 q", "acceleration per unit of input", (-1e4, 1e4), Normal(0.0, 10.0), starts=(1.0,), latex="g")

    def pull(self):
        """Return g u."""
        return self.g * s.u

    def push(self):
        """Return the same."""
        return self.pull()


BASE = Oscillator()
