"""A model as a Python file that rebuilds its sympy expressions: readable, exact to the last digit."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import TYPE_CHECKING

import sympy as sp
from sympy.printing.str import StrPrinter

from discovery.export.fitted import FittedModel, fitted_model
from discovery.export.source_text import composition, docstring, origin
from discovery.export.symbolic import SymbolicModel, in_parts, to_sympy

if TYPE_CHECKING:
    from discovery.equations.model import Model
    from discovery.estimation.fit import Fit


class _Printer(StrPrinter):
    """Prints expressions as Python of `from sympy import ...`: rationals stay exact, decimals keep all digits."""

    def _print_Symbol(self, expr):
        return identifier(expr.name)

    def _print_Rational(self, expr):
        return f"Rational({expr.p}, {expr.q})"

    def _print_Float(self, expr):
        return repr(float(expr))


def identifier(name: str) -> str:
    """Return a Python name for a symbol: theta_t_ddot for theta_t''."""
    stem = name.rstrip("'")
    return stem + {0: "", 1: "_dot", 2: "_ddot"}[len(name) - len(stem)]


def _everything(found: SymbolicModel) -> list[sp.Basic]:
    pairs = [part for pair in (*found.drive, *found.assignments) for part in pair]
    equations = [] if found.equation is None else [found.equation]
    rest = (*found.recorded, *found.states, *found.slopes, *found.reading, *found.initial, *found.memory)
    return [*found.parameters, *pairs, found.lateness, *rest, *equations]


def to_sympy_file(source: FittedModel | Fit | Model, values: Mapping[str, float] | None = None) -> str:
    """Return Python source that needs sympy alone and defines what `SymbolicModel` holds, with ``PARAMETERS``.

    `values` replace those of `source` [SI, radians]. InputError if a parameter has no value.
    """
    fitted = fitted_model(source, values)
    found = to_sympy(fitted)
    write = _Printer().doprint
    parts, initial = in_parts(found.initial)

    def sequence(name: str, items) -> str:
        return "\n".join([f"{name} = [", *[f"    {item}," for item in items], "]"])

    symbols = sorted({x for e in _everything(found) for x in e.free_symbols}, key=lambda x: x.name)
    body = [
        sequence("recorded", map(write, found.recorded)),
        sequence("states", map(write, found.states)),
        sequence("drive", (f"({write(a)}, {write(e)})" for a, e in found.drive)),
        sequence("assignments", (f"({write(a)}, {write(e)})" for a, e in found.assignments)),
        sequence("slopes", map(write, found.slopes)),
        sequence("reading", map(write, found.reading)),
        f"lateness = {write(found.lateness)}",
        *(f"{write(a)} = {write(e)}" for a, e in parts),
        sequence("initial", map(write, initial)),
        f"equation = {'None' if found.equation is None else write(found.equation)}",
        sequence("memory", map(write, found.memory)),
        "PARAMETERS = {"
        + ", ".join(f"{identifier(n)}: {v!r}" for n, v in fitted.values.items() if sp.Symbol(n, real=True) in symbols)
        + "}",
    ]
    text = "\n".join(body)
    names = sorted(set(re.findall(r"\b([A-Z][A-Za-z0-9]+|[a-z]+2?)\(", text)) & set(dir(sp)) | {"Symbol"})
    names += ["pi"] * bool(re.search(r"\bpi\b", text))
    declared = [
        f'{identifier(x.name)} = Symbol("{x.name}", real=True{", nonnegative=True" if x.is_nonnegative else ""})'
        for x in symbols
    ]
    words = (
        "Evaluate drive, assignments and slopes (of states) in this order; reading is what the instrument reports of\n"
        "the state that is lateness old. initial is the state for a deflection and a rate. SI units, radians."
    )
    title = f"Base {composition(fitted)}, as sympy."
    head = f'"""{docstring(title, words, chr(10).join(origin(fitted)))}\n"""\n'
    return "\n".join([head, f"from sympy import {', '.join(names)}\n", *declared, "", text]) + "\n"
