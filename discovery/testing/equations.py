"""Numbers from the equations of a base with effects: by numpy, and as they are once an effect is absent."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
import sympy as sp

from discovery.declarations import symbols as s
from discovery.declarations.effect import Effect, Load, Memory
from discovery.equations.contributions import strands
from discovery.equations.program import RECORDED, Program
from discovery.foundation.arrays import FloatArray
from discovery.mechanics import get_base
from discovery.mechanics.rod_end import LoadedEnd, loaded_end
from discovery.simulation.kernel.compile import numpy_derivative
from discovery.testing.states import Sample, whole

#: Digits of sympy: a mass matrix of four shapes takes seven of sixteen, in numpy and in what numpy is compared with.
_DIGITS = 30

#: Slopes (n, k) at a time, for recorded input (3, k), state (n, k) and parameters (p, k).
Evaluate = Callable[[float, FloatArray, FloatArray, FloatArray], FloatArray]


@lru_cache(maxsize=64)
def evaluator(program: Program) -> Evaluate:
    """Return a numpy function of the slopes of a program."""
    function = numpy_derivative(program)

    def evaluate(time: float, recorded: FloatArray, state: FloatArray, parameters: FloatArray) -> FloatArray:
        rows = function(time, recorded, state, parameters)
        return np.array([np.broadcast_to(row, state.shape[1:]) for row in rows], float)

    return evaluate


def slopes_of(base_name: str, sample: Sample) -> FloatArray:
    """Return the slopes (n, k) of a base with every effect."""
    return evaluator(whole(base_name))(sample.time, sample.recorded, sample.state, sample.parameters)


def shaken(base_name: str, sample: Sample) -> FloatArray:
    """Return how far slopes (n, k) move at most as one state changes by its round-off.

    A joint that gives way may leave the inertia nearer to singular than the bare one.
    """
    still, moved = slopes_of(base_name, sample), []
    for row in range(len(sample.state)):
        state = sample.state.copy()
        state[row] *= 1 + 2 * np.finfo(float).eps
        moved.append(np.abs(slopes_of(base_name, replace(sample, state=state)) - still))
    return np.max(moved, axis=0)


@lru_cache(maxsize=8192)
def _used(expression: sp.Expr) -> tuple[sp.Symbol, ...]:
    return tuple(sorted(expression.free_symbols, key=str))


@lru_cache(maxsize=8192)
def _value(expression: sp.Expr, given: tuple[tuple[sp.Symbol, sp.Float], ...]) -> sp.Float:
    return sp.Float(expression.xreplace(dict(given)).evalf(_DIGITS), _DIGITS)


def slopes_by_sympy(program: Program, sample: Sample, k: int) -> list[float]:
    """Return the slopes of one state of a sample; what is the same for another effect is not evaluated again."""
    symbols = [s.t, *RECORDED, *program.states, *(sp.Symbol(p, real=True) for p in program.parameters)]
    numbers = [sample.time, *sample.recorded[:, k], *sample.state[:, k], *sample.parameters[:, k]]
    known = {symbol: sp.Float(float(number), _DIGITS) for symbol, number in zip(symbols, numbers, strict=True)}

    def value(expression: sp.Expr) -> sp.Float:
        return _value(expression, tuple((symbol, known[symbol]) for symbol in _used(expression)))

    for symbol, expression in (*program.drive, *program.derivative):
        known[symbol] = value(expression)
    return [float(value(slope)) for slope in program.slopes]


def accelerations(base_name: str, sample: Sample) -> FloatArray:
    """Return the accelerations (n, k) of the coordinates of a base with every effect."""
    n = get_base(base_name).n_coordinates
    return slopes_of(base_name, sample)[n : 2 * n]


@dataclass(frozen=True)
class Bare:
    """A base in given states: values of symbols by name, mass matrix (n, n, k), force (n, k), path (r, k)."""

    symbols: Mapping[str, Any]
    mass: FloatArray
    force: FloatArray
    path: FloatArray

    def of(self, expression: sp.Expr) -> FloatArray:
        """Return the value (k,) of an expression in symbols of effects."""
        value = _function(expression)(*(self.symbols[name.name] for name in _used(expression)))
        return np.broadcast_to(value, self.mass.shape[2:])


@lru_cache(maxsize=256)
def _function(expression: sp.Expr) -> Callable[..., FloatArray]:
    return sp.lambdify(_used(expression), expression, ["numpy", "scipy"])


@lru_cache
def _mechanics(base_name: str, program: Program) -> tuple[tuple[str, ...], Evaluate]:
    """Return the names of drive and channels, and a function of their values, mass matrix, force and path."""
    base = get_base(base_name)
    mechanics = base.mechanics(program.rod)
    channels = tuple((symbol, channel.value) for symbol, channel in mechanics.channels.items())
    received = tuple(symbol for symbol, _ in program.drive)
    named = (*received, *(symbol for symbol, _ in channels))
    mass = (entry for row in mechanics.mass for entry in row)
    path = base.reading(None, program.rod) if base.system.has_rod else (mechanics.channels[s.theta].value,)
    rows = (*named, *mass, *mechanics.force, *path)
    shown = replace(program, derivative=(*mechanics.assignments, *channels), slopes=rows)
    return tuple(symbol.name for symbol in named), evaluator(shown)


def bare_base(base_name: str, sample: Sample) -> Bare:
    """Evaluate the mechanics of a base, without any effect."""
    program, n = whole(base_name), get_base(base_name).n_coordinates
    names, evaluate = _mechanics(base_name, program)
    rows = evaluate(sample.time, sample.recorded, sample.state, sample.parameters)
    known: dict[str, Any] = {"t": sample.time}
    for labels, values in (
        (program.parameters, sample.parameters),
        ([z.name for z in program.states], sample.state),
        (names, rows),
    ):
        known.update(zip(labels, values, strict=False))
    mass, rest = rows[len(names) :][: n * n], rows[len(names) + n * n :]
    return Bare(known, mass.reshape(n, n, -1), rest[:n], rest[n:])


def memory_states(effect: Memory, base_name: str) -> dict[sp.Symbol, sp.Expr]:
    """Return the states of a memory effect on a base with their slopes, one set for each of its strands."""
    slopes = {}
    for k, (_, here) in enumerate(_components(effect, base_name)):
        told = here | ({s.push: push} if (push := get_base(base_name).push()) is not None else {})
        slopes.update({sp.Symbol(f"{z.name}_{k}", real=True): slope.subs(told) for z, slope in effect.states().items()})
    return slopes


def energy(effect: Effect, base_name: str) -> sp.Expr:
    """Return the energy or power of an effect on a base, in channels and states."""
    if isinstance(effect, Load):
        return effect.power()
    expression = effect.expression()  # type: ignore[attr-defined]
    if not isinstance(effect, Memory):
        return expression
    return sp.Add(*[weight * sp.sympify(expression).subs(here) for weight, here in _components(effect, base_name)])


@lru_cache(maxsize=64)
def loaded_end_of(effect: Effect, base_name: str) -> LoadedEnd | None:
    """Return what an inertia at the rod's end asks of a base, if the effect is one."""
    return loaded_end(get_base(base_name).mechanics(), (effect,))


def _components(effect: Memory, base_name: str) -> list[tuple[float, dict[sp.Symbol, sp.Expr]]]:
    found = strands(effect, get_base(base_name).mechanics(whole(base_name).rod))
    return [
        (weight, {s.bend: b, s.bend_dot: rate, **{z: sp.Symbol(f"{z.name}_{k}", real=True) for z in effect.states()}})
        for k, (weight, (b, rate, _)) in enumerate(found)
    ]


def at_rest(program: Program, values: Mapping[sp.Symbol, Any]) -> tuple[Any, ...]:
    """Return the mathematics of a program with parameters replaced, numbers put in, without what nothing uses."""
    known = dict(values)
    kept = []
    for symbol, expression in (*program.drive, *program.derivative):
        value = expression.xreplace(known)
        if value.is_Number:
            known[symbol] = value
        else:
            kept.append((symbol, value))
    n = 2 * program.n_coordinates
    results = tuple(e.xreplace(known) for e in (*program.slopes[:n], *program.reading, program.lateness))
    used = set().union(*[e.free_symbols for e in results])
    lines = []
    for symbol, value in reversed(kept):
        if symbol in used:
            used |= value.free_symbols
            lines.append((symbol, value))
    return (*results, *lines)
