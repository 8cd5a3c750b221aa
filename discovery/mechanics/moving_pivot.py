"""A pendulum on a pivot that is moved as recorded."""

from __future__ import annotations

import sympy as sp

from discovery.declarations import symbols as s
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import Student
from discovery.mechanics.one_coordinate import OneCoordinate


class MovingPivot(OneCoordinate):
    r"""A pendulum whose pivot is moved along a level line by the recorded u(t): q'' = -p cos(q) u'' + effects.

    Pivot and pendulum turn against each other by the angle q from hanging, which gravity sees as well: what is shifted
    does not turn. The participation p is one over the length of the simple pendulum that swings alike, positive where a
    positive u moves the pivot to the side of positive q (Goldstein, Classical Mechanics, 2nd edition, section 1-6).
    """

    name = "moving_pivot"
    input_moves = True
    pivots = True

    p = Parameter("q m^-1", "turn per shift of the pivot", (-1e3, 1e3), Student(10.0), default=1.0, starts=(1.0, -1.0))

    def pull(self):
        """Return -p cos(q) u''."""
        return -self.p * sp.cos(self.position[0]) * s.alpha_m


BASE = MovingPivot()
