"""The paper's equation of the angle: a point mass on a circle of radius l, P7 to P9."""

from __future__ import annotations

import sympy as sp

from discovery import symbols as s
from discovery.mechanics.base import ArmBase, Mechanics, lagrangian_mechanics

__all__ = ["BASE", "ConstantRadius"]

_THETA, _OMEGA = sp.symbols("q_1 qd_1", real=True)


class ConstantRadius(ArmBase):
    r"""Tip mass on a circle: T = theta_t'^2 / 2 per unit of m l^2, equations (13) and (15).

    The radius law, where declared, is output only, as in the paper.
    """

    name = "constant_radius"
    n_coordinates = 1

    def mechanics(self) -> Mechanics:
        """Return the mathematics."""
        return lagrangian_mechanics(
            _THETA,
            _OMEGA,
            kinetic=_OMEGA**2 / 2,
            theta=_THETA,
            delta=_THETA - s.theta_m,
            tip=(sp.cos(_THETA), sp.sin(_THETA)),
            speed2=_OMEGA**2,
            radius=sp.Integer(1),
            elastic=(_THETA - s.theta_m) ** 2 / 2,
        )

    def reading(self, closure):
        """Return the tip position in lengths of the arm."""
        rho = sp.Integer(1) if closure is None else closure.subs(s.delta, _THETA - s.theta_m)
        return rho * sp.cos(_THETA), rho * sp.sin(_THETA)


BASE = ConstantRadius()
