"""Sympy's expressions as presentation MathML, in the symbols of `discovery.declarations.symbols`."""

from __future__ import annotations

import re
from functools import cache
from typing import Any
from xml.dom.minidom import parseString

import sympy as sp
from sympy.printing.mathml import MathMLPresentationPrinter
from sympy.printing.precedence import precedence

from discovery.declarations.registry import catalogue
from discovery.declarations.symbols import readable, v2
from discovery.mechanics import base_names, get_base
from discovery.report.mathml import power, row, symbol

_NEGATIVE = re.compile("<mn>-([^<]*)</mn>")


def _states(coordinate: str) -> dict[str, tuple[str, int]]:
    """Return symbol and number of dots of every state; a declared system has the names of its user."""
    if not coordinate:
        return {}
    oscillator = coordinate == "q"
    moving, bending, end = ("q", "q", "q_0") if oscillator else ("delta", "b", "theta_e")
    return {
        "theta": (coordinate, 0), "omega": (coordinate, 1), "q": ("q", 0), "delta": (moving, 0),
        "delta_dot": (moving, 1),
        "theta_m": ("theta_m", 0), "omega_m": ("theta_m", 1), "alpha_m": ("theta_m", 2),
        "bend": (bending, 0), "bend_dot": (bending, 1), "w2": ("w^2", 0),
        "tip_speed": ("q" if oscillator else "v_t", int(oscillator)),
        "root": ("b", 0), "root_dot": ("b", 1),
        "x": ("x_t", 0), "y": ("y_t", 0), "x_g": ("x_g", 0), "y_g": ("y_g", 0), "v_x": ("x_t", 1), "v_y": ("y_t", 1),
        "tip_x": ("x_t", 0), "tip_y": ("y_t", 0), "U": ("U", 0), "rho": ("rho", 0), "t": ("t", 0), "u": ("u", 0),
        "slope": (end, 0), "slope_dot": (end, 1), "arc": ("s", 0), "kappa_r": ("kappa_r", 0),
        "acceleration": (coordinate, 2),
    }  # fmt: skip


class _Printer(MathMLPresentationPrinter):
    """Sympy's printer with the symbols of `discovery.declarations.symbols`, constants before states."""

    def __init__(self, coordinate: str) -> None:
        super().__init__()
        self._states = _states(coordinate)

    def _node(self, text: str):
        return self.dom.importNode(parseString(text).documentElement, deep=True)

    def _print_Symbol(self, sym, style="plain"):
        stem = sym.name.rstrip("'")
        name, dots = self._states.get(stem, (_latex(stem), 0))
        plain = symbol(name.removesuffix("^2"), dots + len(sym.name) - len(stem))
        return self._node(power(plain, "<mn>2</mn>") if name.endswith("^2") else plain)

    def _print_Pi(self, expr):
        return self._node(symbol("pi"))

    def _print_Exp1(self, expr):
        return self._node("<mi>e</mi>")

    def _print_Pow(self, expr):
        if expr.base.is_Symbol and expr.exp.is_Integer and expr.exp > 1 and expr.base.name != "w2":
            return self._node(power(self._print(expr.base).toxml(), f"<mn>{expr.exp}</mn>"))
        return super()._print_Pow(expr)

    def _print_Add(self, expr, order=None):
        terms = self._as_ordered_terms(expr, order=order)
        first = next((term for term in terms if term.as_coeff_Mul()[0] > 0), terms[0])
        parts = [self._print(first).toxml()]
        for term in (term for term in terms if term is not first):
            minus = term.as_coeff_Mul()[0] < 0
            parts += [f"<mo>{'−' if minus else '+'}</mo>", self._print(-term if minus else term).toxml()]
        return self._node(row(*parts))

    def _print_Mul(self, expr):
        number, _ = expr.as_coeff_Mul()
        top, bottom = sp.fraction(abs(number) * expr / number if number else expr)
        fraction = bottom != 1
        body = self._node("<mfrac/>" if fraction else "<mrow/>")
        if fraction:
            body.appendChild(self._product(top))
            body.appendChild(self._product(bottom))
        else:
            body = self._product(top)
        if number >= 0:
            return body
        signed = self._node("<mrow><mo>−</mo></mrow>")
        signed.appendChild(body)
        return signed

    def _product(self, expr):
        def place(factor):
            moving = any(x.name in self._states or x.name.endswith("'") for x in factor.free_symbols)
            return (not factor.is_number, bool(factor.atoms(sp.Function, sp.Add)), moving, str(factor))

        factors = sorted(sp.Mul.make_args(expr), key=place)
        if len(factors) == 1:
            return self._print(factors[0])
        out = self._node("<mrow/>")
        for i, factor in enumerate(factors):
            if i:
                out.appendChild(self._node('<mspace width="0.12em"/>'))
            out.appendChild(self.parenthesize(factor, precedence(expr), strict=False))
        return out


@cache
def _printer(coordinate: str) -> _Printer:
    return _Printer(coordinate)


@cache
def _declared() -> dict[str, str]:
    owners: list[Any] = [*catalogue().values(), *(get_base(name) for name in base_names())]
    return {p.name: p.latex for owner in owners for p in owner.parameters() if p.latex}


def _latex(name: str) -> str:
    return "l" if name == "length" else _declared().get(name, name)


def expression(value: sp.Expr, coordinate: str = "theta_t") -> str:
    """Return MathML of a sympy expression in the coordinate ``theta_t`` or ``q``, or, without one, its own names."""
    # The speed itself, so that its square root and its powers look as one writes them.
    shown = readable(value).subs(v2, sp.Symbol("tip_speed", positive=True) ** 2)
    # A negative exponent of sympy has a hyphen in its number.
    return _NEGATIVE.sub(r"<mrow><mo>−</mo><mn>\1</mn></mrow>", _printer(coordinate)._print(shown).toxml())
