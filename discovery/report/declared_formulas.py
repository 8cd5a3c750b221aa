"""A system in its own equations, and the effects at its places, as formulas."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from markupsafe import escape

from discovery.declarations.effect import Effect
from discovery.equations.declared_terms import DeclaredLine, declared_lines, placed_lines
from discovery.mechanics.systems import declaration_of, declared_base
from discovery.report.effect_formulas import NEXT, equal, laws
from discovery.report.mathml import row, symbol
from discovery.report.mathml_expression import expression

#: What an effect may take from its place, by the beginning of the symbol.
_THERE = {"k": "stiffness", "xi_at": "damping"}


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
    return row(NEXT.join([*(_equation(line) for line in lines), *told]))


def fault_formula(effects: Sequence[Effect], base: str, system: str) -> str:
    """Return the law of what the input or the instrument of a declared system does, in the name of the input."""
    declaration = declaration_of(base)
    given = "u" if declaration is None or declaration.input is None else declaration.input[0]
    return laws(effects, system, (given, "y_read", "y_told"))
