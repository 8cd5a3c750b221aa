"""Which effects each term of straight-line mathematics belongs to.

A term that vanishes as the amplitudes of an effect are zero belongs to that effect. Sums are broken where their terms
belong to different effects, also sums within other expressions. Functions get names, and so does what stands in
several places.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import sympy as sp

#: Ids of effects of which any must be present; None for what always runs.
Effects = frozenset[str] | None
#: Operations from which an owned part of a sum, or a number that only parameters enter, is worth a name.
_WORTH = 5
_COSTS = {sp.sin: 18, sp.cos: 18, sp.atan2: 40, sp.atan: 40, sp.exp: 25}
#: The effects that need what nobody needs.
NOBODY: frozenset[str] = frozenset()


@dataclass(frozen=True)
class Piece:
    """An assignment, or where `adds`, an addition to what earlier ones assigned."""

    target: sp.Symbol
    expression: sp.Expr
    adds: bool = False


def united(sets: Iterable[Effects]) -> Effects:
    """Return the effects of which any needs what any of the sets needs."""
    found: Effects = NOBODY
    for effects in sets:
        found = None if found is None or effects is None else found | effects
    return found


def cost(expression: sp.Expr) -> int:
    """Return the number of operations, divisions and functions counted by what they cost."""
    own = max(0, len(expression.args) - 1)
    if isinstance(expression, sp.Pow):
        exponent = expression.exp
        if not exponent.is_Rational:
            own = 40
        else:
            own = min(12, abs(int(exponent.p))) - 1 + (8 if exponent < 0 else 0) + 15 * (int(exponent.q) // 2)
        return own + cost(expression.base)
    return _COSTS.get(expression.func, own) + sum(cost(a) for a in expression.args)


class Splitter:
    """Breaks assignments into pieces, each with the effects to which it belongs."""

    def __init__(self, switches: Mapping[sp.Symbol, str], parameters: Iterable[sp.Symbol]) -> None:
        self.zero: dict[sp.Expr, Effects] = {p: frozenset({e}) for p, e in switches.items()}
        self.known: dict[sp.Expr, bool] = dict.fromkeys(parameters, True)
        self.named: dict[sp.Expr, sp.Expr] = {}
        self.uses: dict[sp.Expr, int] = {}
        self.once: list[tuple[sp.Symbol, sp.Expr]] = []
        self.pieces: list[tuple[Piece, Effects]] = []

    def count(self, expression: sp.Expr) -> None:
        """Count in how many places each part of an expression stands."""
        self.uses[expression] = self.uses.get(expression, 0) + 1
        if self.uses[expression] == 1:
            for part in expression.args:
                self.count(part)

    def owner(self, expression: sp.Expr) -> Effects:
        """Return effects without which the expression is exactly zero; None where there are none."""
        if expression not in self.zero:
            found: Effects = None
            if isinstance(expression, sp.Add):
                found = united(self.owner(a) for a in expression.args)
            elif isinstance(expression, sp.Mul):
                owners = [o for o in map(self.owner, expression.args) if o is not None]
                found = min(owners, key=lambda o: (len(o), sorted(o)), default=None)
            elif isinstance(expression, sp.Pow):
                found = self.owner(expression.base) if expression.exp.is_positive else None
            elif isinstance(expression, sp.Abs | sp.sin | sp.atan):
                found = self.owner(expression.args[0])
            self.zero[expression] = found
        return self.zero[expression]

    def constant(self, expression: sp.Expr) -> bool:
        """Return whether nothing but parameters enters."""
        if expression not in self.known:
            self.known[expression] = not expression.is_Symbol and all(map(self.constant, expression.args))
        return self.known[expression]

    def assign(self, target: sp.Symbol, expression: sp.Expr, *, varies: bool = False) -> None:
        """Append the pieces of an assignment, also of a constant one if it `varies` by decree."""
        expression = self.inner(sp.sympify(expression), top=True)
        if self.constant(expression) and not expression.is_Number and not varies:
            self.known[target], self.zero[target] = True, self.owner(expression)
            self.once.append((target, expression))
            return
        self.zero[target] = self.owner(expression)
        groups: dict[Effects, list[sp.Expr]] = {}
        for term in sp.Add.make_args(expression):
            groups.setdefault(self.owner(term), []).append(term)
        # A sum of which every part may be absent begins with nothing.
        self.pieces.append((Piece(target, sp.Add(*groups.pop(None, []))), None))
        for effects, terms in groups.items():
            self.pieces.append((Piece(target, sp.Add(*terms), adds=True), effects))

    def inner(self, expression: sp.Expr, top: bool = False) -> sp.Expr:
        """Return the expression with names for its functions, for mixed sums within, and for constants."""
        if not expression.args:
            return expression
        if not top and expression in self.named:
            return self.named[expression]
        args = [self.inner(a) for a in expression.args]
        changed = any(a is not b for a, b in zip(args, expression.args, strict=True))
        result = expression.func(*args) if changed else expression
        if isinstance(result, sp.Mul) and not self.constant(result):
            fixed = sp.Mul(*[a for a in result.args if self.constant(a)])
            if cost(fixed) >= _WORTH:
                result = self.name(fixed) * sp.Mul(*[a for a in result.args if not self.constant(a)])
        if not top:
            least = 2 if self.constant(result) else _WORTH
            if self.worth_a_name(result) or (self.uses.get(expression, 0) > 1 and cost(result) >= least):
                result = self.name(result)
            self.named[expression] = result
        return result

    def name(self, expression: sp.Expr) -> sp.Symbol:
        """Return a symbol for the expression, the same for the same."""
        if expression not in self.named or not self.named[expression].is_Symbol:
            symbol = sp.Symbol(f"part_{len(self.named)}", real=True)
            self.named[expression] = symbol
            self.assign(symbol, expression)
        return self.named[expression]

    def worth_a_name(self, expression: sp.Expr) -> bool:
        """Return whether a part of an expression is a function, a constant or a mixed sum that costs something."""
        if self.constant(expression):
            return cost(expression) >= _WORTH
        if isinstance(expression, sp.sin | sp.cos | sp.atan | sp.atan2 | sp.exp):
            return True
        if isinstance(expression, sp.Pow):
            return not expression.exp.is_Integer
        if isinstance(expression, sp.Add):
            owned = [a for a in expression.args if self.owner(a) is not None]
            return 0 < len(owned) < len(expression.args) and any(
                cost(a) >= _WORTH or any(not self.constant(x) for x in a.free_symbols) for a in owned
            )
        return False
