"""The paper's equation of the angle: a point mass on a circle of radius l, P7 to P9."""

from __future__ import annotations

import sympy as sp

from discovery.declarations import symbols as s
from discovery.mechanics.base import ROOT_JOINTS, ArmBase, Mechanics
from discovery.mechanics.lagrangian import lagrangian_mechanics
from discovery.mechanics.rod import STRAIGHT, Rod

_THETA, _OMEGA = sp.symbols("q_1 qd_1", real=True)


class ConstantRadius(ArmBase):
    r"""Tip mass on a circle: T = theta_t'^2 / 2 per unit of m l^2, equations (13) and (15).

    The radius law, where declared, is output only, as in the paper, and knows the bending alone. The rod bends in the
    static shape of a small force, with the curvature 3 (1 - s) e for a bending of e. A spring at its root only softens
    alpha and gamma.
    """

    name = "constant_radius"
    in_library = True
    n_coordinates = 1
    provides = frozenset({"base_compliance", *ROOT_JOINTS})

    def derive(self, rod: Rod) -> Mechanics:
        """Return the mathematics, derived anew."""
        bend = rod.bent(_THETA - s.theta_m)
        return lagrangian_mechanics(
            _THETA,
            _OMEGA,
            kinetic=_OMEGA**2 / 2,
            theta=_THETA,
            delta=_THETA - s.theta_m,
            tip=(sp.cos(_THETA), sp.sin(_THETA)),
            speed2=_OMEGA**2,
            radius=sp.Integer(1),
            bend=bend,
            elastic=(1 + 3 * rod.root) * bend**2 / 2,
            quartic=sp.Rational(27, 20) * bend**4,
            slope=s.theta_m + rod.rest_at(1) + (sp.Rational(3, 2) + 3 * rod.root) * bend,
        )

    def reading(self, closure, rod=STRAIGHT):
        """Return the tip position in lengths of the arm."""
        rho = sp.Integer(1) if closure is None else closure.subs(s.delta, rod.bent(_THETA - s.theta_m))
        return rho * sp.cos(_THETA), rho * sp.sin(_THETA)


BASE = ConstantRadius()
