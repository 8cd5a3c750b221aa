"""Straight-line mathematics in loops over the lanes, so that absent effects cost nothing.

A term that vanishes as an effect's amplitudes are zero belongs to that effect. So does what only such terms need: a
channel, the state of a memory, a ripple of the drive. What belongs to the same effects is an island, a loop that runs
where any of them is present; an island adds to sums that the core began, so what an absent one would have added is
never read. The core is cut as rarely as the islands between its parts allow.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import sympy as sp

Assignments = Sequence[tuple[sp.Symbol, sp.Expr]]
#: Ids of effects of which any must be present; None for what always runs.
Effects = frozenset[str] | None
#: Operations from which an owned part of a sum, or a number that only parameters enter, is worth a name.
_WORTH = 5
_COSTS = {sp.sin: 18, sp.cos: 18, sp.atan2: 40, sp.atan: 40, sp.exp: 25}
#: The effects that need what nobody needs.
NOBODY: frozenset[str] = frozenset()


@dataclass(frozen=True)
class Loop:
    """Pieces that run one after another in every lane, where any of the effects is present."""

    effects: Effects
    pieces: tuple[Piece, ...]


@dataclass(frozen=True)
class Plan:
    """What is evaluated once for given parameters, the loops in their order, and which effects need each symbol."""

    once: tuple[tuple[sp.Symbol, sp.Expr], ...]
    loops: tuple[Loop, ...]
    needs: Mapping[sp.Symbol, Effects]

    def shares(self) -> dict[str, int]:
        """Return the operations of the loops that run for each effect."""
        found: dict[str, int] = {}
        for loop in self.loops:
            for effect in loop.effects or ():
                own = sum(1 + cost(piece.expression) for piece in loop.pieces)
                found[effect] = found.get(effect, 0) + own
        return found


def _guards(
    pieces: Sequence[tuple[Piece, Effects]], needs: dict[sp.Symbol, Effects]
) -> tuple[list[Effects], dict[sp.Symbol, Effects]]:
    """Return which effects each piece runs for, and each symbol, from what the outputs are needed for."""
    needs, guards = dict(needs), []
    for piece, owner in reversed(pieces):
        guard = needed = needs.get(piece.target, NOBODY)
        if owner is not None and needed != NOBODY and not (needed is not None and needed <= owner):
            # What it adds to is then needed where it is present.
            guard, needs[piece.target] = owner, united((needed, owner))
        guards.append(guard)
        for symbol in piece.expression.free_symbols:
            needs[symbol] = united((needs.get(symbol, NOBODY), guard))
    return guards[::-1], needs


def _phases(pieces: Sequence[Piece], guards: Sequence[Effects]) -> tuple[list[int], list[set[int]]]:
    """Return after how many cuts of the core each piece runs, as few as can be, and which pieces it waits for."""
    made: dict[sp.Symbol, list[int]] = {}
    waits: list[set[int]] = []
    early: list[int] = []
    for k, piece in enumerate(pieces):
        before = {j for symbol in piece.expression.free_symbols for j in made.get(symbol, ())}
        if piece.adds:
            before.add(made[piece.target][0])
        waits.append(before)
        made.setdefault(piece.target, []).append(k)
        early.append(max((early[j] + (guards[k] is None and guards[j] is not None) for j in before), default=0))
    late = [max(early, default=0)] * len(pieces)
    for k in reversed(range(len(pieces))):
        for j in waits[k]:
            late[j] = min(late[j], late[k] - (guards[k] is None and guards[j] is not None))
    for k in range(len(pieces)):
        if guards[k] is not None:
            late[k] = max((late[j] for j in waits[k]), default=0)
    return late, waits


def _ordered(pieces: Sequence[Piece], guards: Sequence[Effects]) -> list[Loop]:
    """Return the loops: in each phase the core, then its islands, as few as their order allows."""
    phases, waits = _phases(pieces, guards)
    loops: list[Loop] = []
    done: set[int] = set()
    for phase in range(max(phases, default=0) + 1):
        left = [k for k in range(len(pieces)) if phases[k] == phase]
        while left:
            runs: dict[Effects, list[int]] = {}
            for guard in dict.fromkeys(guards[k] for k in left):
                run: list[int] = []
                for k in left:
                    if guards[k] == guard and waits[k] <= done.union(run):
                        run.append(k)
                runs[guard] = run
            total = {guard: sum(guards[k] == guard for k in left) for guard in runs}
            # The core first, then what is finished by this loop, then what most others may wait for.
            best = max(
                (g for g in runs if runs[g]),
                key=lambda g: (g is None, len(runs[g]) == total[g], len(g or ()), len(runs[g])),
            )
            loops.append(Loop(best, tuple(pieces[k] for k in runs[best])))
            done |= set(runs[best])
            left = [k for k in left if k not in done]
    return loops


def plan(
    assignments: Assignments,
    outputs: Assignments,
    *,
    switches: Mapping[sp.Symbol, str],
    parameters: Sequence[sp.Symbol],
    rates: Mapping[sp.Symbol, sp.Symbol] | None = None,
    needs: Mapping[sp.Symbol, Effects] | None = None,
) -> Plan:
    """Return loops that compute the outputs.

    Parameters
    ----------
    assignments : sequence of (sympy.Symbol, sympy.Expr)
        Straight-line mathematics.
    outputs : sequence of (sympy.Symbol, sympy.Expr)
        What is wanted of it.
    switches : mapping of sympy.Symbol to str
        Amplitudes and the effect to which each belongs; it is absent where all of its amplitudes are zero.
    parameters : sequence of sympy.Symbol
        What does not change while the loops run again and again.
    rates : mapping of sympy.Symbol to sympy.Symbol, optional
        Outputs that are wanted only where another symbol, the memory of an effect, is.
    needs : mapping of sympy.Symbol to frozenset of str or None, optional
        Which effects need a symbol elsewhere.
    """
    splitter = Splitter(switches, parameters)
    for _, expression in (*assignments, *outputs):
        splitter.count(expression)
    for target, expression in assignments:
        splitter.assign(target, expression)
    for target, expression in outputs:
        splitter.assign(target, expression, varies=True)
    rates, elsewhere = rates or {}, needs or {}
    always: dict[sp.Symbol, Effects] = {out: None for out, _ in outputs if out not in rates}
    memory = {state: elsewhere.get(state, NOBODY) for state in rates.values()}
    while True:
        wanted = {**always, **{out: memory[state] for out, state in rates.items()}}
        guards, found = _guards(splitter.pieces, wanted)
        again = {state: united((needed, found.get(state, NOBODY))) for state, needed in memory.items()}
        if again == memory:
            break
        memory = again
    kept = [(piece, guard) for (piece, _), guard in zip(splitter.pieces, guards, strict=True) if guard != NOBODY]
    loops = _ordered([piece for piece, _ in kept], [guard for _, guard in kept])
    return Plan(tuple(splitter.once), tuple(loops), {**found, **memory})


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
    """Breaks assignments into pieces, each with the effects to which it belongs.

    Sums are broken where their terms belong to different effects, also sums within other expressions. Functions get
    names, and so does what stands in several places.
    """

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
