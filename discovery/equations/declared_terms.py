"""A system in its own equations, and the effects at its places, line by line in the names that its user gave."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import sympy as sp

from discovery.declarations import symbols as s
from discovery.declarations.effect import Drive, Effect, Expressed, Sensor
from discovery.declarations.place import INERTIA, local
from discovery.declarations.registry import effect_name
from discovery.mechanics.declared import DeclaredBase
from discovery.mechanics.declared_equations import INPUT, coordinates_of

_DOTS = ("", "'", "''")
_READ = sp.Symbol("y_read", real=True)
#: Letters of the energies, and of the power of a load or a memory; a mode has none.
LETTERS = {"kinetic": "T", "potential": "V", "dissipation": "D", "load": "P", "memory": "P"}


class DeclaredLine(NamedTuple):
    """One equation: words for it, its left-hand side, how often that is differentiated, and its right-hand side."""

    words: str
    name: str
    dots: int
    value: sp.Expr


def declared_lines(base: DeclaredBase, known: Mapping[str, float]) -> list[DeclaredLine]:
    """Return energies, forces, places and output of a system; x' is the rate of x.

    Losses whose factor is `known` as zero are none.
    """
    declaration, read = base.declaration, base.equations
    own: dict[sp.Symbol, sp.Symbol] = {}
    for dots, symbols in zip(_DOTS, coordinates_of(len(declaration.coordinates)), strict=True):
        own |= {x: sp.Symbol(n + dots, real=True) for n, x in zip(declaration.coordinates, symbols, strict=True)}
    if declaration.input is not None:
        own |= {x: sp.Symbol(declaration.input[0] + dots, real=True) for x, dots in zip(INPUT, _DOTS, strict=True)}
    absent = {x: 0 for x in read.dissipation.free_symbols if known.get(x.name) == 0.0}
    lines = [
        ("Kinetic energy", "T", read.kinetic),
        ("Potential energy", "V", read.potential),
        ("Dissipation function", "D", read.dissipation.subs(absent)),
        *(
            (f"Generalised force on {_words(name)}", f"Q_{name}", force)
            for name, force in zip(declaration.coordinates, read.forces, strict=True)
        ),
    ]
    lines = [line for line in lines if line[2] != 0]
    lines += [(f"Place {_words(name)}", name, value) for name, (value, _) in read.places.items()]
    lines.append(("What is read", "y_read", read.output))
    lines += [(f"Also read, {_words(name)}", f"y_{name}", value) for name, (value, _) in read.also.items()]
    return [DeclaredLine(words, name, 0, value.xreplace(own)) for words, name, value in lines]


def placed_lines(effect: Effect) -> list[DeclaredLine]:
    """Return what an effect declares in the displacement of its place; k is the stiffness there.

    An energy V, a dissipation D, a power P or a force F, and the rates of states of its own.
    """
    assert isinstance(effect, Expressed)
    where, rate = (sp.Symbol(effect.place + dots, real=True) for dots in _DOTS[:2])
    meant: dict[sp.Symbol, Any] = dict.fromkeys((s.theta, s.delta, s.x, s.x_g, s.slope), where)
    meant |= dict.fromkeys((s.omega, s.delta_dot, s.v_x, s.slope_dot), rate) | {s.v2: rate**2, s.w2: rate**2}
    meant |= dict.fromkeys((s.y, s.y_g, s.v_y), sp.Integer(0)) | {s.U: where**2 / 2, s.U_4: where**4 / 4}
    meant |= {INERTIA: sp.Integer(1), s.alpha: sp.Symbol(f"k_{effect.place}", real=True)}
    told = {local(c, effect.place): value for c, value in meant.items()} | {s.bend: where, s.bend_dot: rate}
    letter = "F" if getattr(effect, "on", None) is not None else LETTERS[effect.kind]
    lines = [DeclaredLine(effect_name(effect.id()), letter, 0, effect.expression().xreplace(told))]
    lines += [DeclaredLine("memory", z.name, 1, slope.xreplace(told)) for z, slope in effect.states().items()]
    return lines


def every_line(base: DeclaredBase, effects: Sequence[Effect], known: Mapping[str, float]) -> list[DeclaredLine]:
    """Return what was declared, what each effect adds at its place, what is received and what is read."""
    found = declared_lines(base, known)
    for effect in effects:
        name = effect_name(effect.id())
        if effect.place:
            found += placed_lines(effect)
        elif isinstance(effect, Drive):
            found.append(DeclaredLine(name, "u_received", 0, sp.sympify(effect.expression())))
            found += [DeclaredLine("memory", z.name, 1, slope) for z, slope in effect.states().items()]
        elif isinstance(effect, Sensor):
            late = effect.lateness()
            value = s.t - late if late != 0 else sp.sympify(effect.oscillator_reading(_READ))
            found.append(DeclaredLine(name, "t_read" if late != 0 else "y_told", 0, value))
    return found


def _words(name: str) -> str:
    return name.replace("_", " ")
