"""Straight-line mathematics in loops over the lanes, so that absent effects cost nothing.

A term that vanishes as an effect's amplitudes are zero belongs to that effect. So does what only such terms need: a
channel, the state of a memory, a ripple of the drive. What belongs to the same effects is an island, a loop that runs
where any of them is present; an island adds to sums that the core began, so what an absent one would have added is
never read. The core is cut as rarely as the islands between its parts allow.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import sympy as sp

from discovery.simulation.kernel.owned_terms import NOBODY, Effects, Piece, Splitter, cost, united

Assignments = Sequence[tuple[sp.Symbol, sp.Expr]]


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
