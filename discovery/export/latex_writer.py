"""A model's letters, declared systems line by line, and the parameters as a table, in LaTeX."""

from __future__ import annotations

import math
import re
from collections.abc import Callable

import sympy as sp

from discovery.declarations.effect import Mode
from discovery.equations.declared_terms import every_line
from discovery.equations.latex import LatexLine, Writer, dotted, letter, words_in_text
from discovery.equations.model import Model
from discovery.export.fitted import FittedModel
from discovery.foundation.estimate_text import estimate_text
from discovery.mechanics.systems import declared_base


def model_writer(model: Model) -> Writer:
    """Return what writes expressions of one model: field symbols, parameters by their declared letters."""
    letters = {n: p.latex for n, p in model.parameters.items() if p.latex}
    for mode in (e for e in model.terms if isinstance(e, Mode)):
        z = mode.displacement()
        symbol, rate = sp.latex(z), mode.states()[z]
        letters |= {f"{z}_0": symbol, f"{rate}_0": dotted(symbol, 1)}
    return Writer.of_field(model.mechanics.system.has_rod, letters, ordered=False)


def _number(value: float, sd: float) -> str:
    """Return a value with its standard deviation, as many digits as that warrants."""
    text = estimate_text(value, sd).replace("+-", r"\pm")
    return re.sub(r"e([+-]?\d+)$", lambda found: rf" \times 10^{{{int(found[1])}}}", text)


def _unit(unit: str) -> str:
    """Return a unit in upright letters."""
    factors = [f.partition("^") for f in unit.split() if f != "1"]
    return r"\,".join(rf"\mathrm{{{u}}}" + (f"^{{{p}}}" if p else "") for u, _, p in factors) or "1"


def parameter_table(found: FittedModel, write: Callable[[sp.Expr], str]) -> list[str]:
    """Return the lines of a tabular of the parameters: symbol by `write`, value with its sd, unit and meaning."""
    lines = [r"\begin{tabular}{llll}", r"parameter & value & unit & meaning \\ \hline"]
    for name, parameter in found.model.parameters.items():
        unit = _unit(found.unit_of(name))
        value = _number(found.values[name], found.sd.get(name, math.nan))
        letter = write(sp.Symbol(name, real=True))
        note = parameter.meaning + (
            f", {found.reasons[name]}" if name in found.reasons else "" if name in found.fitted else ", held"
        )
        lines.append(f"${letter}$ & ${value}$ & ${unit}$ & {words_in_text(note)} \\\\")
    return [*lines, r"\end{tabular}"]


def declared_latex(model: Model) -> list[LatexLine]:
    """Return what was declared, what each effect adds at its place, what is received and what is read."""
    base = declared_base(model.base)
    assert base is not None  # only declared systems have places
    write = Writer({}, unnamed=letter)
    return [
        LatexLine(line.words, f"{dotted(letter(line.name), line.dots)} = {write(line.value)}")
        for line in every_line(base, model.terms, model.known)
    ]
