"""Mathematics that users write as text, read without running any of it: symbols with units, and a few functions."""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from fractions import Fraction

import sympy as sp

from discovery.declarations.units import dimension
from discovery.foundation.errors import InputError, suggestion

#: Exponents of the base units, none of them zero.
Dimension = Mapping[str, Fraction]

#: What a formula may call on a number without a unit; `abs`, `sqrt`, `atan2`, `dot` and `ddot` beside them know units.
FUNCTIONS: Mapping[str, Callable[[sp.Expr], sp.Expr]] = {
    "sin": sp.sin,
    "cos": sp.cos,
    "tan": sp.tan,
    "exp": sp.exp,
    "log": sp.log,
    "tanh": sp.tanh,
    "atan": sp.atan,
}
_KNOWN = (*FUNCTIONS, "abs", "sqrt", "atan2", "dot", "ddot")
#: Longest text, largest exponent and largest number: none of a mechanical system comes near them.
_LONGEST, _HIGHEST, _LARGEST = 2000, 8, 1e15


@dataclass(frozen=True)
class Quantity:
    """What a name in a formula means."""

    #: The quantity, and as far as they may stand in the formula, its first and second derivatives in time.
    symbols: tuple[sp.Expr, ...]
    unit: str  # coherent SI unit of the first


def reserved_words() -> frozenset[str]:
    """Return what no name in a formula can be."""
    return frozenset({*_KNOWN, "pi"})


def unit_words(found: Dimension) -> str:
    """Return a dimension as a unit: ``"kg m s^-2"``, or ``"1"``."""
    order = sorted(found.items(), key=lambda pair: (pair[1] < 0, pair[0]))
    return " ".join(base if power == 1 else f"{base}^{power}" for base, power in order) or "1"


def read_formula(text: str, names: Mapping[str, Quantity], unit: str | None = None) -> tuple[sp.Expr, Dimension]:
    """Return the expression that a text means, with its dimension; nothing of the text is executed.

    Parameters
    ----------
    text : str
        Numbers, names, ``+ - * / ^`` (or ``**``), parentheses, the functions of `FUNCTIONS`, ``abs``, ``sqrt``,
        ``atan2``, and ``dot(x)``, ``ddot(x)`` for the derivatives of x in time; ``pi``.
    names : mapping of str to Quantity
        What may stand in it.
    unit : str, optional
        Coherent SI unit that it must have; a plain 0 has any.

    Raises
    ------
    InputError
        For anything else than such a text, for units that cannot be added, and for another unit than `unit`.
    """
    if len(text) > _LONGEST:
        raise InputError(f"A formula of {len(text)} letters is too long. Write it with at most {_LONGEST}.")
    try:
        tree = ast.parse(text.strip().replace("^", "**"), mode="eval")
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise InputError(f"{text!r} is no formula. Write it like 'm_b*dot(x)^2/2 + m_b*g_0*l_b*cos(phi)'.") from error
    expression, found = _Reader(names).read(tree.body)
    if unit is not None and expression != 0 and dict(found) != dimension(unit):
        raise InputError(f"{text!r} is in {unit_words(found)}, and should be in {unit}. Correct it, or a unit in it.")
    return expression, found


