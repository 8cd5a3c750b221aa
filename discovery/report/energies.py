"""The energies of an arm with the numbers of a fit: one sum for each letter, its numbers multiplied out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import sympy as sp

from discovery.declarations.effect import Effect
from discovery.report.effect_formulas import LETTERS, along_the_rod, coordinate_name, equal, rounded_factors, signed
from discovery.report.mathml import inline, row, symbol
from discovery.report.mathml_expression import expression

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
        return [along_the_rod(row(*[expression(parts[0], coordinate), *_signed(parts[1:], coordinate)]))]
    return [expression(part, coordinate) for part in parts]


def _signed(parts: Sequence[sp.Expr], coordinate: str) -> list[str]:
    return [signed(expression(part, coordinate)) for part in parts]
