"""A body that falls."""

from __future__ import annotations

from discovery.declarations.effect import WEIGHT
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import Normal
from discovery.mechanics.one_coordinate import OneCoordinate


class FallingBody(OneCoordinate):
    r"""A body of unit inertia at the height q under gravity: q'' = -g_0 + effects."""

    name = "falling_body"
    anchored = False
    has = frozenset({WEIGHT})
    #: Nothing rubs against it.
    provides = frozenset({"coulomb_friction", "friction_through_play", "constant_force"})

    g_0 = Parameter(
        "s^-2 q", "gravitational acceleration", (0.0, 100.0), Normal(9.8, 0.1), default=9.80665, fixed=True, latex="g_0"
    )

    def pull(self):
        """Return -g_0."""
        return -self.g_0


BASE = FallingBody()
