"""Amplitudes of a law: the parameters to which its force is proportional, so that they scale with the inertia."""

from __future__ import annotations

import sympy as sp

from discovery.declarations import symbols as s
from discovery.declarations.effect import Dissipation, Effect, Load, Memory, Potential

#: What a law takes from elsewhere: its parameters are then shares of that, not forces.
_TAKEN = (s.alpha, s.xi, s.length, s.push)


def amplitudes(effect: Effect) -> tuple[str, ...]:
    """Return the parameters in which the force of an effect is jointly linear, without a part that lacks them all.

    Twice all of them is twice the force, whatever the other parameters are. None are found where the law is a share of
    a stiffness, a damping or an input that the model has, or where parameters scale each other.

    Examples
    --------
    >>> from discovery.declarations.registry import get_effect
    >>> amplitudes(get_effect("stribeck_friction")), amplitudes(get_effect("equilibrium_offset"))
    (('f_k', 'f_b'), ())
    """
    if not isinstance(effect, Potential | Dissipation | Load | Memory):
        return ()
    law = sp.sympify(effect.expression())
    declared = {p.name: sp.Symbol(p.name, real=True) for p in effect.parameters()}
    if law.free_symbols & set(_TAKEN) - set(declared.values()):
        return ()
    inner = set().union(*(slope.free_symbols for slope in _slopes(effect)))
    shapes = {declared[p.name] for p in effect.parameters() if p.shape}
    found = {n: d for n, d in declared.items() if d in law.free_symbols - inner - shapes}
    parts = {n: sp.diff(law, d) for n, d in found.items()}
    linear = {n: part for n, part in parts.items() if found[n] not in part.free_symbols}
    rest = law - sp.Add(*[found[n] * part for n, part in linear.items()])
    return tuple(linear) if sp.expand(rest) == 0 else ()


def _slopes(effect: Effect) -> list[sp.Expr]:
    """Return the rates of the states that an effect remembers."""
    return [sp.sympify(rate) for rate in effect.states().values()] if isinstance(effect, Memory) else []
