"""The force that a recorded motion takes."""

from __future__ import annotations

import sympy as sp

from discovery.declarations import symbols as s
from discovery.declarations.effect import ROTOR
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import LogNormal
from discovery.mechanics.one_coordinate import OneCoordinate


class InverseDynamics(OneCoordinate):
    r"""A body whose motion u(t) is recorded; what is read is the force that it takes.

    .. math:: F = m \ddot u - m_0\, \text{effects}(u, \dot u)

    The effects are forces over a reference inertia m_0, the recorded force over the natural acceleration: a force is
    then known as well as the recording tells it, however little the inertia shows beside it. Nothing is integrated but
    the memory of effects, and there is no initial state (Gautier, Janot and Vandanjon, IEEE Transactions on Control
    Systems Technology 21 (2013) 428, the inverse dynamic identification model). A late instrument would be a motion
    that is early: those effects are not offered here, nor an offset or drift of the force beside `constant_force`.
    """

    name = "inverse_dynamics"
    has = frozenset({ROTOR})
    reads = "force"
    input_moves = True
    prescribed = True
    provides = frozenset(
        {"sensor_delay", "time_base_error", "position_scale", "perspective", "angle_offset", "zero_drift"}
    )

    m = Parameter(
        "s^2 q^-1", "inertia: force per acceleration", (1e-6, 1e6), LogNormal(1.0, 3.0), default=1.0, starts=(1.0,)
    )
    m_0 = Parameter(
        "s^2 q^-1", "reference inertia: the effects are forces over it", (1e-6, 1e6), LogNormal(1.0, 3.0), default=1.0,
        fixed=True,
    )  # fmt: skip

    @property
    def position(self):
        """The recorded motion and its rate."""
        return s.theta_m, s.omega_m

    def pull(self):
        """Return nothing: the body moves as it did."""
        return sp.Integer(0)

    def reading(self, closure, rod=None):
        """Return the force."""
        return (self.m * s.alpha_m - self.m_0 * s.acceleration,)


BASE = InverseDynamics()
