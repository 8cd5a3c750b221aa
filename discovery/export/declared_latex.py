"""The equations of a declared system with its effects, as LaTeX in the names of its user."""

from __future__ import annotations

import re

import sympy as sp
import sympy.abc

from discovery.declarations.effect import Drive, Sensor
from discovery.declarations.registry import effect_name
from discovery.equations.declared_terms import DeclaredLine, declared_lines, placed_lines
from discovery.equations.model import Model
from discovery.export.latex_writer import LatexLine
from discovery.mechanics.systems import declared_base

_READ = sp.Symbol("y_read", real=True)


def declared_latex(model: Model) -> list[LatexLine]:
    """Return what was declared, what each effect adds at its place, what is received and what is read."""
    base = declared_base(model.base)
    assert base is not None  # only declared systems have places
    found = declared_lines(base)
    for effect in model.terms:
        if effect.place:
            found += placed_lines(effect)
        elif isinstance(effect, Drive):
            found.append(DeclaredLine(effect_name(effect.id()), "u_received", 0, sp.sympify(effect.expression())))
        elif isinstance(effect, Sensor):
            late = effect.lateness()
            value = sp.Symbol("t", real=True) - late if late != 0 else sp.sympify(effect.oscillator_reading(_READ))
            found.append(DeclaredLine(effect_name(effect.id()), "t_read" if late != 0 else "y_told", 0, value))
    return [LatexLine(line.words, f"{_dotted(line.name, line.dots)} = {_latex(line.value)}") for line in found]


def _latex(value: sp.Expr) -> str:
    names = {x: _dotted(x.name.rstrip("'"), len(x.name) - len(x.name.rstrip("'"))) for x in value.free_symbols}
    return sp.latex(value, symbol_names=names, mul_symbol=None)


def _dotted(name: str, dots: int) -> str:
    """Return a name as a letter with a subscript, whole words upright, with dots for rates."""
    head, _, below = name.partition("_")
    letter = sp.latex(sp.Symbol(head)) if len(head) == 1 or hasattr(sympy.abc, head) else rf"\mathrm{{{head}}}"
    letter = rf"\{'d' * dots}ot{{{letter}}}" if dots else letter
    return letter + (rf"_{{\mathrm{{{re.sub('_', ' ', below)}}}}}" if below else "")