class _Reader:
    """Turns the nodes of a formula into expressions with dimensions, and refuses every other node."""

    def __init__(self, names: Mapping[str, Quantity]) -> None:
        self.names = names

    def read(self, node: ast.expr) -> tuple[sp.Expr, Dimension]:
        """Return the expression of a node."""
        match node:
            case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
                if not (math.isfinite(value) and abs(value) <= _LARGEST):
                    raise InputError("A number of the formula is too large. Choose other units.")
                return (sp.Integer(value) if isinstance(value, int) else sp.Float(value)), {}
            case ast.Name(id=name):
                return self._name(name, 0)
            case ast.UnaryOp(op=ast.USub() | ast.UAdd() as sign, operand=operand):
                inner, found = self.read(operand)
                return (-inner if isinstance(sign, ast.USub) else inner), found
            case ast.BinOp(left=left, op=ast.Pow(), right=right):
                return self._power(left, right)
            case ast.BinOp(left=left, op=ast.Add() | ast.Sub() | ast.Mult() | ast.Div() as sign, right=right):
                return self._joined(self.read(left), sign, self.read(right), node)
            case ast.Call(func=ast.Name(id=function), args=arguments, keywords=[]):
                return self._call(function, arguments)
        raise InputError(
            f"{ast.unparse(node)!r} may not stand in a formula: it holds numbers, names, + - * / ^, parentheses and "
            f"the functions {', '.join(_KNOWN)}. Write it with these."
        )

    def _name(self, name: str, order: int) -> tuple[sp.Expr, Dimension]:
        if name == "pi" and not order:
            return sp.pi, {}
        if name not in self.names:
            hint = suggestion(name, list(self.names))
            raise InputError(f"{name!r} is not declared.{hint} Declared are {', '.join(self.names)}.")
        quantity = self.names[name]
        if order >= len(quantity.symbols):
            raise InputError(f"{'d' * order}ot({name}) may not stand here. Remove it: {_ALLOWED}")
        found = dict(dimension(quantity.unit))
        found["s"] = found.get("s", Fraction(0)) - order
        return quantity.symbols[order], {base: power for base, power in found.items() if power}

    def _joined(
        self, left: tuple[sp.Expr, Dimension], sign: ast.operator, right: tuple[sp.Expr, Dimension], node: ast.BinOp
    ) -> tuple[sp.Expr, Dimension]:
        (a, of_a), (b, of_b) = left, right
        if isinstance(sign, ast.Add | ast.Sub):
            if dict(of_a) != dict(of_b) and a != 0 and b != 0:
                raise InputError(
                    f"{ast.unparse(node.left)!r} is in {unit_words(of_a)} and {ast.unparse(node.right)!r} in "
                    f"{unit_words(of_b)}, so that they cannot be added. Correct one of them, or a unit in it."
                )
            return (a + b if isinstance(sign, ast.Add) else a - b), of_b if a == 0 else of_a
        if isinstance(sign, ast.Div) and b == 0:
            raise InputError(f"{ast.unparse(node)!r} divides by zero. Correct it.")
        way = 1 if isinstance(sign, ast.Mult) else -1
        found = {base: of_a.get(base, Fraction(0)) + way * of_b.get(base, Fraction(0)) for base in {*of_a, *of_b}}
        return (a * b if way == 1 else a / b), {base: power for base, power in found.items() if power}

    def _power(self, left: ast.expr, right: ast.expr) -> tuple[sp.Expr, Dimension]:
        base, found = self.read(left)
        try:
            exponent, _ = _Reader({}).read(right)
        except InputError:
            exponent = sp.oo
        if not exponent.is_number or not abs(exponent) <= _HIGHEST:
            raise InputError(f"The exponent {ast.unparse(right)!r} must be a number of at most {_HIGHEST}. Correct it.")
        power = Fraction(float(exponent)).limit_denominator(12)
        if base.is_number:
            return _computed(lambda: float(base) ** float(power)), {}
        return base ** sp.Rational(power.numerator, power.denominator), {
            b: p * power for b, p in found.items() if power
        }

    def _call(self, function: str, arguments: list[ast.expr]) -> tuple[sp.Expr, Dimension]:
        wanted = 2 if function == "atan2" else 1
        if function not in _KNOWN:
            hint = suggestion(function, list(_KNOWN))
            raise InputError(f"{function!r} is no function of a formula.{hint} There are {', '.join(_KNOWN)}.")
        if len(arguments) != wanted:
            raise InputError(f"{function!r} takes {wanted} argument{'s' * (wanted > 1)}, not {len(arguments)}.")
        if function in ("dot", "ddot"):
            if not isinstance(arguments[0], ast.Name):
                raise InputError(f"{function}(...) takes the name of a coordinate or of the input. {_ALLOWED}")
            return self._name(arguments[0].id, 1 if function == "dot" else 2)
        inner, found = self.read(arguments[0])
        if inner.is_number and function not in ("abs", "atan2"):
            return _computed(lambda: getattr(math, function)(float(inner))), {}
        if function == "abs":
            return sp.Abs(inner), found
        if function == "sqrt":
            return sp.sqrt(inner), {base: power / 2 for base, power in found.items()}
        if function == "atan2":
            other, of_other = self.read(arguments[1])
            if dict(found) != dict(of_other):
                raise InputError(f"'atan2' takes two of a kind, not {unit_words(found)} and {unit_words(of_other)}.")
            return sp.atan2(inner, other), {}
        if found:
            raise InputError(
                f"{function}({ast.unparse(arguments[0])}) takes a number without a unit, not {unit_words(found)}. "
                "Divide by a quantity of the same unit."
            )
        return FUNCTIONS[function](inner), {}


def _computed(number: Callable[[], float | complex]) -> sp.Expr:
    """Return a number that a formula makes of numbers alone, in the arithmetic of the machine: it cannot run away."""
    try:
        found = number()
    except (ArithmeticError, ValueError) as error:
        raise InputError(f"A number of the formula cannot be computed: {error}. Correct it.") from error
    if isinstance(found, complex) or not math.isfinite(found):
        raise InputError("A number of the formula is no finite real one. Correct it.")
    return sp.Float(found)


_ALLOWED = "a potential holds no rate, energies and forces no acceleration, and constants do not change."
