"""A unit inertia with a measured force-like input or none."""

from __future__ import annotations

import numpy as np
import sympy as sp

from discovery import symbols as s
from discovery.effect import OSCILLATOR
from discovery.mechanics.base import Base, Mechanics, lagrangian_mechanics
from discovery.mechanics.rod import STRAIGHT
from discovery.parameters import Normal, Parameter

__all__ = ["BASE", "Oscillator"]

_Q, _QD = sp.symbols("q_1 qd_1", real=True)


class Oscillator(Base):
    r"""One coordinate q with unit inertia: q'' = g u(t) + effects, with the recorded input u (none in a free decay)."""

    name = "oscillator"
    system = OSCILLATOR
    n_coordinates = 1

    g = Parameter("s^-2 q", "acceleration per unit of input", (-1e4, 1e4), Normal(0.0, 10.0), starts=(1.0,), latex="g")

    def mechanics(self, rod=STRAIGHT) -> Mechanics:
        """Return the mathematics."""
        bare = lagrangian_mechanics(
            _Q,
            _QD,
            kinetic=_QD**2 / 2,
            theta=_Q,
            delta=_Q,
            tip=(_Q, sp.Integer(0)),
            speed2=_QD**2,
            # The lever of a force across the tip: a force on a coordinate has none.
            radius=sp.Integer(1),
            bend=_Q,
            elastic=_Q**2 / 2,
            quartic=_Q**4 / 4,
            slope=_Q,
        )
        return Mechanics(
            bare.coordinates,
            bare.rates,
            (),
            bare.channels,
            bare.mass,
            (bare.force[0] + self.g * s.u,),
            bare.bending,
            ((1, bare.bending[0]),),
        )

    def reading(self, closure, rod=STRAIGHT):
        """Return the coordinate."""
        return (_Q,)

    def initial_coordinates(self, deflection, rate, drive, form=(0, 0)):
        """Return the coordinate and its rate."""
        return np.asarray(deflection)[None], np.asarray(rate)[None]


BASE = Oscillator()
