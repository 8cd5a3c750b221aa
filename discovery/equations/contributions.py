"""What single effects contribute to a program: the received input, forces on channels, inertia and memory."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import sympy as sp

from discovery.declarations import symbols as s
from discovery.declarations.effect import (
    Closure,
    Dissipation,
    Drive,
    Effect,
    Load,
    Memory,
    Potential,
)
from discovery.declarations.place import channels_of
from discovery.mechanics.base import Channel, Mechanics, Strand
from discovery.mechanics.joint import Root

#: Recorded input with its first two derivatives; an oscillator uses the value only.
RECORDED = sp.symbols("r_0 r_1 r_2", real=True)

Assignments = list[tuple[sp.Symbol, sp.Expr]]
Laws = dict[sp.Symbol, sp.Expr]


def force_received(effects: Sequence[Drive], recorded: sp.Expr) -> tuple[sp.Expr, Laws]:
    """Return what arrives of an input that is no motion, and the states that it passes, with their slopes."""
    value, states = recorded, Laws()
    for effect in effects:
        states |= {z: slope.xreplace({s.u: value}) for z, slope in effect.states().items()}
        value = effect.expression().subs(s.u, value)
    return value, states


def slope_in_drive(state: sp.Symbol) -> sp.Symbol:
    """Return the symbol of the slope of a state that the input passes."""
    return sp.Symbol(f"slope_of_{state.name}", real=True)


def received_input(effects: Sequence[Drive], input_moves: bool, root: Root | None) -> Assignments:
    """Return the input that arrives through the drive effects, of a motion with its rates, turned by the root.

    A force comes with the slopes of states that it passes, as nothing else is told what was recorded.
    """
    if not input_moves:
        value, states = force_received(effects, RECORDED[0])
        return [(s.u, value), *((slope_in_drive(z), slope) for z, slope in states.items())]
    value = RECORDED[0]
    for effect in effects:
        value = effect.expression().subs(s.theta_m, value)

    def rate(expression: sp.Expr) -> sp.Expr:
        pairs = ((RECORDED[0], RECORDED[1]), (RECORDED[1], RECORDED[2]), (s.t, sp.Integer(1)))
        return sp.Add(*[sp.diff(expression, a) * b for a, b in pairs])

    first = rate(value)
    received = (value, first, rate(first))
    if root is not None:
        received = tuple(a + b for a, b in zip(received, (root.turn, root.rate, root.bias), strict=True))
    return list(zip((s.theta_m, s.omega_m, s.alpha_m), received, strict=True))


def radius_of(effects: Sequence[Effect], channels: Mapping[sp.Symbol, Channel] | None = None) -> sp.Expr | None:
    """Return rho/l as all closures together give it, each with its own change of the radius; None without closures.

    With the channels of a base, the rate of the tip is written in the base's own rates.
    """
    laws = [e.expression() for e in effects if isinstance(e, Closure)]
    if not laws:
        return None
    law = 1 + sp.Add(*[law - 1 for law in laws])
    return law if channels is None else law.xreplace({s.omega: channels[s.omega].value})


def channel_forces(effect: Effect) -> dict[sp.Symbol, sp.Expr]:
    """Return the force of one effect on each channel: -dV/dc, -dD/dc', +dP/dc'."""
    if not isinstance(effect, Potential | Dissipation | Load):
        return {}
    if isinstance(effect, Load) and effect.on is not None:
        return {effect.on: effect.expression()}
    wanted = channels_of(effect)
    sign = 1 if isinstance(effect, Load) else -1
    expression = effect.expression()
    forces = {c: sign * sp.diff(expression, c) for c in wanted}
    return {c: f for c, f in forces.items() if f != 0}


def strands(effect: Memory, mechanics: Mechanics) -> list[tuple[float, Strand]]:
    """Return what a memory effect acts on, with weights: components of the bending, or places of the rod."""
    if effect.place:
        return [(1, mechanics.places[effect.place])]
    return list(mechanics.fibres) if effect.local else [(1, strand) for strand in mechanics.bending]


def memory_of(effect: Memory, mechanics: Mechanics, n: int) -> tuple[Laws, Laws, list[sp.Expr]]:
    """Return the states of a memory effect, one set for each of its strands, how fast they forget, and its force."""
    power, states = effect.expression(), effect.states()
    force: list[sp.Expr] = [sp.Integer(0)] * n
    found, forgets = {}, {}
    for k, (weight, (value, rate, jacobian)) in enumerate(strands(effect, mechanics)):
        own = {z: sp.Symbol(f"{z.name}_{k}", real=True) for z in states}
        here = {**own, s.bend: value, s.bend_dot: rate}
        found.update({own[z]: sp.sympify(slope).subs(here) for z, slope in states.items()})
        forgets.update({own[z]: sp.sympify(rate).subs(here) for z, rate in effect.relaxation().items()})
        pull = weight * sp.diff(power, s.bend_dot).subs(here)
        for i in range(n):
            force[i] += jacobian[i] * pull
    return found, forgets, force


def kinetic_of(
    energy: sp.Expr, channels: dict[sp.Symbol, Channel], n: int
) -> tuple[list[list[sp.Expr]], list[sp.Expr]]:
    """Return what a kinetic energy in channel rates adds to the mass matrix and to the force."""
    mass = [[sp.Integer(0)] * n for _ in range(n)]
    force = [sp.Integer(0)] * n
    for c, c_dot in s.RATES.items():
        momentum = sp.diff(energy, c_dot)
        pull = -sp.diff(energy, c)
        pull += sp.diff(momentum, s.omega_m) * s.alpha_m + sp.diff(momentum, s.theta_m) * s.omega_m
        row = channels[c_dot].jacobian
        for d, d_dot in s.RATES.items():
            pull += sp.diff(momentum, d) * d_dot
            coupling = sp.diff(momentum, d_dot)
            if coupling == 0:
                continue
            pull += coupling * channels[d_dot].bias
            for i in range(n):
                for j in range(n):
                    mass[i][j] += row[i] * coupling * channels[d_dot].jacobian[j]
        for i in range(n):
            force[i] -= row[i] * pull
    return mass, force
