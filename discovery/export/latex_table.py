"""The parameters of a model as a LaTeX table."""

from __future__ import annotations

import math
import re
from collections.abc import Callable

import sympy as sp

from discovery.export.fitted import FittedModel
from discovery.foundation.estimate_text import estimate_text


def _number(value: float, sd: float) -> str:
    """Return a value with its standard deviation, as many digits as that warrants."""
    text = estimate_text(value, sd).replace("+-", r"\pm")
    return re.sub(r"e([+-]?\d+)$", lambda found: rf" \times 10^{{{int(found[1])}}}", text)


def _unit(unit: str) -> str:
    """Return a unit in upright letters."""
    factors = [f.partition("^") for f in unit.split() if f != "1"]
    return r"\,".join(rf"\mathrm{{{u}}}" + (f"^{{{p}}}" if p else "") for u, _, p in factors) or "1"


def words_in_text(text: str) -> str:
    """Return plain words with the characters escaped that LaTeX reads as commands."""
    return re.sub(r"([&%#_$])", r"\\\1", text)


def parameter_table(found: FittedModel, write: Callable[[sp.Expr], str]) -> list[str]:
    """Return the lines of a tabular environment: value with one standard deviation, unit and meaning of each parameter.

    `write` returns the LaTeX of a symbol.
    """
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
