"""Equations as presentation MathML, which browsers draw without any script or font of their own."""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import cache
from typing import TYPE_CHECKING

from discovery.errors import InputError

if TYPE_CHECKING:
    import sympy as sp

__all__ = ["block", "expression", "formula", "inline", "number", "row", "symbol", "total"]

_GREEK = {
    "alpha": "α", "beta": "β", "gamma": "γ", "delta": "δ", "eta": "η", "theta": "θ", "kappa": "κ", "lambda": "λ",
    "mu": "μ", "nu": "ν", "xi": "ξ", "rho": "ρ", "sigma": "σ", "tau": "τ", "phi": "φ", "varphi": "φ", "psi": "ψ",
    "omega": "ω", "Omega": "Ω", "Delta": "Δ", "Phi": "Φ", "epsilon": "ε", "varepsilon": "ε", "zeta": "ζ", "chi": "χ",
}  # fmt: skip
_FUNCTIONS = ("sin", "cos", "sign", "tanh", "sqrt")


def row(*parts: str) -> str:
    """Return parts side by side."""
    return f"<mrow>{''.join(parts)}</mrow>"


def inline(body: str) -> str:
    """Return a formula within a line of text."""
    return f"<math>{body}</math>"


def block(body: str) -> str:
    """Return a formula on a line of its own."""
    return f'<math display="block">{body}</math>'


def number(text: str) -> str:
    """Return a number as it is printed elsewhere, its minus sign as an operator."""
    minus = "\N{MINUS SIGN}"
    return row("<mo>−</mo>", f"<mn>{text[1:]}</mn>") if text.startswith(minus) else f"<mn>{text}</mn>"


def symbol(name: str, dots: int = 0) -> str:
    """Return a symbol with subscripts after underscores, Greek letters by name, and dots for rates.

    Parameters
    ----------
    name : str
        Such as ``theta_t``; a LaTeX backslash before a Greek letter is passed over.
    dots : int
        Number of time derivatives.
    """
    head, *tail = re.sub(r"[\\{}]", "", name).split("_")
    core = f"<mi>{_GREEK.get(head, head)}</mi>"
    if dots:
        core = f'<mover accent="true">{core}<mo>{"˙¨"[dots - 1]}</mo></mover>'
    subscript = ",".join(_GREEK.get(t, t) for t in tail if t)
    return f"<msub>{core}<mi>{subscript}</mi></msub>" if subscript else core


def total(terms: Sequence[tuple[str, str]]) -> str:
    """Return a sum of (number as text, MathML of the factor); an empty number stands for one."""
    parts: list[str] = []
    for text, factor in terms:
        minus = text.startswith("\N{MINUS SIGN}")
        size = text[1:] if minus else text
        if minus or parts:
            parts.append(f"<mo>{'−' if minus else '+'}</mo>")
        if size:
            parts.append(f"<mn>{size}</mn>")
        parts.append(row('<mspace width="0.17em"/>' if size and factor else "", factor))
    return row(*parts) if parts else "<mn>0</mn>"


