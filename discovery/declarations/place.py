"""An effect at one place of a declared system, and its amplitudes: parameters to which its force is proportional."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import sympy as sp

from discovery.declarations import symbols as s
from discovery.declarations.effect import OSCILLATOR, Dissipation, Effect, Load, Memory, Potential

#: Reference inertia of a place: an effect gives its force over it.
INERTIA = sp.Symbol("inertia", real=True)
#: Between an effect and its place in an id.
_AT = "_at_"
#: What a law takes from elsewhere: its parameters are then shares of that, not forces.
_TAKEN = (s.alpha, s.xi, s.length, s.push)


def can_be_placed(effect: Effect) -> bool:
    """Return whether an effect is a force at some place, not one of the whole system or of its instruments."""
    return OSCILLATOR in effect.systems and effect.kind in ("potential", "dissipation", "load", "memory")


def placed(effect_id: str, place: str) -> str:
    """Return the id of an effect at a place."""
    return f"{effect_id}{_AT}{place}"


def local(symbol: sp.Symbol, place: str) -> sp.Symbol:
    """Return the symbol of a channel, of the stiffness `alpha` or of `INERTIA` at a place."""
    return sp.Symbol(f"{symbol.name}{_AT}{place}", real=True)


@cache
def at_place(effect: Effect, place: str) -> Effect:
    """Return an effect at a place: its parameters are named after it, and its force is that of the effect there.

    What the effect says is a force over the place's reference inertia; amplitudes are told with it, as forces in their
    own unit.
    """
    kind = type(effect)
    words: dict[str, Any] = {"__module__": kind.__module__, "__doc__": kind.__doc__, "place": place}
    words["id"] = classmethod(lambda cls: placed(effect.id(), place))
    words["title"] = classmethod(lambda cls: f"{effect.title()}, at {place.replace('_', ' ')}")
    words["reduces_to"] = frozenset(placed(simpler, place) for simpler in effect.reduces_to)
    weight = local(INERTIA, place)
    own = {p.name: sp.Symbol(f"{p.name}_{place}", real=True) for p in kind.parameters()}
    forced = amplitudes(effect)
    meant = {s.rho: sp.Integer(1)}
    meant |= {sp.Symbol(n, real=True): symbol / weight if n in forced else symbol for n, symbol in own.items()}
    meant |= {c: local(c, place) for c in (*s.POSITION_CHANNELS, *s.RATE_CHANNELS)}
    for declared in (s.alpha, s.xi):
        meant.setdefault(declared, local(declared, place))
    on = getattr(effect, "on", None)
    if on is not None:
        words["on"] = local(on, place)

    def told(expression: sp.Expr) -> sp.Expr:
        return sp.sympify(expression).xreplace(meant)

    words["expression"] = lambda self: weight * told(effect.expression())  # type: ignore[attr-defined]
    words["imitates"] = classmethod(lambda cls, values, *times: effect.imitates(
        {**values, **{n: values[here.name] for n, here in own.items() if here.name in values}}, *times
    ))  # fmt: skip
    if isinstance(effect, Memory):
        states = {z: sp.Symbol(f"{z.name}_{place}", real=True) for z in effect.states()}
        meant |= states
        words["states"] = lambda self: {states[z]: told(slope) for z, slope in effect.states().items()}
        words["relaxation"] = lambda self: {states[z]: told(rate) for z, rate in effect.relaxation().items()}
    found = type(f"{kind.__name__}At{place.title()}", (kind,), words)
    for p in kind.parameters():
        # The attribute keeps its name, for the law of the effect; users see that of the place.
        said = f"{p.meaning}, at {place.replace('_', ' ')}"
        forces = p.name in forced
        renamed = replace(p, latex="", place=place, name=own[p.name].name, meaning=said, forced=forces)
        setattr(found, p.name, renamed)
    return found()


def channels_of(effect: Potential | Dissipation | Load) -> tuple[sp.Symbol, ...]:
    """Return the channels on which an effect may push, those of its place where it has one."""
    wanted = s.POSITION_CHANNELS if isinstance(effect, Potential) else s.RATE_CHANNELS
    return wanted if not effect.place else tuple(local(c, effect.place) for c in wanted)


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
    inner = set().union(*(sp.sympify(rate).free_symbols for rate in effect.states().values()))
    shapes = {declared[p.name] for p in effect.parameters() if p.shape}
    found = {n: d for n, d in declared.items() if d in law.free_symbols - inner - shapes}
    parts = {n: sp.diff(law, d) for n, d in found.items()}
    linear = {n: part for n, part in parts.items() if found[n] not in part.free_symbols}
    rest = law - sp.Add(*[found[n] * part for n, part in linear.items()])
    return tuple(linear) if sp.expand(rest) == 0 else ()
