"""What systems with one coordinate share: a body of unit inertia on a line or about an axis."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np
import sympy as sp

from discovery.declarations import symbols as s
from discovery.declarations.effect import OSCILLATOR
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import Student
from discovery.mechanics.base import Base, Channel, Mechanics
from discovery.mechanics.lagrangian import lagrangian_mechanics
from discovery.mechanics.rod import STRAIGHT

_Q, _QD = sp.symbols("q_1 qd_1", real=True)


class OneCoordinate(Base):
    """A coordinate q with unit inertia: q'' = pull + effects."""

    system = OSCILLATOR
    n_coordinates = 1
    # A spring rests elsewhere under a constant force (`equilibrium_offset`); play is a drive's.
    provides = frozenset({"constant_force", "friction_through_play"})

    @property
    def position(self) -> tuple[sp.Expr, sp.Expr]:
        """The coordinate and its rate, as effects see them."""
        return _Q, _QD

    @property
    def fixed_frame(self) -> sp.Expr:
        """Position against the ground."""
        return self.position[0]

    @abstractmethod
    def pull(self) -> sp.Expr:
        """Return the acceleration of the bare body [q s^-2]."""

    def push(self) -> sp.Expr | None:
        """Return the same where an input alone makes it; a controller's also depends on what is read."""
        symbols = self.pull().free_symbols
        return self.pull() if symbols & {s.u, s.alpha_m} and not symbols & {_Q, _QD} else None

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
        seen = dict(zip((_Q, _QD), self.position, strict=True))
        ground = {_Q: self.fixed_frame}

        def moved(channel: Channel, frame: dict[sp.Symbol, sp.Expr]) -> Channel:
            value, *jacobian = (sp.sympify(e).xreplace(frame) for e in (channel.value, *channel.jacobian))
            return Channel(value, tuple(jacobian), channel.bias)

        absolute = (s.theta, s.slope)
        channels = {c: moved(channel, ground if c in absolute else seen) for c, channel in bare.channels.items()}
        value, rate, jacobian = bare.bending[0]
        bending = (value.xreplace(seen), rate.xreplace(seen), jacobian)
        return Mechanics(
            bare.coordinates,
            bare.rates,
            assignments=(),
            channels=channels,
            mass=bare.mass,
            force=(self.pull(),),
            bending=(bending,),
            fibres=((1, bending),),
        )

    def reading(self, closure, rod=STRAIGHT):
        """Return the coordinate."""
        return (self.position[0],)

    def initial_coordinates(self, deflection, rate, drive, form=(0, 0)):
        """Return the coordinate and its rate."""
        return np.asarray(deflection)[None], np.asarray(rate)[None]


class ForceDriven(OneCoordinate):
    """A coordinate under the recorded input u: q'' = g u(t) + effects."""

    gain = "g"

    g = Parameter("s^-2 q", "acceleration per unit of input", (-1e4, 1e4), Student(10.0), starts=(1.0,), latex="g")

    @property
    def adrift(self) -> bool:
        """Whether the position is read."""
        return self.reads_state

    def pull(self) -> sp.Expr:
        """Return g u."""
        return self.g * s.u
