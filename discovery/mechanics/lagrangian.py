"""The mechanics of an arm with one coordinate, by Lagrange's equation from its kinetic energy and geometry."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import sympy as sp

from discovery.declarations import symbols as s
from discovery.mechanics.base import Channel, Mechanics, Strand
from discovery.mechanics.rod_shapes import quadrature

#: Places along a rod of one coordinate at which its fibres are followed.
_PLACES = 4


def total_derivative(expression: sp.Expr, q: Sequence[sp.Symbol], qd: Sequence[sp.Symbol]) -> sp.Expr:
    """Return the derivative in time at zero accelerations of the coordinates, the motor's or a base's included."""
    pairs = [*zip(q, qd, strict=True), (s.theta_m, s.omega_m), (s.omega_m, s.alpha_m)]
    return sp.Add(*[sp.diff(expression, a) * b for a, b in pairs])


@lru_cache
def lagrangian_mechanics(
    q: sp.Symbol,
    qd: sp.Symbol,
    *,
    kinetic: sp.Expr,
    theta: sp.Expr,
    delta: sp.Expr,
    tip: tuple[sp.Expr, sp.Expr],
    speed2: sp.Expr,
    radius: sp.Expr,
    bend: sp.Expr,
    elastic: sp.Expr,
    quartic: sp.Expr,
    slope: sp.Expr,
) -> Mechanics:
    """Return the mechanics of a base with one coordinate from its kinetic energy and geometry.

    Parameters
    ----------
    q, qd : sympy.Symbol
        Coordinate and rate.
    kinetic : sympy.Expr
        Kinetic energy per unit inertia [q^2 s^-2], with all of the motor's rate in it that moves mass.
    theta, delta : sympy.Expr
        Tip angle and deflection.
    tip : tuple of sympy.Expr
        Tip position in lengths of the arm.
    speed2 : sympy.Expr
        Squared speed of the tip, in its shortest form.
    radius : sympy.Expr
        Distance of the tip from the hub, in lengths.
    bend : sympy.Expr
        The part of the deflection that bends the spring.
    elastic : sympy.Expr
        Elastic energy per unit stiffness U [q^2].
    quartic : sympy.Expr
        Its counterpart U_4 for the fourth power of the curvature [q^4].
    slope : sympy.Expr
        Slope of the rod's end in the fixed frame.

    Returns
    -------
    Mechanics
        Euler-Lagrange: d/dt dT/dq' - dT/dq = sum of generalised forces.
    """
    mass = sp.diff(kinetic, qd, 2)
    momentum = sp.diff(kinetic, qd)
    bias = total_derivative(momentum, [q], [qd]) - sp.diff(kinetic, q)
    channels = _moving(q, qd, theta=theta, delta=delta, tip=tip, slope=slope)
    channels[s.v2] = Channel(speed2, (sp.diff(speed2, qd),))
    bending = Channel(total_derivative(bend, [q], [qd]), (sp.diff(bend, q),))
    channels[s.w2] = Channel(bending.value**2, (2 * bending.value * bending.jacobian[0],))
    channels[s.U] = Channel(elastic, (sp.diff(elastic, q),))
    channels[s.U_4] = Channel(quartic, (sp.diff(quartic, q),))
    channels[s.rho] = Channel(radius, (sp.Integer(0),))
    # A turn of the whole arm changes q and theta_m alike.
    turning = momentum + sp.diff(kinetic, s.omega_m)
    channels[s.h] = Channel(turning, (sp.diff(turning, qd),), total_derivative(turning, [q], [qd]))
    only = (bend, bending.value, bending.jacobian)
    return Mechanics(
        (q,),
        (qd,),
        assignments=(),
        channels=channels,
        mass=((mass,),),
        force=(sp.factor_terms(-bias),),
        bending=(only,),
        fibres=_fibres(only),
    )


def _moving(
    q: sp.Symbol, qd: sp.Symbol, *, theta: sp.Expr, delta: sp.Expr, tip: tuple[sp.Expr, sp.Expr], slope: sp.Expr
) -> dict[sp.Symbol, Channel]:
    """Return the channels of angles and tip with those of their rates."""
    channels: dict[sp.Symbol, Channel] = {}
    for symbol, rate_symbol, expression in (
        (s.theta, s.omega, theta),
        (s.delta, s.delta_dot, delta),
        (s.x, s.v_x, tip[0]),
        (s.y, s.v_y, tip[1]),
        (s.slope, s.slope_dot, slope),
    ):
        jacobian = sp.diff(expression, q)
        rate = total_derivative(expression, [q], [qd])
        channels[symbol] = Channel(expression, (jacobian,))
        channels[rate_symbol] = Channel(rate, (jacobian,), total_derivative(rate, [q], [qd]))
    channels[s.x_g], channels[s.y_g] = channels[s.x], channels[s.y]
    return channels


def _fibres(bending: Strand) -> tuple[tuple[float, Strand], ...]:
    """Return the places of the rod with their weights."""
    value, rate, (jacobian,) = bending
    places, weights, _ = quadrature(_PLACES)
    # The static shape has the curvature 3 (1 - s) times the bending.
    return tuple(
        (float(3 * w), (float(1 - at) * value, float(1 - at) * rate, (float(1 - at) * jacobian,)))
        for at, w in zip(places, weights, strict=True)
    )
