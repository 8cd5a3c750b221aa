"""From a base and a sum of effects to straight-line mathematics: slopes of the state, reading of the instrument."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import sympy as sp
from numpy.typing import NDArray

from discovery.declarations import symbols as s
from discovery.declarations.effect import (
    Drive,
    Effect,
    Joint,
    Kinetic,
    Memory,
    Mode,
    Sensor,
)
from discovery.declarations.registry import get_effect
from discovery.equations.contributions import (
    RECORDED,
    Assignments,
    Laws,
    channel_forces,
    kinetic_of,
    memory_of,
    radius_of,
    received_input,
    slope_in_drive,
)
from discovery.foundation.errors import InputError
from discovery.mechanics import Base, get_base
from discovery.mechanics.base import Mechanics
from discovery.mechanics.joint import hinged, root_of
from discovery.mechanics.rod import STRAIGHT, Rod, rod_of
from discovery.mechanics.rod_end import LoadedEnd, loaded_end

__all__ = ["RECORDED", "Program", "build_program"]


@dataclass(frozen=True)
class Program:
    """Straight-line mathematics of one base with a set of effects."""

    parameters: tuple[str, ...]  # order of the parameters
    states: tuple[sp.Symbol, ...]  # coordinates, rates, then the states of memory effects
    n_coordinates: int  # number of coordinates
    drive: tuple[tuple[sp.Symbol, sp.Expr], ...]  # what the system receives, from the recorded input and time
    derivative: tuple[tuple[sp.Symbol, sp.Expr], ...]  # assignments that end in `slopes`
    slopes: tuple[sp.Expr, ...]  # time derivative of each state
    reading: tuple[sp.Expr, ...]  # what the instrument reports: tip x, y [m], or the output
    lateness: sp.Expr  # age of the reported state [s]
    rod: Rod = STRAIGHT  # the rod as the effects change it
    #: How fast states of memory forget at most [s^-1], of those that steps need not resolve.
    relaxation: tuple[tuple[sp.Symbol, sp.Expr], ...] = ()
    begins: tuple[str, ...] = ()  # see `discovery.mechanics.base.Base.begins`
    begun: tuple[tuple[sp.Symbol, str], ...] = ()  # states of memory, and the parameters at which they begin

    @cached_property
    def _form(self) -> Callable[..., tuple]:
        form = self.rod.deflection, self.rod.root
        own = [p for p in self.parameters if sp.Symbol(p, real=True) in sp.Tuple(*form).free_symbols]
        law, at = sp.lambdify([sp.Symbol(p, real=True) for p in own], form), [self.parameters.index(p) for p in own]
        return lambda parameters: law(*(parameters[i] for i in at))

    @cached_property
    def moving(self) -> frozenset[str]:
        """Parameters that change the motion; the others change what is read of it."""
        laws = [e for _, e in (*self.drive, *self.derivative)]
        used = sp.Tuple(*laws, *self.slopes, self.rod.deflection, self.rod.root).free_symbols
        begun = {*self.begins, *(name for _, name in self.begun)}
        return frozenset(p for p in self.parameters if p in begun or sp.Symbol(p, real=True) in used)

    @cached_property
    def ageing(self) -> frozenset[str]:
        """Parameters that change nothing but the age of what is read."""
        used = self.lateness.free_symbols - sp.Tuple(*self.reading).free_symbols
        return frozenset(p for p in self.parameters if sp.Symbol(p, real=True) in used) - self.moving

    def form(self, parameters: Sequence | NDArray) -> tuple:
        """Return what the start of the coordinates depends on beside what is read.

        That is the deflection of the unloaded rod [q] and the turn of its root per curvature [-], or of a declared
        system the values of `begins`. `parameters` each (k,): values in the order of `parameters`.
        """
        if self.begins:
            return tuple(parameters[self.parameters.index(p)] for p in self.begins)
        return (0, 0) if self.rod == STRAIGHT else self._form(parameters)


def _solve(mass: list[list[sp.Expr]], force: list[sp.Expr], out: Assignments) -> list[sp.Expr]:
    """Append the solution by cofactors and return the accelerations.

    One division serves all of them: a processor divides as slowly as it takes thirty products.
    """
    n = len(force)
    if n == 1:
        return [force[0] if mass[0][0] == 1 else force[0] / mass[0][0]]

    def name(label: str, expression: sp.Expr) -> sp.Symbol:
        symbol = sp.Symbol(label, real=True)
        out.append((symbol, expression))
        return symbol

    matrix = sp.Matrix(n, n, lambda i, j: mass[max(i, j)][min(i, j)])
    cofactor = {(i, j): name(f"cofactor_{i}{j}", matrix.cofactor(i, j)) for i in range(n) for j in range(i + 1)}
    inverse = name("per_determinant", 1 / sum(mass[i][0] * cofactor[i, 0] for i in range(n)))
    return [
        name(f"qdd_{i}", inverse * sum(cofactor[max(i, j), min(i, j)] * force[j] for j in range(n))) for i in range(n)
    ]


def _as_read(base: Base, mode: sp.Symbol, slopes: Mapping[sp.Symbol, sp.Expr]) -> sp.Expr:
    """Return what the displacement of a mode adds to the reading of a base."""
    return mode if base.reads_state else slopes[slopes[mode]]


def _told(reading: sp.Expr, accelerations: Sequence[sp.Expr], program: Assignments) -> sp.Expr:
    """Return a reading of the accelerations in terms of the state."""
    meant = {sp.Symbol(f"acceleration_{k}", real=True): a for k, a in enumerate(accelerations, start=1)}
    meant[s.acceleration] = accelerations[0]
    if not meant.keys() & reading.free_symbols:
        return reading
    told = reading.xreplace(meant)
    for symbol, expression in reversed(program):
        told = told.xreplace({symbol: expression})
    return told


@lru_cache(maxsize=256)
def build_program(base_name: str, effect_ids: tuple[str, ...]) -> Program:
    """Return the mathematics of a base with a set of effects.

    Raises InputError if an effect needs the linear stiffness and nothing declares it.
    """
    base = get_base(base_name)
    effects = [get_effect(e) for e in effect_ids]
    rod, n = rod_of(effects), base.n_coordinates
    root = root_of(base.mechanics(rod), [e for e in effects if isinstance(e, Joint)])
    mechanics = hinged(base.mechanics(rod), root)
    channels, end = dict(mechanics.channels), loaded_end(mechanics, effects)
    forces = _forces(effects, end)
    mass, force = _inertia(effects, mechanics, end)
    memory, forgets, force = _memory(effects, mechanics, {} if root is None else dict(root.states), force)
    named = sp.Tuple(*forces.values(), *memory.values(), *forgets.values(), *force, *mass[0]).free_symbols
    program: Assignments = list(mechanics.assignments)
    program += [(c, sp.sympify(channels[c].value)) for c in channels if c in named]
    for channel, expression in forces.items():
        program.append((pushed := sp.Symbol(f"F_{channel.name}", real=True), expression))
        force = [a + b * pushed for a, b in zip(force, channels[channel].jacobian, strict=True)]
    mass, force = (mass, force) if n == 1 else _named_once(mass, force, program)
    accelerations = _solve(mass, force, program)
    if end is not None:
        turning = channels[s.slope_dot]
        bent = sp.Add(*[j * a for j, a in zip(turning.jacobian, accelerations, strict=True)]) + turning.bias
        memory.update(end.states(bent))
    bare = [_told(r, accelerations, program) for r in base.reading(radius_of(effects, channels), rod)]
    reading, memory = _reading(base, effects, bare, memory)
    still = [sp.Integer(0)] * 2 * n
    result = Program(
        parameters=(*[p.name for p in base.parameters()], *[p.name for e in effects for p in e.parameters()]),
        states=(*mechanics.coordinates, *mechanics.rates, *memory),
        n_coordinates=n,
        drive=tuple(received_input([e for e in effects if isinstance(e, Drive)], base.input_moves, root)),
        derivative=tuple(program),
        slopes=(*(still if base.prescribed else (*mechanics.rates, *accelerations)), *memory.values()),
        reading=reading,
        lateness=sp.Add(*[e.lateness() for e in effects if isinstance(e, Sensor)]),
        rod=rod,
        relaxation=tuple(forgets.items()),
        begins=base.begins,
        begun=tuple((sp.Symbol(p.begins, real=True), p.name) for e in effects for p in e.parameters() if p.begins),
    )
    return _complete(result, base_name)


def _forces(effects: Sequence[Effect], end: LoadedEnd | None) -> dict[sp.Symbol, sp.Expr]:
    """Return the force of all effects together on each channel."""
    forces: dict[sp.Symbol, sp.Expr] = {}
    for effect in effects:
        for channel, force in channel_forces(effect).items():
            forces[channel] = forces.get(channel, sp.Integer(0)) + force
    if not any(p.name == s.xi.name for effect in effects for p in effect.parameters()):
        # Where no linear loss is declared there is none.
        forces = {channel: force.xreplace({s.xi: sp.Integer(0)}) for channel, force in forces.items()}
    if end is not None:
        forces[s.slope] = forces.get(s.slope, sp.Integer(0)) + end.moment
    return forces


def _inertia(
    effects: Sequence[Effect], mechanics: Mechanics, end: LoadedEnd | None
) -> tuple[list[list[sp.Expr]], list[sp.Expr]]:
    """Return mass matrix and force of the base and of the kinetic effects."""
    mass, force = [list(row) for row in mechanics.mass], list(mechanics.force)
    n, channels = len(force), dict(mechanics.channels)
    for effect in effects:
        if isinstance(effect, Kinetic):
            energy = effect.expression()
            more, push = kinetic_of(energy if end is None else end.kinetic(energy), channels, n)
            mass = [[mass[i][j] + more[i][j] for j in range(n)] for i in range(n)]
            force = [force[i] + push[i] for i in range(n)]
    return mass, force


def _memory(
    effects: Sequence[Effect], mechanics: Mechanics, states: Laws, force: list[sp.Expr]
) -> tuple[Laws, Laws, list[sp.Expr]]:
    """Return states and force with those of the memory effects and of the drive, and how fast states forget."""
    drives = [e for e in effects if isinstance(e, Drive)]
    states = {**states, **{z: slope_in_drive(z) for e in drives for z in e.states()}}
    forgets: Laws = {z: rate for e in drives for z, rate in e.relaxation().items()}
    for effect in effects:
        if isinstance(effect, Memory):
            own, fast, pull = memory_of(effect, mechanics, len(force))
            states, forgets = {**states, **own}, {**forgets, **fast}
            force = [a + b for a, b in zip(force, pull, strict=True)]
    return states, forgets, force


def _named_once(
    mass: list[list[sp.Expr]], force: list[sp.Expr], program: Assignments
) -> tuple[list[list[sp.Expr]], list[sp.Expr]]:
    """Append the sums by name, and return the names, so that the factorisation does not repeat the sums."""
    n = len(force)
    total: list[sp.Expr] = [sp.Symbol(f"Q_{i}", real=True) for i in range(n)]
    program += list(zip(total, force, strict=True))
    inertia = [[sp.Symbol(f"N_{max(i, j)}{min(i, j)}", real=True) for j in range(n)] for i in range(n)]
    program += [(inertia[i][j], mass[i][j]) for i in range(n) for j in range(i + 1)]
    return inertia, total


def _reading(
    base: Base, effects: Sequence[Effect], bare: Sequence[sp.Expr], memory: dict[sp.Symbol, sp.Expr]
) -> tuple[tuple[sp.Expr, ...], dict[sp.Symbol, sp.Expr]]:
    """Return what the instrument reports, through modes and sensors, and the memory that the input of a base drives."""
    vibrations = [e for e in effects if isinstance(e, Mode)]
    if vibrations and base.push() is None:
        raise InputError(
            f"A mode of vibration needs a force or a moving base as its input, which {base.name!r} has not."
        )
    modes = [z for e in vibrations for z in memory if z.name == f"{e.displacement().name}_0"]
    reading = tuple(bare)
    if modes:
        memory = {z: slope.xreplace({s.push: base.push()}) for z, slope in memory.items()}
        reading = (reading[0] + sp.Add(*[_as_read(base, z, memory) for z in modes]), *reading[1:])
    if base.system.has_rod:
        reading = tuple(s.length * r for r in reading)
    for sensor in effects:
        if isinstance(sensor, Sensor):
            # What is read beside an output has an instrument of its own.
            own = len(base.system.channels)
            reading = (*sensor.read(*reading[:own]), *reading[own:])
    return reading, memory


def _complete(program: Program, base_name: str) -> Program:
    """Return a program all of whose symbols are declared; InputError for another one."""
    used = set().union(
        *[e.free_symbols for _, e in (*program.drive, *program.derivative)],
        *[e.free_symbols for e in (*program.slopes, *program.reading, program.lateness)],
    )
    defined = {a for a, _ in (*program.drive, *program.derivative)} | set(program.states) | {s.t, *RECORDED}
    missing = sorted(x.name for x in used - defined if x.name not in program.parameters)
    if missing:
        hint = " Add linear_stiffness to the model." if "alpha" in missing else ""
        raise InputError(f"The model on base {base_name!r} uses {', '.join(missing)}, which nothing declares.{hint}")
    return program
