"""The mass on the radius law, third order, without a free parameter."""

from __future__ import annotations

import sympy as sp

from discovery import symbols as s
from discovery.mechanics.base import SHORTENING_RADIUS, ArmBase, Mechanics, lagrangian_mechanics
from discovery.parameters import Normal, Parameter

__all__ = ["BASE", "Reduced", "rod_coupling", "rod_inertia"]

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
    order the terms are c1 = 1/5, c2 = -2/5, c3 = 1/25 and beta = 0.122 alpha (`discovery.derivation`). C moves the
    motor only, not the tip.
    """

    name = "reduced"
    n_coordinates = 1
    provides = frozenset({"cubic_stiffness", "radius_law", "distributed_mass", *SHORTENING_RADIUS})

    mu = Parameter("1", "rod mass over tip mass", (0.0, 2.0), Normal(0.2, 0.2), fixed=True, latex=r"\mu")

    def mechanics(self) -> Mechanics:
        """Return the mathematics."""
        delta, delta_dot = _THETA - s.theta_m, _OMEGA - s.omega_m
        rho = sp.cos(_GAMMA * delta)
        slope = -_GAMMA * sp.sin(_GAMMA * delta)
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
            elastic=delta**2 / 2 - delta**4 / 105,
        )

    def reading(self, closure):
        """Return the tip position in lengths of the arm."""
        rho = sp.cos(_GAMMA * (_THETA - s.theta_m))
        return rho * sp.cos(_THETA), rho * sp.sin(_THETA)


BASE = Reduced()
