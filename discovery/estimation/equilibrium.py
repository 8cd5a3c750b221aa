"""Where a model rests under a constant input."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import sympy as sp
from scipy.optimize import brentq, root

from discovery.declarations import symbols as s
from discovery.declarations.effect import Load
from discovery.equations.model import Model
from discovery.equations.program import Program, build_program
from discovery.estimation.natural_units import NaturalUnits
from discovery.foundation.arrays import FloatArray
from discovery.foundation.errors import ComputationError
from discovery.simulation.kernel.compile import numpy_derivative

_NO_REST = "The model has no rest position in its range; give --initial-state POSITION,RATE."


@lru_cache(maxsize=64)
def _statics(base: str, effects: tuple[str, ...]) -> tuple[Program, Callable[..., list], Callable[..., list]]:
    """Return a model's program, its slopes, and the true output for coordinates, motor angle and parameters."""
    program = build_program(base, effects)
    output = Model(base, effects).mechanics.reading(None, program.rod)
    parameters = [sp.Symbol(p, real=True) for p in program.parameters]
    known = [*program.states[: program.n_coordinates], s.theta_m, *parameters]
    return program, numpy_derivative(program), sp.lambdify(known, list(output))


def equilibrium(
    model: Model, values: Mapping[str, float], units: NaturalUnits, drive: Sequence[float], time: float | None = None
) -> float:
    """Return the deflection at which the model rests under a constant input.

    Of several rest positions the one nearest to zero is returned. A declared system begins at rest where its
    coordinates are zero, as does a body that nothing pulls back: they have no place where they rest.

    `values`: its parameters; missing ones are absent. `drive`: input at rest: motor angle [rad], or u. `time`: forces
    that depend on time are held as they are then [s]; by default they are left out. Raises ComputationError if there is
    no rest position within the range of the model.
    """
    if model.mechanics.places():
        return 0.0
    rest = _Rest.of(model, _held(model, values, units, time), drive, 0.0 if time is None else time)
    arm, n = model.mechanics.system.has_rod, rest.program.n_coordinates
    reach = np.linspace(0, 1.2 if arm else 5 * units.coordinate, 121)
    grid = np.concatenate([-reach[:0:-1], reach])
    force = np.array([rest.push(d) for d in grid])
    crossing = np.flatnonzero((force[:-1] >= 0) & (force[1:] < 0))
    if n == 1 and np.ptp(force) <= 1e-12 * np.abs(force).max():
        return 0.0
    if crossing.size == 0:
        # A root that turns with its load has memory: the rod and its root settle together.
        q = rest.settled(units.time)
        found = float(q[0]) - (drive[0] if arm else 0.0) if n == 1 else rest.angle(q)
        is_rest = True
    else:
        nearest = crossing[np.argmin(np.abs(grid[crossing]))]
        near = float(brentq(rest.push, grid[nearest], grid[nearest + 1], xtol=1e-12))
        if n == 1:
            return near
        # A force that no slow motion follows may hide where the rod rests near its straight shape.
        tried = [rest.beside(each) for each in (near, 0.0)]
        found, is_rest = min(tried, key=lambda each: (not each[1], abs(each[0])))
    if not is_rest or abs(found) > reach[-1]:
        raise ComputationError(_NO_REST)
    return found


def moving(model: Model) -> set[str]:
    """Return the names of the amplitudes of forces that depend on time."""
    loads = (e for e in model.terms if isinstance(e, Load))
    in_time = (e for e in loads if any(symbol.name == "t" for symbol in e.expression().free_symbols))
    return {p.name for e in in_time for p in e.parameters() if not p.shape}


def _held(model: Model, values: Mapping[str, float], units: NaturalUnits, time: float | None) -> dict[str, float]:
    """Return the values of all parameters, without the forces that depend on time unless it is given."""
    given = {**model.known, **values, **(dict.fromkeys(moving(model), 0.0) if time is None else {})}
    return {**{n: p.default * units.scale(p) for n, p in model.parameters.items() if n not in given}, **given}


@dataclass(frozen=True)
class _Rest:
    """A model under a constant input: what accelerates it where it does not move."""

    model: Model
    program: Program
    slopes: Callable[[FloatArray], FloatArray]
    output: Callable[[FloatArray], list[float]]
    start: tuple[float, float]
    form: tuple
    others: FloatArray  # rates and memory at rest

    @classmethod
    def of(cls, model: Model, values: Mapping[str, float], drive: Sequence[float], time: float) -> _Rest:
        program, derivative, output = _statics(model.base, model.effects)
        parameters = [values[name] for name in program.parameters]
        recorded = (drive[0], 0.0, 0.0)
        return cls(
            model,
            program,
            slopes=lambda state: np.array(derivative(time, recorded, state, parameters), float),
            output=lambda q: output(*q, 0.0, *parameters),
            start=model.mechanics.system.still(drive[0]),
            form=program.form(parameters),
            others=np.array([drive[0] * (z in dict(program.begun)) for z in program.states[program.n_coordinates :]]),
        )

    def coordinates(self, deflection: float, rate: float) -> tuple[FloatArray, FloatArray]:
        """Return the coordinates of a slow motion through a deflection, and their rates."""
        q, tangent = self.model.mechanics.initial_coordinates(
            np.array([deflection]), np.array([rate]), self.start, self.form
        )
        return q[:, 0], tangent[:, 0]

    def acceleration(self, q: FloatArray) -> FloatArray:
        n = self.program.n_coordinates
        return self.slopes(np.concatenate([q, self.others]))[n : 2 * n]

    def push(self, deflection: float) -> float:
        """Return where a slow motion through this deflection is accelerated to."""
        q, tangent = self.coordinates(deflection, 1.0)
        return float(self.acceleration(q) @ tangent)

    def angle(self, q: FloatArray) -> float:
        tip = self.output(q)
        return float(np.arctan2(tip[1], tip[0]))

    def settled(self, time: float) -> FloatArray:
        """Return the coordinates in which the straight rod comes to rest, slowed down by a strong extra friction.

        Raises ComputationError if it does not come to rest.
        """
        from scipy.integrate import solve_ivp

        q, _ = self.coordinates(0.0, 0.0)
        n = q.size

        def slowed(_: float, state: FloatArray) -> FloatArray:
            change = self.slopes(state)
            change[n : 2 * n] -= 4.0 / time * state[n : 2 * n]
            return change

        first = np.concatenate([q, self.others])
        found = solve_ivp(slowed, (0.0, 60 * time), first, method="LSODA", rtol=1e-8, atol=1e-10)
        end = found.y[:, -1]
        if not (found.success and np.abs(slowed(0.0, end)[:n]).max() * time < 1e-5):
            raise ComputationError(_NO_REST)
        return end[:n]

    def beside(self, deflection: float) -> tuple[float, bool]:
        """Return the angle at which every coordinate rests, near a load at the tip alone, and whether it is found.

        The rod's own weight bends it otherwise than that load.
        """
        q, _ = self.coordinates(deflection, 0.0)

        # From zero on, for the solver's differences are relative to its unknowns.
        def around(away: FloatArray) -> FloatArray:
            return self.acceleration(q + away)

        found = root(around, np.zeros(q.size), options={"xtol": 1e-13})
        # Near its start it is one also where rounding keeps the solver from its last digits.
        return self.angle(q + found.x), bool(found.success or np.abs(found.x).max() < 0.1)
