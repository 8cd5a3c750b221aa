"""Mathematics printed as Python that both numpy and the compiler read."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import reduce

import sympy as sp
from sympy.printing.pycode import PythonCodePrinter

from discovery.simulation.kernel.islands import Piece


class _Printer(PythonCodePrinter):
    """Prints sympy as Python that both numpy and the compiler read; powers become products."""

    def _print_Pow(self, expr, rational=False):
        base, exponent = expr.as_base_exp()
        if exponent.is_Rational and exponent.q in (1, 2, 4) and 0 < abs(exponent.p) <= 12:
            factor = f"({self._print(base)})"
            for _ in range(exponent.q // 2):
                factor = f"_sqrt({factor})"
            product = "*".join([factor] * abs(exponent.p))
            return f"({product})" if exponent > 0 else f"(1.0/({product}))"
        return f"({self._print(base)})**({self._print(exponent)})"

    def _print_sin(self, expr):
        return f"_sin({self._print(expr.args[0])})"

    def _print_cos(self, expr):
        return f"_cos({self._print(expr.args[0])})"

    def _print_atan2(self, expr):
        return f"_atan2({self._print(expr.args[0])}, {self._print(expr.args[1])})"

    def _print_atan(self, expr):
        return f"_atan2({self._print(expr.args[0])}, 1.0)"

    def _print_exp(self, expr):
        return f"_exp({self._print(expr.args[0])})"

    def _print_Rational(self, expr):
        return repr(float(expr))

    def _print_Integer(self, expr):
        return f"{int(expr)}.0"

    def _print_Pi(self, expr):
        return repr(float(sp.pi))


def filled(text: str, values: Mapping[str, object]) -> str:
    """Return a text with what stands between two @ replaced."""
    return reduce(lambda done, key: done.replace(f"@{key}@", str(values[key])), values, text)


printed = _Printer({"fully_qualified_modules": True}).doprint


def assignments(pairs: Iterable[tuple[sp.Symbol, sp.Expr]]) -> list[str]:
    """Return one line of the body of a function for each assignment."""
    return [f"    {symbol.name} = {printed(expression)}" for symbol, expression in pairs]


def computed(pieces: Sequence[Piece]) -> tuple[list[str], list[str], list[str]]:
    """Return the names that pieces load, the lines that compute them, and the names that they assign."""
    own: dict[str, None] = {}
    loads: dict[str, None] = {}
    lines = []
    for piece in pieces:
        name, text = piece.target.name, printed(piece.expression)
        read = sorted(symbol.name for symbol in piece.expression.free_symbols)
        loads.update(dict.fromkeys(x for x in [*read, *([name] if piece.adds else [])] if x not in own))
        own[name] = None
        lines.append(f"{name} = {name} + {text}" if piece.adds else f"{name} = {text}")
    return list(loads), lines, list(own)
