"""A system in its own equations, and the effects at its places, as formulas."""

from __future__ import annotations

from typing import TYPE_CHECKING

from discovery.declarations.effect import Effect
from discovery.report.effect_formulas import NEXT, equal
from discovery.report.mathml import row, symbol
from discovery.report.mathml_expression import expression

if TYPE_CHECKING:
    from discovery.equations.declared_terms import DeclaredLine

__all__ = ["declared_formulas", "placed_formula"]


def _equation(line: DeclaredLine) -> str:
    return equal(symbol(line.name, line.dots), expression(line.value, ""))


def declared_formulas(name: str) -> list[tuple[str, str]]:
    """Return words and MathML of energies, forces, places and output of a declared system, by the name of its base."""
    from discovery.equations.declared_terms import declared_lines
    from discovery.mechanics.systems import declared_base

    base = declared_base(name)
    return [] if base is None else [(line.words, _equation(line)) for line in declared_lines(base)]


def placed_formula(effect: Effect) -> str:
    """Return what an effect at a place declares, in the displacement there."""
    from discovery.equations.declared_terms import placed_lines

    return row(NEXT.join(_equation(line) for line in placed_lines(effect)))
