"""From a base and a sum of effects to straight-line mathematics: slopes of the state, reading of the instrument."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import sympy as sp
from numpy.typing import NDArray

from discovery.declarations import symbols as s
from discovery.declarations.effect import (
    ARM,
    Closure,
    Dissipation,
    Drive,
    Effect,
    Joint,
    Kinetic,
    Load,
    Memory,
    Mode,
    Potential,
    Sensor,
)
from discovery.declarations.place import channels_of
from discovery.declarations.registry import get_effect
from discovery.foundation.errors import InputError
from discovery.mechanics import Base, get_base
from discovery.mechanics.base import Channel, Mechanics, Strand
from discovery.mechanics.joint import Root, hinged, root_of
from discovery.mechanics.rod import STRAIGHT, Rod, rod_of
from discovery.mechanics.rod_end import loaded_end

__all__ = ["RECORDED", "Program", "build_program", "radius_of", "strands"]

#: Recorded input with its first two derivatives; an oscillator uses the value only.
RECORDED = sp.symbols("r_0 r_1 r_2", real=True)

Assignments = list[tuple[sp.Symbol, sp.Expr]]


@dataclass(frozen=True)
class Program:
    """Straight-line mathematics of one base with a set of effects.

    Parameters
    ----------
    parameters : tuple of str
        Order of the parameters.
    states : tuple of sympy.Symbol
        Coordinates, rates, then the states of memory effects.
    n_coordinates : int
        Number of coordinates.
    drive : tuple of (sympy.Symbol, sympy.Expr)
        What the system receives, from the recorded input and time.
    derivative : tuple of (sympy.Symbol, sympy.Expr)
        Assignments that end in `slopes`.
    slopes : tuple of sympy.Expr
        Time derivative of each state.
    reading : tuple of sympy.Expr
        What the instrument reports: tip x, y [m], or the output.
    lateness : sympy.Expr
        Age of the reported state [s].
    rod : Rod
        The rod as the effects change it.
    """

    parameters: tuple[str, ...]
    states: tuple[sp.Symbol, ...]
    n_coordinates: int
    drive: tuple[tuple[sp.Symbol, sp.Expr], ...]
    derivative: tuple[tuple[sp.Symbol, sp.Expr], ...]
    slopes: tuple[sp.Expr, ...]
    reading: tuple[sp.Expr, ...]
    lateness: sp.Expr
    rod: Rod = STRAIGHT

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
        return frozenset(p for p in self.parameters if sp.Symbol(p, real=True) in used)

    @cached_property
    def ageing(self) -> frozenset[str]:
        """Parameters that change nothing but the age of what is read."""
        used = self.lateness.free_symbols - sp.Tuple(*self.reading).free_symbols
        return frozenset(p for p in self.parameters if sp.Symbol(p, real=True) in used) - self.moving

    def form(self, parameters: Sequence | NDArray) -> tuple:
        """Return the deflection of the unloaded rod [q] and the turn of its root per curvature [-].

        Parameters
        ----------
        parameters : sequence of float or of ndarray, shape (k,)
            Values in the order of `parameters`.
        """
        return (0, 0) if self.rod == STRAIGHT else self._form(parameters)


def _drive(effects: list[Drive], input_moves: bool, root: Root | None) -> Assignments:
    if not input_moves:
        value: sp.Expr = RECORDED[0]
        for effect in effects:
            value = effect.expression().subs(s.u, value)
        return [(s.u, value)]
    value = RECORDED[0]
    for effect in effects:
        value = effect.expression().subs(s.theta_m, value)

    def rate(expression: sp.Expr) -> sp.Expr:
        pairs = ((RECORDED[0], RECORDED[1]), (RECORDED[1], RECORDED[2]), (s.t, sp.Integer(1)))
        return sp.Add(*[sp.diff(expression, a) * b for a, b in pairs])

    first = rate(value)
    received = (value, first, rate(first))
    if root is not None:
        received = tuple(a + b for a, b in zip(received, (root.turn, root.rate, root.bias), strict=True))
    return list(zip((s.theta_m, s.omega_m, s.alpha_m), received, strict=True))


def radius_of(effects: Sequence[Effect], channels: Mapping[sp.Symbol, Channel] | None = None) -> sp.Expr | None:
    """Return rho/l as all closures together give it, each with its own change of the radius; None without closures.

    With the channels of a base, the rate of the tip is written in the base's own rates.
    """
    laws = [e.expression() for e in effects if isinstance(e, Closure)]
    if not laws:
        return None
    law = 1 + sp.Add(*[law - 1 for law in laws])
    return law if channels is None else law.xreplace({s.omega: channels[s.omega].value})


def _channel_forces(effect: Effect) -> dict[sp.Symbol, sp.Expr]:
    """Return the force of one effect on each channel: -dV/dc, -dD/dc', +dP/dc'."""
    if not isinstance(effect, Potential | Dissipation | Load):
        return {}
    if isinstance(effect, Load) and effect.on is not None:
        return {effect.on: effect.expression()}
    wanted = channels_of(effect)
    sign = 1 if isinstance(effect, Load) else -1
    expression = effect.expression()
    forces = {c: sign * sp.diff(expression, c) for c in wanted}
    return {c: f for c, f in forces.items() if f != 0}


def strands(effect: Memory, mechanics: Mechanics) -> list[tuple[float, Strand]]:
    """Return what a memory effect acts on, with weights: components of the bending, or places of the rod."""
    if effect.place:
        return [(1, mechanics.places[effect.place])]
    return list(mechanics.fibres) if effect.local else [(1, strand) for strand in mechanics.bending]


def _memory(effect: Memory, mechanics: Mechanics, n: int) -> tuple[dict[sp.Symbol, sp.Expr], list[sp.Expr]]:
    """Return the states of a memory effect, one set for each of its strands, and its force."""
    power, states = effect.expression(), effect.states()
    force: list[sp.Expr] = [sp.Integer(0)] * n
    found = {}
    for k, (weight, (value, rate, jacobian)) in enumerate(strands(effect, mechanics)):
        own = {z: sp.Symbol(f"{z.name}_{k}", real=True) for z in states}
        here = {**own, s.bend: value, s.bend_dot: rate}
        found.update({own[z]: sp.sympify(slope).subs(here) for z, slope in states.items()})
        pull = weight * sp.diff(power, s.bend_dot).subs(here)
        for i in range(n):
            force[i] += jacobian[i] * pull
    return found, force


def _kinetic(energy: sp.Expr, channels: dict[sp.Symbol, Channel], n: int) -> tuple[list[list[sp.Expr]], list[sp.Expr]]:
    """Return what a kinetic energy in channel rates adds to the mass matrix and to the force."""
    mass = [[sp.Integer(0)] * n for _ in range(n)]
    force = [sp.Integer(0)] * n
    for c, c_dot in s.RATES.items():
        momentum = sp.diff(energy, c_dot)
        pull = -sp.diff(energy, c)
        pull += sp.diff(momentum, s.omega_m) * s.alpha_m + sp.diff(momentum, s.theta_m) * s.omega_m
        row = channels[c_dot].jacobian
        for d, d_dot in s.RATES.items():
            pull += sp.diff(momentum, d) * d_dot
            coupling = sp.diff(momentum, d_dot)
            if coupling == 0:
                continue
            pull += coupling * channels[d_dot].bias
            for i in range(n):
                for j in range(n):
                    mass[i][j] += row[i] * coupling * channels[d_dot].jacobian[j]
        for i in range(n):
            force[i] -= row[i] * pull
    return mass, force


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

    Raises
    ------
    InputError
        If an effect needs the linear stiffness and nothing declares it.
    """
    base = get_base(base_name)
    effects = [get_effect(e) for e in effect_ids]
    rod = rod_of(effects)
    mechanics = base.mechanics(rod)
    root = root_of(mechanics, [e for e in effects if isinstance(e, Joint)])
    mechanics = hinged(mechanics, root)
    n = base.n_coordinates
    channels = dict(mechanics.channels)
    parameters = [p.name for p in base.parameters()] + [p.name for e in effects for p in e.parameters()]

    forces: dict[sp.Symbol, sp.Expr] = {}
    for effect in effects:
        for channel, force in _channel_forces(effect).items():
            forces[channel] = forces.get(channel, sp.Integer(0)) + force
    if s.xi.name not in parameters:
        # Where no linear loss is declared there is none.
        forces = {channel: force.xreplace({s.xi: sp.Integer(0)}) for channel, force in forces.items()}
    end = loaded_end(mechanics, effects)
    if end is not None:
        forces[s.slope] = forces.get(s.slope, sp.Integer(0)) + end.moment
    mass = [list(row) for row in mechanics.mass]
    force = list(mechanics.force)
    for effect in effects:
        if isinstance(effect, Kinetic):
            energy = effect.expression()
            extra_mass, extra_force = _kinetic(energy if end is None else end.kinetic(energy), channels, n)
            mass = [[mass[i][j] + extra_mass[i][j] for j in range(n)] for i in range(n)]
            force = [force[i] + extra_force[i] for i in range(n)]

    memory: dict[sp.Symbol, sp.Expr] = {} if root is None else dict(root.states)
    for effect in effects:
        if isinstance(effect, Memory):
            states, extra_force = _memory(effect, mechanics, n)
            memory.update(states)
            force = [force[i] + extra_force[i] for i in range(n)]
    named = set().union(*[e.free_symbols for e in [*forces.values(), *memory.values(), *force, *mass[0]]])
    program: Assignments = list(mechanics.assignments)
    program += [(c, sp.sympify(channels[c].value)) for c in channels if c in named]
    for channel, expression in forces.items():
        pushed = sp.Symbol(f"F_{channel.name}", real=True)
        program.append((pushed, expression))
        for i in range(n):
            force[i] += channels[channel].jacobian[i] * pushed
    if n > 1:
        # Named once, so that the factorisation does not repeat the sums.
        total = [sp.Symbol(f"Q_{i}", real=True) for i in range(n)]
        program += list(zip(total, force, strict=True))
        inertia = [[sp.Symbol(f"N_{max(i, j)}{min(i, j)}", real=True) for j in range(n)] for i in range(n)]
        program += [(inertia[i][j], mass[i][j]) for i in range(n) for j in range(i + 1)]
        mass, force = inertia, total
    accelerations = _solve(mass, force, program)
    if end is not None:
        turning = channels[s.slope_dot]
        bent = sp.Add(*[j * a for j, a in zip(turning.jacobian, accelerations, strict=True)]) + turning.bias
        memory.update(end.states(bent))

    if any(isinstance(e, Mode) for e in effects) and base.push() is None:
        raise InputError(
            f"A mode of vibration needs a force or a moving base as its input, which {base_name!r} has not."
        )
    modes = [z for e in effects if isinstance(e, Mode) for z in memory if z.name == f"{e.displacement().name}_0"]
    memory = {z: slope.xreplace({s.push: base.push()}) for z, slope in memory.items()} if modes else memory
    reading = tuple(_told(r, accelerations, program) for r in base.reading(radius_of(effects, channels), rod))
    if modes:
        reading = (reading[0] + sp.Add(*[_as_read(base, z, memory) for z in modes]),)
    sensors = [e for e in effects if isinstance(e, Sensor)]
    if base.system == ARM:
        reading = tuple(s.length * r for r in reading)
        for sensor in sensors:
            reading = sensor.arm_reading(*reading)
    else:
        for sensor in sensors:
            reading = (sensor.oscillator_reading(reading[0]),)
    still = (sp.Integer(0),) * (2 * n)
    result = Program(
        parameters=tuple(parameters),
        states=(*mechanics.coordinates, *mechanics.rates, *memory),
        n_coordinates=n,
        drive=tuple(_drive([e for e in effects if isinstance(e, Drive)], base.input_moves, root)),
        derivative=tuple(program),
        slopes=(*(still if base.prescribed else (*mechanics.rates, *accelerations)), *memory.values()),
        reading=tuple(reading),
        lateness=sp.Add(*[e.lateness() for e in sensors]),
        rod=rod,
    )
    _check_complete(result, base_name)
    return result


def _check_complete(program: Program, base_name: str) -> None:
    used = set().union(
        *[e.free_symbols for _, e in (*program.drive, *program.derivative)],
        *[e.free_symbols for e in (*program.slopes, *program.reading, program.lateness)],
    )
    defined = {a for a, _ in (*program.drive, *program.derivative)} | set(program.states) | {s.t, *RECORDED}
    missing = sorted(x.name for x in used - defined if x.name not in program.parameters)
    if missing:
        hint = " Add linear_stiffness to the model." if "alpha" in missing else ""
        raise InputError(f"The model on base {base_name!r} uses {', '.join(missing)}, which nothing declares.{hint}")
