"""A deflection on a base that moves as recorded."""

from __future__ import annotations

from dataclasses import replace

import sympy as sp

from discovery.declarations import symbols as s
from discovery.declarations.effect import SHAKEN
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import Student
from discovery.mechanics.base import Channel
from discovery.mechanics.one_coordinate import OneCoordinate
from discovery.mechanics.rod import STRAIGHT


class BaseExcited(OneCoordinate):
    r"""The deflection q of a body of unit inertia from a base that moves by the recorded u(t): q'' = -p u'' + effects.

    Springs and losses act between base and body (Den Hartog, Mechanical Vibrations (1956), section 2.9); the position
    in the fixed frame, which gravity sees, is u + q. The participation p is one for a point mass, and another number
    where q is a measure of how a link or a beam bends (Meirovitch, Fundamentals of Vibrations (2001), section 7.16).
    """

    name = "base_excited"
    input_moves = True
    has = frozenset({SHAKEN})

    p = Parameter("1", "participation of the base's motion", (-100.0, 100.0), Student(3.0), default=1.0, starts=(1.0,))

    @property
    def fixed_frame(self):
        """Position against the ground."""
        return s.theta_m + self.position[0]

    def pull(self):
        """Return -p u''."""
        return -self.p * s.alpha_m

    def mechanics(self, rod=STRAIGHT):
        """Return the mathematics: springs and losses act on the deflection, the rate in the fixed frame holds u'."""
        found = super().mechanics(rod)
        against_ground = Channel(s.omega_m + self.position[1], (sp.Integer(1),), s.alpha_m)
        return replace(found, channels={**found.channels, s.slope_dot: against_ground})


BASE = BaseExcited()
