r"""A joint between the hub and the root of the rod: the root turns on its own, as the bending there asks for.

The turn p of the root is a law of the bending b there (the curvature over three, so that b is the deflection of a rod
that a small force at its tip bends as much) and of states z that move only while b moves. Hence

.. math:: \dot p = f(b, z, \dot b) = \frac{\partial p}{\partial b}\, \dot b
                   + \sum_z \frac{\partial p}{\partial z}\, \dot z

The root has no mass, so the joint transmits the moment of the rod there, alpha b. A turn of the root turns the whole
arm: to the equation of each coordinate comes df/dq_k' times the balance of angular momentum about the hub (Jourdain's
principle; Goldstein, Classical Mechanics, 2nd edition, section 2-4, for rates that are linear). This module adds that.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import sympy as sp

from discovery.declarations import symbols as s
from discovery.declarations.effect import Joint
from discovery.foundation.errors import InputError
from discovery.mechanics.base import Channel, Mechanics

#: Change of each channel as the whole arm turns, of a rate as it turns at unit rate; the others do not change.
TURN: dict[sp.Symbol, sp.Expr] = {
    s.theta: sp.Integer(1),
    s.slope: sp.Integer(1),
    s.x: -s.y,
    s.y: s.x,
    s.x_g: -s.y_g,
    s.y_g: s.x_g,
    s.omega: sp.Integer(1),
    s.slope_dot: sp.Integer(1),
    s.v_x: -s.y,
    s.v_y: s.x,
    s.v2: 2 * (s.x * s.v_y - s.y * s.v_x),
}


def _sign(x: sp.Expr) -> sp.Expr:
    """Return the sign of a number without a branch, zero of zero; powers of the tiny number must not underflow."""
    return x / (sp.Abs(x) + sp.Float(1e-60))


@dataclass(frozen=True)
class Root:
    """How the root of the rod turns."""

    turn: sp.Expr  # its angle beyond the hub's, p [q]
    rate: sp.Expr  # its rate [q/s]
    bias: sp.Expr  # its acceleration at zero acceleration of the coordinates [q/s^2]
    jacobian: tuple[sp.Expr, ...]  # derivative of its rate with respect to the rates of the coordinates
    states: dict[sp.Symbol, sp.Expr]  # states of the joint with their time derivatives


def root_of(mechanics: Mechanics, joints: Sequence[Joint]) -> Root | None:
    """Return how the root turns with all joints together; None without any.

    Raises InputError if the base has no root that could turn.
    """
    if not joints:
        return None
    if mechanics.root is None:
        raise InputError(f"{joints[0].id()} needs a rod whose root can turn: take the base 'elastica'.")
    value, rate, jacobian = mechanics.root
    turn = sp.Add(*[joint.expression() for joint in joints])
    states = {z: slope for joint in joints for z, slope in joint.states().items()}

    def moving(expression: sp.Expr) -> sp.Expr:
        """Return the derivative in time at a constant rate of the bending."""
        remembered = [sp.diff(expression, z) * slope for z, slope in states.items()]
        return sp.diff(expression, s.root) * s.root_dot + sp.Add(*remembered)

    first = moving(turn)
    gain, bias = sp.diff(first, s.root_dot), moving(first)
    here = {s.root: value, s.root_dot: rate}
    turn, first, gain, bias = (e.replace(sp.sign, _sign).xreplace(here) for e in (turn, first, gain, bias))
    states = {z: slope.xreplace(here) for z, slope in states.items()}
    return Root(turn, first, bias, tuple(gain * j for j in jacobian), states)


def hinged(mechanics: Mechanics, root: Root | None) -> Mechanics:
    """Return the mechanics of a base whose root turns as the coordinates move; unchanged without a joint.

    Its symbols theta_m, omega_m and alpha_m are then those of the root, alpha_m at zero acceleration of the
    coordinates.
    """
    if root is None or mechanics.root is None:
        return mechanics
    n, channels = len(mechanics.coordinates), mechanics.channels
    momentum = channels[s.h]
    program = list(mechanics.assignments)

    def name(label: str, expression: sp.Expr) -> sp.Symbol:
        symbol = sp.Symbol(label, real=True)
        program.append((symbol, sp.sympify(expression)))
        return symbol

    gain = [name(f"A_{i}", root.jacobian[i]) for i in range(n)]
    lever = [name(f"H_{i}", momentum.jacobian[i]) for i in range(n)]
    inertia = name("H_m", sp.diff(momentum.value, s.omega_m))
    # What the hub would have to give so that the whole arm does not turn, and the moment of the rod at its root.
    moment = name("G_c", momentum.bias + s.alpha * mechanics.root[0])
    mass = tuple(
        tuple(
            mechanics.mass[i][j] + gain[i] * lever[j] + lever[i] * gain[j] + gain[i] * gain[j] * inertia
            for j in range(n)
        )
        for i in range(n)
    )
    meaning = {symbol: sp.sympify(channel.value) for symbol, channel in channels.items()}
    turns = {**{c: sp.sympify(by).xreplace(meaning) for c, by in TURN.items()}, s.h: inertia}

    def turned(symbol: sp.Symbol, channel: Channel) -> Channel:
        if symbol not in turns:
            return channel
        jacobian = tuple(j + turns[symbol] * a for j, a in zip(channel.jacobian, gain, strict=True))
        return replace(channel, jacobian=jacobian)

    return replace(
        mechanics,
        assignments=tuple(program),
        channels={symbol: turned(symbol, channel) for symbol, channel in channels.items()},
        mass=mass,
        force=tuple(mechanics.force[i] - gain[i] * moment for i in range(n)),
    )
