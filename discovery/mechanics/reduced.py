"""The mass on the radius law, third order, without a free parameter."""

from __future__ import annotations

import sympy as sp

from discovery.declarations import symbols as s
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import Normal
from discovery.mechanics.base import RADIUS_LAWS, ROOT_JOINTS, SHORTENING_RADIUS, ArmBase, Mechanics
from discovery.mechanics.lagrangian import lagrangian_mechanics
from discovery.mechanics.rod import STRAIGHT, Rod

_THETA, _OMEGA = sp.symbols("q_1 qd_1", real=True)
#: Small-deflection elastica under a force across the radius: rho/l = 1 - delta^2/10 + ... = cos(delta/sqrt 5) + ...
_GAMMA = 1 / sp.sqrt(5)


def rod_coupling(mu: sp.Expr) -> sp.Expr:
    """Return A = 11 mu / (2 (140 + 33 mu)), the coupling of the motor's acceleration through the rod's mass."""
    return 11 * mu / (2 * (140 + 33 * mu))


def rod_inertia(mu: sp.Expr) -> sp.Expr:
    """Return C = 8 mu / (3 (140 + 33 mu)), the inertia of the rod's turn with the hub while its tip rests."""
    return 8 * mu / (3 * (140 + 33 * mu))


class Reduced(ArmBase):
    r"""Point mass moving along the elastica's radius law, (16) with gamma = 1/sqrt 5: the kinetic energy behind (8).

    .. math:: T = \tfrac12(\rho^2\dot\theta_t^2 + \rho'^2\dot\delta^2) + A\,\dot\theta_t\dot\theta_m
              + \tfrac12 C\,\dot\theta_m^2,\qquad U = \tfrac12\delta^2 - \tfrac{1}{105}\delta^4

    The generalised force on delta is rho F_t, by (5) with F_n = 3 delta + (13/70) delta^3, hence U; expanded to third
    order the terms are c1 = 1/5, c2 = -2/5, c3 = 1/25 and beta = 0.122 alpha (`docs/MECHANICS.md`). C moves
    the motor only, not the tip. A curved or compliant rod has its radius and energy to the same order, see
    `discovery.mechanics.rod`.
    """

    name = "reduced"
    n_coordinates = 1
    provides = frozenset({"cubic_stiffness", "distributed_mass", *RADIUS_LAWS, *ROOT_JOINTS, *SHORTENING_RADIUS})

    mu = Parameter("1", "rod mass over tip mass", (0.0, 2.0), Normal(0.2, 0.2), fixed=True, latex=r"\mu")

    def _radius(self, rod: Rod) -> sp.Expr:
        """Return rho/l."""
        form = rod.third_order
        curved = form.shortening - STRAIGHT.third_order.shortening
        return (sp.cos(_GAMMA * form.bend) - curved).subs(form.bend, rod.bent(_THETA - s.theta_m))

    def derive(self, rod: Rod) -> Mechanics:
        """Return the mathematics, derived anew."""
        delta, delta_dot = _THETA - s.theta_m, _OMEGA - s.omega_m
        rho = self._radius(rod)
        slope = sp.diff(rho, _THETA)
        form, bend = rod.third_order, rod.bent(delta)
        elastic = (1 + 3 * rod.root) * form.bend**2 / 2 - sp.expand(form.bend * form.ahead)
        # Slope of the static shape at its end and curvature at its root (`docs/MECHANICS.md`).
        end = sp.Rational(3, 2) * bend - sp.Rational(11, 560) * bend**3
        clamped = 3 * bend - sp.Rational(4, 35) * bend**3
        speed2 = rho**2 * _OMEGA**2 + slope**2 * delta_dot**2
        return lagrangian_mechanics(
            _THETA,
            _OMEGA,
            kinetic=speed2 / 2 + rod_coupling(self.mu) * _OMEGA * s.omega_m + rod_inertia(self.mu) * s.omega_m**2 / 2,
            theta=_THETA,
            delta=delta,
            tip=(rho * sp.cos(_THETA), rho * sp.sin(_THETA)),
            speed2=speed2,
            radius=rho,
            bend=bend,
            elastic=elastic.subs(form.bend, bend),
            quartic=sp.Rational(27, 20) * bend**4,
            slope=s.theta_m + rod.rest_at(1) + end + rod.root * clamped,
        )

    def reading(self, closure, rod=STRAIGHT):
        """Return the tip position in lengths of the arm."""
        rho = self._radius(rod)
        return rho * sp.cos(_THETA), rho * sp.sin(_THETA)


BASE = Reduced()
