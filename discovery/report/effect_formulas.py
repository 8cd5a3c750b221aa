"""What effects and declared systems say, as formulas: energies, powers, laws, what the instrument reports."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import sympy as sp
from markupsafe import escape

from discovery.declarations import symbols as s
from discovery.declarations.effect import Effect
from discovery.declarations.system import System
from discovery.equations.contributions import force_received, radius_of
from discovery.equations.declared_terms import DeclaredLine, declared_lines, placed_lines
from discovery.mechanics.systems import declaration_of, declared_base
from discovery.report.mathml import inline, row, symbol
from discovery.report.mathml_expression import expression

#: Letters of the energies, and of the power of a load or a memory; a mode has none.
LETTERS = {"kinetic": "T", "potential": "V", "dissipation": "D", "load": "P", "memory": "P"}
_NEXT = '<mo>,</mo><mspace width="1em"/>'
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
    "x_g": "the first moment of the mass along x, in lengths of the arm",
    "y_g": "that along y",
}
#: What an effect may take from its place, by the beginning of the symbol.
_THERE = {"k": "stiffness", "xi_at": "damping"}


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
        return row(_NEXT.join(lines))
    if effect.kind == "joint":
        assert declared is not None
        turn = equal(symbol("p"), expression(declared(), name))
        return row(_NEXT.join([_turned(symbol("p")), turn, *_states(effect, name), *_bending(effect, name)]))
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
    """Return the one law of a group of `together`; `names` are of input, output and what is told, without a rod."""
    arm, kind = System.of(system).has_rod, effects[0].kind
    # A declared system has the names of its user.
    name = coordinate_name(system) if arm or names[1] == "q" else ""
    if kind == "closure":
        return equal(row(symbol("rho_t"), "<mo>/</mo>", symbol("l")), expression(radius_of(effects), name))
    if kind == "drive":
        if arm:
            turned: sp.Expr = s.theta_m
            for effect in effects:
                turned = effect.expression().subs(s.theta_m, turned)
            return row(symbol(s.theta_m.name), "<mo>→</mo>", expression(turned, name))
        law, states = force_received(effects, sp.Symbol(names[0], real=True))
        arrives = row(symbol(names[0]), "<mo>→</mo>", expression(law, name))
        slopes = (equal(symbol(z.name, 1), expression(e, name)) for z, e in states.items())
        return row(_NEXT.join([arrives, *slopes]))
    late = sp.Add(*[effect.lateness() for effect in effects])
    if late != 0:
        since = [signed(expression(-term, name)) for term in late.as_ordered_terms()]
        return equal(symbol("t_read"), row(symbol("t"), *since))
    read: tuple[sp.Expr, ...] = sp.symbols("tip_x tip_y", real=True) if arm else (sp.Symbol(names[1], real=True),)
    for effect in effects:
        read = effect.read(*read)
    told = ("x_read", "y_read") if arm else names[2:]
    return row(_NEXT.join(equal(symbol(n), expression(e, name)) for n, e in zip(told, read, strict=True)))


def meanings(shown: str) -> str:
    """Return what the symbols mean that are in formulas, as the HTML of a sentence without its end."""
    parts = {n: symbol(n).removeprefix("<msub>").removesuffix("</msub>") for n in _MEANINGS}
    return ", ".join(f"{inline(symbol(n))} {words}" for n, words in _MEANINGS.items() if parts[n] in shown)


def are_summed(effect: Effect) -> bool:
    """Return whether what an effect declares is a part of one of the energies."""
    return effect.kind in LETTERS and effect.kind != "memory" and getattr(effect, "on", None) is None


def summed(effects: Sequence[Effect], system: str, values: Mapping[str, float]) -> list[tuple[str, str]]:
    """Return words and MathML for each energy to which effects that `are_summed` add, with numbers by name."""
    terms: dict[str, list[str]] = {}
    for effect in effects:
        terms.setdefault(LETTERS[effect.kind], []).extend(_terms(effect, coordinate_name(system), values))
    found = []
    for letter, (first, *others) in sorted(terms.items(), key=lambda item: list(_WORDS).index(item[0])):
        # The mechanics have a kinetic energy of their own.
        whole = symbol("T_0") if letter == "T" else first
        rest = [first, *others] if letter == "T" else others
        found.append((_WORDS[letter], equal(symbol(letter), row(whole, *map(signed, rest)))))
    return found


def _terms(effect: Effect, coordinate: str, values: Mapping[str, float]) -> list[str]:
    declared = effect.expression()  # type: ignore[attr-defined]
    known = {x: sp.Float(values[x.name]) for x in declared.free_symbols if x.name in values}
    told = declared.xreplace(known)
    # A law of another form is read best as it is declared.
    polynomial = told.is_polynomial(*sorted(told.free_symbols, key=str))
    told = sp.expand(told) if polynomial else declared
    parts = [rounded_factors(part) for part in told.as_ordered_terms()]
    if getattr(effect, "local", False):
        others = [signed(expression(part, coordinate)) for part in parts[1:]]
        return [along_the_rod(row(expression(parts[0], coordinate), *others))]
    return [expression(part, coordinate) for part in parts]


def _equation(line: DeclaredLine) -> str:
    return equal(symbol(line.name, line.dots), expression(line.value, ""))


def declared_formulas(name: str, effects: Iterable[Effect]) -> list[tuple[str, str, bool]]:
    """Return words and MathML of the energies, forces, places and output of a declared system, named by its base.

    Third, whether the equation is incomplete without it: so is every energy and force, a place at which one of the
    effects acts, and what is read where that is no coordinate.
    """
    base = declared_base(name)
    if base is None:
        return []
    used, found = {effect.place for effect in effects}, []
    for line in declared_lines(base):
        value = str(line.value)
        # A place may have the name of its coordinate.
        if value != line.name:
            needed = line.name in used if line.words.startswith("Place ") else value not in base.declaration.coordinates
            found.append((line.words, _equation(line), needed))
    return found


def known_constants(name: str) -> dict[str, float]:
    """Return the constants of a declared system with their values, by the name of its base; none of another base."""
    declaration = declaration_of(name)
    return {} if declaration is None else {n: c.value for n, c in declaration.constants.items() if not c.free}


def placed_formula(effect: Effect) -> str:
    """Return what an effect at a place declares, in the displacement there, and what it takes from the place."""
    lines = placed_lines(effect)
    names = {x.name for line in lines for x in line.value.free_symbols}
    taken = [(f"{stem}_{effect.place}", word) for stem, word in _THERE.items()]
    told = [
        row(symbol(name), f"<mtext> the {word} at {escape(effect.place.replace('_', ' '))}</mtext>")
        for name, word in taken
        if name in names
    ]
    return row(_NEXT.join([*(_equation(line) for line in lines), *told]))


def fault_formula(effects: Sequence[Effect], base: str, system: str) -> str:
    """Return the law of what the input or the instrument of a declared system does, in the name of the input."""
    declaration = declaration_of(base)
    given = "u" if declaration is None or declaration.input is None else declaration.input[0]
    return laws(effects, system, (given, "y_read", "y_told"))
