r"""Formulas as LaTeX, for exports and for the page: the one place that says how a symbol and an expression are written.

Terms as the result files name them, such as ``delta^2 theta_t'``, are written here too.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import sympy as sp
from sympy.core.alphabets import greeks
from sympy.printing.latex import LatexPrinter

from discovery.declarations import symbols as s
from discovery.declarations.registry import catalogue
from discovery.foundation.errors import InputError
from discovery.mechanics import base_names, get_base

_SPEED = sp.Symbol("v_t", positive=True)
_FIELD = {
    "theta_t": r"\theta_t", "theta_m": r"\theta_m", "delta": r"\delta", "q": "q", "theta": r"\theta_t",
    "omega": r"\dot{\theta}_t", "delta_dot": r"\dot{\delta}", "omega_m": r"\dot{\theta}_m",
    "alpha_m": r"\ddot{\theta}_m", "acceleration": r"\ddot{\theta}_t", "x": r"\bar{x}", "y": r"\bar{y}",
    "x_g": r"\bar{x}_g", "y_g": r"\bar{y}_g", "v_x": r"\dot{\bar{x}}", "v_y": r"\dot{\bar{y}}", "rho": r"\bar{\rho}",
    "v_t": "v_t", "bend": "b", "bend_dot": r"\dot{b}", "tip_x": "x", "tip_y": "y", "w2": "{w^{2}}", "length": "l",
    "slope": r"\theta(1, t)", "slope_dot": r"\dot{\theta}(1, t)", "arc": "s", "root": "b", "root_dot": r"\dot{b}",
    "r_0": r"\theta_{m,\mathrm{rec}}",
}  # fmt: skip
_ONE_COORDINATE = {
    "theta": "q", "omega": r"\dot{q}", "delta": "q", "delta_dot": r"\dot{q}", "acceleration": r"\ddot{q}",
    "slope": "q_0", "slope_dot": r"\dot{q}_0", "bend": "q", "bend_dot": r"\dot{q}", "x": "q", "v_x": r"\dot{q}",
    "r_0": r"u_{\mathrm{rec}}",
}  # fmt: skip
#: Names of what moves, whose rates have primes; and of what moves where it stands in the law of an effect.
STATES = frozenset({*_FIELD, "t"} - {"length"})
_BESIDE = frozenset({"U", "U_4", "kappa_r", "u"})
_NAME = re.compile(r"[A-Za-z]+(?:_\w+)?'*")
_SUM = r"[-+]?a+(?:[-+]a+)*"
_FACTOR = re.compile(rf"a\^a|\({_SUM}\)|\|{_SUM}\|")
_RAISED = dict(zip("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-", strict=True))
_PRINTED = str.maketrans({**_RAISED, "−": "-", "\N{NARROW NO-BREAK SPACE}": r"\,", "∞": r"\infty "})


@dataclass(frozen=True)
class LatexLine:
    """One line of mathematics without delimiters, with plain words for what it is.

    The equation of a model is incomplete without one that is `needed`, although no parameter may stand in it.
    """

    words: str
    latex: str
    needed: bool = False


@cache
def parameter_letters() -> dict[str, str]:
    """Return the letters that effects and bases declare for their parameters, by name."""
    owners: list[Any] = [*catalogue().values(), *(get_base(name) for name in base_names())]
    return {p.name: p.latex for owner in owners for p in owner.parameters() if p.latex}


def parameter_letter(name: str) -> str:
    """Return the declared letter of a parameter, else that of its name."""
    return parameter_letters().get(name) or letter(name)


def letter(name: str) -> str:
    r"""Return a name as a letter with a subscript, whole words upright; nothing in a name is a command.

    Examples
    --------
    >>> letter("beta_spring"), letter("table")
    ('\\beta_{\\mathrm{spring}}', '\\mathrm{table}')
    """
    head, _, below = name.partition("_")
    head, below = (re.sub(r"[\W_]+", " ", part).strip() for part in (head, below))
    greek = head[:1].lower() + head[1:] in (*greeks, "lamda")
    core = head if len(head) == 1 else sp.latex(sp.Symbol(head)) if greek else rf"\mathrm{{{head}}}"
    return core + (rf"_{{\mathrm{{{below}}}}}" if below else "")


def dotted(written: str, dots: int) -> str:
    """Return a letter with a dot for each time derivative, before an index that says what is meant."""
    core, below = re.fullmatch(r"(.+?)(_\w|_\{\\mathrm.*)?", written).groups("")  # type: ignore[union-attr]
    return (rf"\{'d' * dots}ot{{{core}}}" if dots else core) + below


class Writer(LatexPrinter):
    """Writes expressions: symbols by their `letters`, others by `unnamed`.

    Constants stand before what is `moving` in a product, functions last, and a sum begins with a term that is added;
    without such names all is in the order of sympy. `discovery.declarations.symbols.v2` is the square of `speed`.
    """

    def __init__(
        self,
        letters: Mapping[str, str],
        moving: Collection[str] | None = None,
        unnamed: Callable[[str], str] = lambda name: sp.latex(sp.Symbol(name)),
        speed: sp.Symbol = _SPEED,
    ) -> None:
        super().__init__({} if moving is None else {"order": "none", "inv_trig_style": "full"})
        self.letters, self.moving, self.unnamed, self.speed = letters, moving, unnamed, speed

    @classmethod
    def of_field(cls, has_rod: bool, others: Mapping[str, str], ordered: bool = True) -> Writer:
        """Return what writes the states of an arm, else of one coordinate q, in the letters of the field."""
        states, speed = (_FIELD, _SPEED) if has_rod else (_FIELD | _ONE_COORDINATE, s.omega)
        return cls({**states, **others}, STATES | _BESIDE if ordered else None, speed=speed)

    def name(self, name: str) -> str:
        """Return the letter of a symbol; what has primes is a time derivative."""
        stem = name if name in self.letters else name.rstrip("'")
        return dotted(self.letters.get(stem) or self.unnamed(stem), len(name) - len(stem))

    def slope(self, state: sp.Symbol, rate: sp.Expr) -> str:
        """Return what the time derivative of a state is."""
        written = self(state)
        dot = written.replace(r"\dot", r"\ddot") if written.startswith(r"\dot") else dotted(written, 1)
        return f"{dot} = {self(rate)}"

    def __call__(self, expression: sp.Expr) -> str:
        """Return the LaTeX of an expression."""
        # The speed itself, so that its square root and its powers look as one writes them.
        shown = s.readable(expression).subs(s.v2, self.speed**2)
        return str(self.doprint(shown.xreplace({f: sp.Float(float(f), 6) for f in shown.atoms(sp.Float)})))

    def _print_Symbol(self, expr: sp.Symbol, style: str = "plain") -> str:
        return self.name(expr.name)

    def _place(self, factor: sp.Expr) -> tuple[bool, bool, bool, str]:
        moves = any(x.name in (self.moving or ()) or x.name.endswith("'") for x in factor.free_symbols)
        return not factor.is_number, bool(factor.atoms(sp.Function, sp.Add)), moves, str(factor)

    def _print_Mul(self, expr: sp.Mul) -> str:
        if self.moving is not None:
            expr = sp.Mul(*sorted(expr.args, key=self._place), evaluate=False)
        return str(super()._print_Mul(expr))

    def _as_ordered_terms(self, expr: sp.Expr, order: str | None = None) -> list[sp.Expr]:
        if self.moving is None:
            return list(super()._as_ordered_terms(expr, order=order))
        terms = expr.as_ordered_terms()
        return sorted(terms, key=lambda term: term is not next((t for t in terms if t.as_coeff_Mul()[0] > 0), terms[0]))


def in_sum(first: str, *others: str) -> str:
    """Return the sum of terms, each of which may begin with a minus sign."""
    return " ".join([first, *(body if body.startswith("-") else f"+ {body}" for body in others)])


def number(text: str) -> str:
    r"""Return a number as it is printed elsewhere as LaTeX.

    Examples
    --------
    >>> number("−1.5 × 10⁻³")
    '-1.5\\times 10^{-3}'
    """
    return re.sub(r"[ \\,]*×[ \\,]*10(-?\d+)", r"\\times 10^{\1}", text.translate(_PRINTED))


def term(text: str) -> str:
    r"""Return a term as results name it; InputError if the text is none.

    Examples
    --------
    >>> term("delta^2 theta_t'")
    '\\delta^{2} \\dot{\\theta}_t'
    """
    kinds = re.sub(rf"{_NAME.pattern}|\d+\.?\d*", "a", text).replace(" ", "")
    while (fewer := _FACTOR.sub("a", kinds)) != kinds:
        kinds = fewer
    if not re.fullmatch(_SUM, kinds):
        raise InputError(f"The formula {text!r} cannot be read.")
    functions = {"sin": r"\sin", "cos": r"\cos", "tanh": r"\tanh", "sign": r"\operatorname{sign}"}
    write = Writer({**_FIELD, **functions}, unnamed=letter)
    written = re.sub(r"\^(\d+)", r"^{\1}", _NAME.sub(lambda found: write.name(found[0]), text))
    return re.sub(r"\|(.*?)\|", r"\\left|\1\\right|", written)


def words_in_text(text: str) -> str:
    """Return plain words with the characters escaped that LaTeX reads as commands."""
    return re.sub(r"([&%#_$])", r"\\\1", text)
