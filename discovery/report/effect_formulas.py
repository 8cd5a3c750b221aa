"""What effects declare, as formulas: energies, powers, laws, and what the instrument reports."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import sympy as sp

from discovery.declarations import symbols as s
from discovery.declarations.effect import Effect
from discovery.declarations.system import System
from discovery.equations.contributions import radius_of
from discovery.report.mathml import row, symbol
from discovery.report.mathml_expression import expression

#: Letters of the energies, and of the power of a load or a memory; a mode has none.
LETTERS = {"kinetic": "T", "potential": "V", "dissipation": "D", "load": "P", "memory": "P"}
NEXT = '<mo>,</mo><mspace width="1em"/>'


def coordinate_name(system: str) -> str:
    """Return what the coordinate of a kind of system is called."""
    return System.of(system).coordinate


def equal(left: str, right: str) -> str:
    """Return an equation."""
    return row(left, "<mo>=</mo>", right)


def signed(body: str) -> str:
    """Return a term of a sum with its sign in front."""
    minus = "<mrow><mo>−</mo>"
    return f"<mo>−</mo><mrow>{body.removeprefix(minus)}" if body.startswith(minus) else f"<mo>+</mo>{body}"


def rounded_factors(value: sp.Expr) -> sp.Expr:
    """Return the expression with decimal factors to four digits."""
    return value.xreplace({f: sp.Float(float(f), 4) for f in value.atoms(sp.Float)})


def along_the_rod(*factors: str) -> str:
    """Return three times the integral of a product of formulas along the rod."""
    bounds = "<msubsup><mo>∫</mo><mn>0</mn><mn>1</mn></msubsup>"
    product = [f"<mo>(</mo>{factor}<mo>)</mo>" for factor in factors]
    return row("<mn>3</mn>", bounds, *product, "<mi>d</mi>", symbol("s"))


def _turned(by: str) -> str:
    """Return how much the slope of the rod grows."""
    return row(symbol("theta"), "<mo>→</mo>", symbol("theta"), "<mo>+</mo>", by)


def _bending(effect: Any, name: str) -> list[str]:
    """Return what b is in a law of the rod: the curvature at a place or at the root, else a part of the bending."""
    laws_of = [effect.expression(), *effect.states().values()]
    if name == "q" or not {s.bend, s.bend_dot, s.root, s.root_dot} & set().union(*(x.free_symbols for x in laws_of)):
        return []
    if effect.kind == "memory" and not effect.local:
        return [row(symbol("b"), "<mtext> each component of the bending</mtext>")]
    slope = f"<mfrac>{row('<mo>∂</mo>', symbol('theta'))}{row('<mo>∂</mo>', symbol('s'))}</mfrac>"
    where = "" if effect.kind == "memory" else "<mo>(</mo><mn>0</mn><mo>)</mo>"
    return [equal(symbol("b"), row("<mfrac><mn>1</mn><mn>3</mn></mfrac>", slope, where))]


def _states(effect: Any, name: str) -> list[str]:
    return [equal(symbol(z.name, 1), expression(rate, name)) for z, rate in effect.states().items()]


def effect_formula(effect: Effect, system: str) -> str:
    """Return what an effect declares on a kind of system: its energy, power, law or what the instrument reports."""
    name, declared = coordinate_name(system), getattr(effect, "expression", None)
    if effect.kind in LETTERS:
        assert declared is not None
        letter = "F" if getattr(effect, "on", None) is not None else LETTERS[effect.kind]
        body = expression(declared(), name)
        if getattr(effect, "local", False) and System.of(system).has_rod:
            body = along_the_rod(body)
        lines = [equal(symbol(letter), body)]
        if effect.kind == "memory":
            lines += [*_states(effect, name), *_bending(effect, name)]
        return row(NEXT.join(lines))
    if effect.kind == "joint":
        assert declared is not None
        turn = equal(symbol("p"), expression(declared(), name))
        return row(NEXT.join([_turned(symbol("p")), turn, *_states(effect, name), *_bending(effect, name)]))
    if effect.kind == "shape":
        # Kappa_r is the curvature at the root.
        added = effect.rest_angle() + effect.root_turn() * sp.Symbol("kappa_r")  # type: ignore[attr-defined]
        return _turned(expression(added, name))
    if effect.kind == "mode":
        return mode_formula(effect)
    return laws([effect], system)


def mode_formula(mode: Any, push: sp.Expr | None = None) -> str:
    """Return the equation of a mode that an input pushes: by g u, or by what it alone does to the coordinate."""
    push = s.u * sp.Symbol("g", real=True) if push is None else push
    z, states = mode.displacement(), mode.states()
    rate, acceleration = (sp.Symbol(f"{z.name}{dots}", real=True) for dots in ("'", "''"))
    slope = sp.expand(states[states[z]].xreplace({states[z]: rate}))
    driven, own = slope.as_independent(z, rate, as_Add=True)
    left = sorted((-own).as_ordered_terms(), key=lambda term: not term.has(rate))
    row_of_terms = row(expression(acceleration), *(signed(expression(term, "q")) for term in left))
    return equal(row_of_terms, expression(driven.xreplace({s.push: push}), "q"))


def together(effects: Iterable[Effect]) -> list[list[Effect]]:
    """Return effects in groups that share one law: the radius, what is received, what is read, and when."""
    groups: dict[str, list[Effect]] = {}
    for effect in effects:
        key = effect.kind if effect.kind in ("closure", "drive", "sensor") else effect.id()
        if effect.kind == "sensor" and effect.lateness() != 0:  # type: ignore[attr-defined]
            key = "late"
        groups.setdefault(key, []).append(effect)
    return list(groups.values())


def laws(effects: Sequence[Any], system: str, names: tuple[str, str, str] = ("u", "q", "q_read")) -> str:
    """Return the one law of closures, drives, or sensors of one kind, a group of `together`, on a kind of system.

    `names` are those of the input of a system without a rod, of its output, and of what is told of that.
    """
    arm, kind = System.of(system).has_rod, effects[0].kind
    # A declared system has the names of its user.
    name = coordinate_name(system) if arm or names[1] == "q" else ""
    if kind == "closure":
        return equal(row(symbol("rho_t"), "<mo>/</mo>", symbol("l")), expression(radius_of(effects), name))
    if kind == "drive":
        law = received = s.theta_m if arm else s.u
        for effect in effects:
            law = effect.expression().subs(received, law)
        if arm:
            return row(symbol(received.name), "<mo>→</mo>", expression(law, name))
        named = law.xreplace({s.u: sp.Symbol(names[0], real=True)})
        return row(symbol(names[0]), "<mo>→</mo>", expression(named, name))
    late = sp.Add(*[effect.lateness() for effect in effects])
    if late != 0:
        since = [signed(expression(-term, name)) for term in late.as_ordered_terms()]
        return equal(symbol("t_read"), row(symbol("t"), *since))
    read: tuple[sp.Expr, ...] = sp.symbols("tip_x tip_y", real=True) if arm else (sp.Symbol(names[1], real=True),)
    for effect in effects:
        read = effect.read(*read)
    told = ("x_read", "y_read") if arm else names[2:]
    return row(NEXT.join(equal(symbol(n), expression(e, name)) for n, e in zip(told, read, strict=True)))
