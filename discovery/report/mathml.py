"""Equations as presentation MathML, which browsers draw without any script or font of their own."""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import cache
from typing import TYPE_CHECKING, Any

from markupsafe import escape

if TYPE_CHECKING:
    import sympy as sp

__all__ = ["GREEK", "block", "expression", "inline", "number", "power", "row", "symbol", "total"]

GREEK = {
    "alpha": "α", "beta": "β", "gamma": "γ", "delta": "δ", "eta": "η", "theta": "θ", "kappa": "κ", "lambda": "λ",
    "mu": "μ", "nu": "ν", "xi": "ξ", "rho": "ρ", "sigma": "σ", "tau": "τ", "phi": "φ", "varphi": "φ", "psi": "ψ",
    "omega": "ω", "Omega": "Ω", "Delta": "Δ", "Phi": "Φ",
    "Gamma": "Γ", "epsilon": "ε", "varepsilon": "ε", "zeta": "ζ", "chi": "χ", "pi": "π",
}  # fmt: skip


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
    size = escape(text.removeprefix(minus))
    return row("<mo>−</mo>", f"<mn>{size}</mn>") if text.startswith(minus) else f"<mn>{size}</mn>"


def symbol(name: str, dots: int = 0) -> str:
    """Return a symbol with subscripts after underscores, Greek letters by name, and dots for rates.

    Parameters
    ----------
    name : str
        Such as ``theta_t``; a LaTeX backslash before a Greek letter is passed over.
    dots : int
        Number of time derivatives.
    """
    # A name comes from a file: nothing in it is markup.
    head, *tail = str(escape(re.sub(r"\\mathrm|[\\{}]", "", name))).split("_")
    core = f"<mi>{GREEK.get(head, head)}</mi>"
    if dots:
        # Full stops, raised: without a mathematical font, true accents sink into the letter.
        core = f'<mover accent="false">{core}<mo accent="false">{"." * dots}</mo></mover>'
    subscript = ",".join(GREEK.get(t, t) for t in tail if t)
    return f"<msub>{core}<mi>{subscript}</mi></msub>" if subscript else core


def power(base: str, exponent: str) -> str:
    """Return a power; an index below and an exponent above share their place."""
    if base.startswith("<msub>") and base.endswith("</msub>") and base.count("<msub>") == 1:
        return f"<msubsup>{base[len('<msub>') : -len('</msub>')]}{exponent}</msubsup>"
    return f"<msup>{base}{exponent}</msup>"


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


@cache
def _printer(coordinate: str):
    from xml.dom.minidom import parseString

    import sympy as sp
    from sympy.printing.mathml import MathMLPresentationPrinter
    from sympy.printing.precedence import precedence

    oscillator = coordinate == "q"
    moving = "q" if oscillator else "delta"
    # A declared system has the names of its user.
    states: dict[str, tuple[str, int]] = {} if not coordinate else {
        "theta": (coordinate, 0), "omega": (coordinate, 1), "q": ("q", 0), "delta": (moving, 0),
        "delta_dot": (moving, 1),
        "theta_m": ("theta_m", 0), "omega_m": ("theta_m", 1), "alpha_m": ("theta_m", 2), "bend": ("b", 0),
        "bend_dot": ("b", 1), "w2": ("w^2", 0), "tip_speed": ("q" if oscillator else "v_t", int(oscillator)),
        "root": ("b", 0), "root_dot": ("b", 1),
        "x": ("x_t", 0), "y": ("y_t", 0), "x_g": ("x_g", 0), "y_g": ("y_g", 0), "v_x": ("x_t", 1), "v_y": ("y_t", 1),
        "tip_x": ("x_t", 0), "tip_y": ("y_t", 0), "U": ("U", 0), "rho": ("rho", 0), "t": ("t", 0), "u": ("u", 0),
        "slope": ("theta_e", 0), "slope_dot": ("theta_e", 1), "arc": ("s", 0), "kappa_r": ("kappa_r", 0),
        "acceleration": (coordinate, 2),
    }  # fmt: skip

    class Printer(MathMLPresentationPrinter):
        """Sympy's printer with the symbols of `discovery.declarations.symbols`, constants before states."""

        def _node(self, text: str):
            return self.dom.importNode(parseString(text).documentElement, deep=True)

        def _print_Symbol(self, sym, style="plain"):
            stem = sym.name.rstrip("'")
            name, dots = states.get(stem, (_latex(stem), 0))
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
                moving = any(x.name in states or x.name.endswith("'") for x in factor.free_symbols)
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

    return Printer()


@cache
def _declared() -> dict[str, str]:
    from discovery.declarations.registry import catalogue
    from discovery.mechanics import base_names, get_base

    owners: list[Any] = [*catalogue().values(), *(get_base(name) for name in base_names())]
    return {p.name: p.latex for owner in owners for p in owner.parameters() if p.latex}


def _latex(name: str) -> str:
    return "l" if name == "length" else _declared().get(name, name)


def expression(value: sp.Expr, coordinate: str = "theta_t") -> str:
    """Return MathML of a sympy expression in the symbols of `discovery.declarations.symbols`.

    Parameters
    ----------
    value : sympy.Expr
        The expression.
    coordinate : str
        What the coordinate is called: ``theta_t`` of an arm, ``q`` of an oscillator; empty where every symbol is
        written as it is named.
    """
    import sympy as sp

    from discovery.declarations.symbols import v2

    # The speed itself, so that its square root and its powers look as one writes them.
    shown = sp.sympify(value).subs(v2, sp.Symbol("tip_speed", positive=True) ** 2)
    return _printer(coordinate)._print(shown).toxml()
