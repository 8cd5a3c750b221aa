"""Mathematics as LaTeX in the field's letters: expressions, declared systems, and the parameters as a table."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass

import sympy as sp
import sympy.abc

from discovery.declarations import symbols as s
from discovery.declarations.effect import Mode
from discovery.equations.declared_terms import every_line
from discovery.equations.model import Model
from discovery.export.fitted import FittedModel
from discovery.foundation.estimate_text import estimate_text
from discovery.mechanics.systems import declared_base

#: The speed itself, so that its square root and its powers look as one writes them.
_SPEED = sp.Symbol("v_t", positive=True)
_NAMES = {
    "theta_t": r"\theta_t", "theta_t'": r"\dot{\theta}_t", "theta_t''": r"\ddot{\theta}_t", "theta_m": r"\theta_m",
    "theta_m'": r"\dot{\theta}_m",
    "theta_m''": r"\ddot{\theta}_m", "delta": r"\delta", "delta'": r"\dot{\delta}", "q": "q", "q'": r"\dot{q}",
    "q''": r"\ddot{q}", "theta": r"\theta_t", "omega": r"\dot{\theta}_t", "delta_dot": r"\dot{\delta}",
    "omega_m": r"\dot{\theta}_m", "alpha_m": r"\ddot{\theta}_m", "x": r"\bar{x}", "y": r"\bar{y}",
    "x_g": r"\bar{x}_g", "y_g": r"\bar{y}_g", "v_x": r"\dot{\bar{x}}", "v_y": r"\dot{\bar{y}}", "rho": r"\bar{\rho}",
    "v_t": "v_t", "bend": "b", "bend_dot": r"\dot{b}", "tip_x": "x", "tip_y": "y", "w2": "{w^{2}}", "length": "l",
    "slope": r"\theta(1, t)", "slope_dot": r"\dot{\theta}(1, t)", "arc": "s",
    "root": "b", "root_dot": r"\dot{b}", "r_0": r"\theta_{m,\mathrm{rec}}", "u'": r"\dot{u}", "u''": r"\ddot{u}",
}  # fmt: skip
#: Names of symbols that have a letter of their own, the parameters apart.
LETTERED = frozenset(_NAMES)


@dataclass(frozen=True)
class LatexLine:
    """One line of mathematics without delimiters, with plain words for what it is; empty where it goes on."""

    words: str
    latex: str


class Writer:
    """Writes expressions of one model: field symbols, parameters by their declared letters."""

    def __init__(self, model: Model) -> None:
        letters = {n: p.latex for n, p in model.parameters.items() if p.latex}
        self.names = {**_NAMES, **letters}
        if not model.mechanics.system.has_rod:
            self.names |= {"theta": "q", "omega": r"\dot{q}", "delta": "q", "delta_dot": r"\dot{q}"}
            self.names |= {"v_t": r"|\dot{q}|", "r_0": r"u_{\mathrm{rec}}"}
        for mode in (e for e in model.terms if isinstance(e, Mode)):
            z = mode.displacement()
            letter, rate = sp.latex(z), mode.states()[z]
            self.names |= {f"{z}_0": letter, f"{rate}_0": rf"\dot{{{letter}}}", f"{z}_0''": rf"\ddot{{{letter}}}"}

    def rate(self, state: sp.Symbol) -> str:
        """Return the LaTeX of the time derivative of a state."""
        letter = self(state)
        return letter.replace(r"\dot", r"\ddot") if letter.startswith(r"\dot") else rf"\dot{{{letter}}}"

    def __call__(self, expression: sp.Expr) -> str:
        """Return the LaTeX of an expression."""
        shown = s.readable(expression).subs(s.v2, _SPEED**2)
        rounded = shown.xreplace({f: sp.Float(float(f), 6) for f in shown.atoms(sp.Float)})
        known = {x: self.names[x.name] for x in rounded.free_symbols if x.name in self.names}
        return sp.latex(rounded, symbol_names=known, mul_symbol=None)


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
    return [
        LatexLine(line.words, f"{_dotted(line.name, line.dots)} = {_latex(line.value)}")
        for line in every_line(base, model.terms)
    ]


def _latex(value: sp.Expr) -> str:
    names = {x: _dotted(x.name.rstrip("'"), len(x.name) - len(x.name.rstrip("'"))) for x in value.free_symbols}
    return sp.latex(s.readable(value), symbol_names=names, mul_symbol=None)


def _dotted(name: str, dots: int) -> str:
    """Return a name as a letter with a subscript, whole words upright, with dots for rates."""
    head, _, below = name.partition("_")
    letter = sp.latex(sp.Symbol(head)) if len(head) == 1 or hasattr(sympy.abc, head) else rf"\mathrm{{{head}}}"
    letter = rf"\{'d' * dots}ot{{{letter}}}" if dots else letter
    return letter + (rf"_{{\mathrm{{{re.sub('_', ' ', below)}}}}}" if below else "")
