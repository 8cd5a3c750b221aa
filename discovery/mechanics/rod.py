r"""The rod as effects change it: its shape at rest, and how its root gives way.

With a rest angle :math:`\theta_0(s)` and a root that turns by c per bending curvature, the rod's slope is

.. math:: \theta(s) = \theta_m + \theta_0(s) + c\, \kappa(0) + \int_0^s \kappa\, d\sigma

and only the bending curvature kappa stores energy, in the rod and in the spring at its root. Lengths are in lengths of
the arm.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache

import sympy as sp

from discovery.declarations.effect import Effect, Shape
from discovery.declarations.symbols import arc


@dataclass(frozen=True)
class ThirdOrder:
    r"""What a rest angle changes when the rod bends by e under a force across its radius, in powers of both."""

    bend: sp.Symbol  # deflection e of the tip that bending causes [rad]
    shortening: sp.Expr  # :math:`1 - \rho_t / l` to second order [-], :math:`e^2/10` for a straight rod
    #: By how much the tip is ahead of the mean slope [rad], third order, :math:`e^3/105` for a straight rod. Bending
    #: that is smaller by this much reaches the same angle, so the energy falls by e times it.
    ahead: sp.Expr


@lru_cache(maxsize=64)
def _third_order(rest: sp.Expr) -> ThirdOrder:
    """Integrate once: effects that leave the rod as it is share its geometry."""
    bend = sp.Symbol("e", real=True)
    slope = rest + sp.Rational(3, 2) * bend * (2 * arc - arc**2)
    first, second, third = (sp.integrate(sp.expand(slope**k), (arc, 0, 1)) for k in (1, 2, 3))
    # x = 1 - <slope^2>/2 and y = <slope> - <slope^3>/6 give radius and angle of the tip.
    shortening = sp.expand(second / 2 - first**2 / 2)
    return ThirdOrder(bend, shortening, sp.expand(first * second / 2 - third / 6 - first**3 / 3))


@dataclass(frozen=True)
class Rod:
    """What effects change of the rod."""

    #: Slope of the unloaded rod against its root [rad], a polynomial in `discovery.declarations.symbols.arc`.
    rest: sp.Expr = sp.S.Zero
    root: sp.Expr = sp.S.Zero  # turn of the root per bending curvature there [-]

    def rest_at(self, place: float) -> sp.Expr:
        """Return the rest angle at an arc length."""
        return self.rest.subs(arc, place)

    def bent(self, deflection: sp.Expr) -> sp.Expr:
        """Return the part of a deflection that the rod itself bends."""
        return (deflection - self.deflection) / (1 + 3 * self.root)

    @property
    def deflection(self) -> sp.Expr:
        """Deflection of the unloaded arm [rad]: the mean of its slope, exact for a uniform curvature."""
        return sp.integrate(self.rest, (arc, 0, 1))

    @property
    def third_order(self) -> ThirdOrder:
        r"""Geometry of the bent rod, with the static shape :math:`\theta_0 + \tfrac32 e\,(2 s - s^2)`."""
        return _third_order(self.rest)


STRAIGHT = Rod()


def rod_of(effects: Iterable[Effect]) -> Rod:
    """Return the rod with the changes of all effects of shape."""
    shapes = [e for e in effects if isinstance(e, Shape)]
    return Rod(sp.Add(*[e.rest_angle() for e in shapes]), sp.Add(*[e.root_turn() for e in shapes]))