class _Reader:
    """Recursive descent over a small language: sums of products of names, powers, |x| and functions."""

    _TOKEN = re.compile(r"\s*(?:(?P<number>\d+\.?\d*)|(?P<name>[A-Za-z]+(?:_\w+)?)(?P<dots>'*)|(?P<mark>[-+^()|]))")

    def __init__(self, text: str) -> None:
        self.tokens: list[re.Match[str]] = []
        position = 0
        while position < len(text.rstrip()):
            token = self._TOKEN.match(text, position)
            if token is None:
                raise InputError(f"The formula {text!r} cannot be read at {text[position:]!r}.")
            self.tokens.append(token)
            position = token.end()
        self.position = 0

    def peek(self) -> str:
        return self.tokens[self.position].group().strip() if self.position < len(self.tokens) else ""

    def take(self) -> re.Match[str]:
        if self.position >= len(self.tokens):
            raise InputError("A formula ends too early.")
        self.position += 1
        return self.tokens[self.position - 1]

    def sum(self) -> str:
        parts = []
        while self.peek() not in ("", ")", "|"):
            if self.peek() in "+-":
                parts.append(f"<mo>{'−' if self.take().group().strip() == '-' else '+'}</mo>")
            parts.append(self.product())
        return row(*parts)

    def product(self) -> str:
        parts = [self.power()]
        while self.peek() and self.peek() not in ("+", "-", ")", "|") or (self.peek() == "|" and not self.inside):
            parts += ['<mspace width="0.12em"/>', self.power()]
        return row(*parts)

    inside = False

    def power(self) -> str:
        base = self.atom()
        if self.peek() != "^":
            return base
        self.take()
        return f"<msup>{base}{self.atom()}</msup>"

    def atom(self) -> str:
        token = self.take()
        mark = token["mark"]
        if token["number"]:
            return f"<mn>{token['number']}</mn>"
        if mark == "|":
            self.inside = True
            body = self.sum()
            self.take()
            self.inside = False
            return row("<mo>|</mo>", body, "<mo>|</mo>")
        if mark == "(":
            body = self.sum()
            self.take()
            return row("<mo>(</mo>", body, "<mo>)</mo>")
        if mark:
            raise InputError(f"A formula has {mark!r} where a factor should be.")
        if token["name"] in _FUNCTIONS and self.peek() == "(":
            return row(f"<mi>{token['name']}</mi>", "<mo>&#x2061;</mo>", self.atom())
        return symbol(token["name"], len(token["dots"]))


def formula(text: str) -> str:
    """Return MathML of a term as results name it, such as ``delta^2 theta_t'`` or ``1 - a delta^2``.

    Raises
    ------
    InputError
        If the text is not such a formula.
    """
    reader = _Reader(text)
    body = reader.sum()
    if reader.peek():
        raise InputError(f"The formula {text!r} cannot be read at {reader.peek()!r}.")
    return body


@cache
def _printer(coordinate: str):
    from sympy.printing.mathml import MathMLPresentationPrinter

    states = {
        "theta": (coordinate, 0), "omega": (coordinate, 1), "theta_m": ("theta_m", 0), "omega_m": ("theta_m", 1),
        "alpha_m": ("theta_m", 2), "delta_dot": ("delta", 1), "v2": ("v^2", 0), "w2": ("w^2", 0), "length": ("l", 0),
        "x_g": ("x_g", 0), "y_g": ("y_g", 0), "tip_x": ("x_t", 0), "tip_y": ("y_t", 0),
    }  # fmt: skip

    class Printer(MathMLPresentationPrinter):
        """Sympy's printer with the symbols of `discovery.symbols`."""

        def _print_Symbol(self, sym, style="plain"):  # noqa: N802 (sympy's name)
            from xml.dom.minidom import parseString

            name, dots = states.get(sym.name, (_latex(sym.name), 0))
            if name.endswith("^2"):
                text = f"<msup>{symbol(name[:-2] + '_t')}<mn>2</mn></msup>" if name == "v^2" else f"<msup>{symbol(name[:-2])}<mn>2</mn></msup>"
            else:
                text = symbol(name, dots)
            return self.dom.importNode(parseString(text).documentElement, deep=True)

    return Printer({"fold_short_frac": False, "mul_symbol": None})


@cache
def _declared() -> dict[str, str]:
    from discovery.mechanics import base_names, get_base
    from discovery.registry import catalogue

    owners = [*catalogue().values(), *(get_base(name) for name in base_names())]
    return {p.name: p.latex for owner in owners for p in owner.parameters() if p.latex}


def _latex(name: str) -> str:
    return _declared().get(name, name)


def expression(value: sp.Expr, coordinate: str = "theta_t") -> str:
    """Return MathML of a sympy expression in the symbols of `discovery.symbols`.

    Parameters
    ----------
    value : sympy.Expr
        The expression.
    coordinate : str
        What the coordinate is called: ``theta_t`` of an arm, ``q`` of an oscillator.
    """
    import sympy as sp

    printer = _printer(coordinate)
    return printer._print(sp.sympify(value)).toxml()
