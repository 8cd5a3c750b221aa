"""What effects and declared systems say, as formulas: energies, powers, laws, what the instrument reports."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from typing import Any

import sympy as sp

from discovery.declarations import symbols as s
from discovery.declarations.effect import Effect
from discovery.declarations.system import System, SystemDeclaration
from discovery.equations.contributions import force_received, radius_of
from discovery.equations.declared_terms import LETTERS, DeclaredLine, declared_lines, placed_lines
from discovery.equations.latex import (
    LatexLine,
    Writer,
    dotted,
    in_sum,
    letter,
    parameter_letter,
    parameter_letters,
)
from discovery.mechanics.systems import declaration_of, declared_base
from discovery.report.mathml import inline

_NEXT = r", \quad "
#: The energies in words, in their order.
_WORDS = {
    "T": "Kinetic energy that the effects add",
    "V": "Potential energy",
    "D": "Dissipation",
    "P": "Power of the loads",
}
#: What the symbols of an arm's equation are.
_MEANINGS = {
    "T": "is the kinetic energy of the rod and the tip",
    "U": "the elastic energy of the rod per unit of stiffness",
    "q_k": "the curvature modes of the rod",
    "Q_k": "the generalized forces",
    "v_t": "the speed of the tip",
    r"\bar{x}_g": "the first moment of the mass along x, in lengths of the arm",
    r"\bar{y}_g": "that along y",
}
#: What an effect may take from its place, by the beginning of the symbol.
_THERE = {"k": "stiffness", "xi_at": "damping"}


@cache
def _writer(system: str) -> Writer:
    """Return what writes the formulas of a kind of system; a declared one, without a name, has those of its user."""
    if not system:
        return Writer({}, frozenset(), unnamed=parameter_letter)
    return Writer.of_field(System.of(system).has_rod, parameter_letters())


def expression(value: sp.Expr, system: str = "flexible_arm") -> str:
    """Return the LaTeX of an expression for a kind of system, see `_writer`."""
    return _writer(system)(value)


def rounded_factors(value: sp.Expr) -> sp.Expr:
    """Return the expression with decimal factors to four digits."""
    return value.xreplace({f: sp.Float(f"{float(f):.4g}") for f in value.atoms(sp.Float)})


def along_the_rod(*factors: str) -> str:
    """Return three times the integral of a product of formulas along the rod."""
    product = " ".join(rf"\left({factor}\right)" for factor in factors)
    return rf"3 \int_0^1 {product}\, \mathrm{{d}}s"


def _bending(effect: Any) -> list[str]:
    """Return what b is in a law of the rod: the curvature at a place or at the root, else a part of the bending."""
    laws_of = [effect.expression(), *effect.states().values()]
    if not {s.bend, s.bend_dot, s.root, s.root_dot} & set().union(*(x.free_symbols for x in laws_of)):
        return []
    if effect.kind == "memory" and not effect.local:
        return [r"b \text{ each component of the bending}"]
    return [rf"b = \frac{{1}}{{3}} \frac{{\partial \theta}}{{\partial s}}{'' if effect.kind == 'memory' else '(0)'}"]


def effect_formula(effect: Any, system: str) -> str:
    """Return what an effect declares on a kind of system: its energy, power, law or what the instrument reports."""
    if effect.place:
        return _placed_formula(effect)
    write, has_rod = _writer(system), System.of(system).has_rod
    if effect.kind in LETTERS or effect.kind == "joint":
        symbol = "F" if getattr(effect, "on", None) is not None else LETTERS.get(effect.kind, "p")
        body = write(effect.expression())
        if getattr(effect, "local", False) and has_rod:
            body = along_the_rod(body)
        lines = [r"\theta \to \theta + p"] if effect.kind == "joint" else []
        lines += [f"{symbol} = {body}", *(write.slope(*state) for state in effect.states().items())]
        return _NEXT.join(lines + (_bending(effect) if has_rod and effect.kind in ("memory", "joint") else []))
    if effect.kind == "shape":
        # Kappa_r is the curvature at the root.
        return rf"\theta \to \theta + {write(effect.rest_angle() + effect.root_turn() * sp.Symbol('kappa_r'))}"
    return mode_formula(effect) if effect.kind == "mode" else laws([effect], system)


def mode_formula(mode: Any, push: sp.Expr | None = None) -> str:
    """Return the equation of a mode that an input pushes: by g u, or by what it alone does to the coordinate."""
    push = s.u * sp.Symbol("g", real=True) if push is None else push
    z, states = mode.displacement(), mode.states()
    rate, acceleration = (sp.Symbol(f"{z.name}{dots}", real=True) for dots in ("'", "''"))
    slope = sp.expand(states[states[z]].xreplace({states[z]: rate}))
    driven, own = slope.as_independent(z, rate, as_Add=True)
    left = sorted((-own).as_ordered_terms(), key=lambda term: not term.has(rate))
    *own, driven = (expression(term, "oscillator") for term in (acceleration, *left, driven.xreplace({s.push: push})))
    return f"{in_sum(*own)} = {driven}"


def together(effects: Iterable[Effect]) -> list[list[Effect]]:
    """Return effects in groups that share one law: the radius, what is received, what is read, and when."""
    groups: dict[str, list[Effect]] = {}
    for effect in effects:
        key = effect.kind if effect.kind in ("closure", "drive", "sensor") else effect.id()
        if effect.kind == "sensor" and effect.lateness() != 0:  # type: ignore[attr-defined]
            key = "late"
        groups.setdefault(key, []).append(effect)
    return list(groups.values())


def laws(effects: Sequence[Any], system: str, declaration: SystemDeclaration | None = None) -> str:
    """Return the one law of a group of `together`; a declared system has the names of its user."""
    arm, kind = System.of(system).has_rod, effects[0].kind
    given = declaration.input[0] if declaration is not None and declaration.input is not None else "u"
    output, told = ("q", "q_read") if declaration is None else ("y_read", "y_told")
    write = _writer(system if declaration is None else "")
    if kind == "closure":
        return rf"\rho_t/l = {write(radius_of(effects))}"
    if kind == "drive":
        if arm:
            turned: sp.Expr = s.theta_m
            for effect in effects:
                turned = effect.expression().subs(s.theta_m, turned)
            return rf"\theta_m \to {write(turned)}"
        law, states = force_received(effects, sp.Symbol(given, real=True))
        arrives = rf"{write.name(given)} \to {write(law)}"
        return _NEXT.join([arrives, *(write.slope(*state) for state in states.items())])
    late = sp.Add(*[effect.lateness() for effect in effects])
    if late != 0:
        return rf"t_{{\mathrm{{read}}}} = {in_sum('t', *(write(-term) for term in late.as_ordered_terms()))}"
    read: tuple[sp.Expr, ...] = sp.symbols("tip_x tip_y", real=True) if arm else (sp.Symbol(output, real=True),)
    for effect in effects:
        read = effect.read(*read)
    names = ("x_read", "y_read") if arm else (told,)
    return _NEXT.join(f"{letter(name)} = {write(value)}" for name, value in zip(names, read, strict=True))


def meanings(shown: str) -> str:
    """Return what the symbols mean that are in formulas, as the HTML of a sentence without its end."""
    found = {n: words for n, words in _MEANINGS.items() if re.search(rf"(?<![\w\\]){re.escape(n)}(?!\w)", shown)}
    return ", ".join(f"{inline(n)} {words}" for n, words in found.items())


def are_summed(effect: Effect) -> bool:
    """Return whether what an effect declares is a part of one of the energies."""
    return effect.kind in LETTERS and effect.kind != "memory" and getattr(effect, "on", None) is None


def summed(effects: Sequence[Effect], system: str, values: Mapping[str, float]) -> list[LatexLine]:
    """Return a line for each energy to which effects that `are_summed` add, with numbers by name."""
    terms: dict[str, list[str]] = {}
    for effect in effects:
        terms.setdefault(LETTERS[effect.kind], []).extend(_terms(effect, system, values))
    found = []
    for symbol, added in sorted(terms.items(), key=lambda item: list(_WORDS).index(item[0])):
        # The mechanics have a kinetic energy of their own.
        parts = ["T_0", *added] if symbol == "T" else added
        found.append(LatexLine(_WORDS[symbol], f"{symbol} = {in_sum(*parts)}", needed=True))
    return found


def _terms(effect: Effect, system: str, values: Mapping[str, float]) -> list[str]:
    declared = effect.expression()  # type: ignore[attr-defined]
    known = {x: sp.Float(values[x.name]) for x in declared.free_symbols if x.name in values}
    told = declared.xreplace(known)
    # A law of another form is read best as it is declared.
    polynomial = told.is_polynomial(*sorted(told.free_symbols, key=str))
    told = sp.expand(told) if polynomial else declared
    parts = [expression(rounded_factors(part), system) for part in told.as_ordered_terms()]
    if getattr(effect, "local", False):
        return [along_the_rod(in_sum(*parts))]
    return parts


def _equation(line: DeclaredLine) -> str:
    return f"{dotted(letter(line.name), line.dots)} = {expression(line.value, '')}"


def declared_formulas(name: str, effects: Iterable[Effect], known: Mapping[str, float]) -> list[LatexLine]:
    """Return the energies, forces, places and output of a declared system, named by its base.

    The equation is incomplete without every energy and force, a place at which one of the effects acts, and what is
    read where that is no coordinate.
    """
    base = declared_base(name)
    if base is None:
        return []
    used, found = {effect.place for effect in effects}, []
    for line in declared_lines(base, known):
        value = str(line.value)
        # A place may have the name of its coordinate.
        if value != line.name:
            needed = line.name in used if line.words.startswith("Place ") else value not in base.declaration.coordinates
            found.append(LatexLine(line.words, _equation(line), needed))
    return found


def known_constants(name: str) -> dict[str, float]:
    """Return the constants of a declared system with their values, by the name of its base; none of another base."""
    declaration = declaration_of(name)
    return {} if declaration is None else {n: c.value for n, c in declaration.constants.items() if not c.free}


def _placed_formula(effect: Effect) -> str:
    """Return what an effect at a place declares, in the displacement there, and what it takes from the place."""
    lines = placed_lines(effect)
    names = {x.name for line in lines for x in line.value.free_symbols}
    taken = [(f"{stem}_{effect.place}", word) for stem, word in _THERE.items()]
    where = re.sub(r"[\W_]+", " ", effect.place)
    told = [rf"{letter(name)} \text{{ the {word} at {where}}}" for name, word in taken if name in names]
    return _NEXT.join([*map(_equation, lines), *told])
