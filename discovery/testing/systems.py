"""What every declared system must fulfil, whoever declares it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np
import sympy as sp
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from discovery.declarations.system import SystemDeclaration
from discovery.equations.lacking import candidates
from discovery.equations.model import Model
from discovery.equations.program import Program, build_program
from discovery.mechanics.declared import DeclaredBase
from discovery.mechanics.declared_equations import INPUT, coordinates_of
from discovery.mechanics.systems import system_base
from discovery.simulation.kernel.compile import numpy_derivative
from discovery.simulation.simulate import Simulator

_STATES = 6


class SystemContract:
    """Tests of declared systems by law; subclass it in a test module, under a name that starts with ``Test``.

    Attributes
    ----------
    systems : mapping of str to SystemDeclaration
        The systems under test.
    """

    systems: ClassVar[Mapping[str, SystemDeclaration]] = {}

    def pytest_generate_tests(self, metafunc) -> None:
        """Run every test for each system."""
        if "system" in metafunc.fixturenames:
            metafunc.parametrize("system", list(self.systems))

    def base(self, system: str) -> DeclaredBase:
        """Return the base of a system."""
        return system_base(self.systems[system])

    def test_power_balance(self, system: str) -> None:
        """Without input, energy changes by what the declared forces and losses do, at random states."""
        base = self.base(system)
        e, (q, rates, _) = base.equations, coordinates_of(base.n_coordinates)
        given = [e_i - sp.diff(e.dissipation, rate) for e_i, rate in zip(e.forces, rates, strict=True)]
        energy = e.kinetic + e.potential
        gained = sp.Add(*[f * rate for f, rate in zip(given, rates, strict=True)])
        program = build_program(base.name, ())
        slopes = numpy_derivative(program)
        for state in _random_states(base):
            moved = slopes(0.0, (0.0, 0.0, 0.0), state, _values(base, program))
            here = dict(zip((*q, *rates), state, strict=True)) | dict.fromkeys(INPUT, 0.0) | base.guess
            change = [sp.diff(energy, x).xreplace(here) * v for x, v in zip((*q, *rates), moved, strict=True)]
            size = max(abs(float(c)) for c in change)
            assert abs(float(sp.Add(*change) - gained.xreplace(here))) < 1e-9 * size

    def test_kernel(self, system: str) -> None:
        """The compiled simulation is that of another integrator."""
        base = self.base(system)
        program = build_program(base.name, ())
        time = np.linspace(0.0, 0.5 * _period(base), 40)
        simulator = Simulator(base.name, (), time, None, step=float(time[1]) / 20)
        values = np.array(_values(base, program))
        got = simulator(values[:, None], np.array([0.1]), np.array([0.0]))[:, 0, 0]
        start = np.concatenate(base.initial_coordinates(np.array([0.1]), np.array([0.0]), (0.0, 0.0)))[:, 0]
        slopes = numpy_derivative(program)
        exact = solve_ivp(
            lambda t, y: np.array(slopes(t, (0.0, 0.0, 0.0), y, values), float), (0.0, time[-1]), start,
            t_eval=time, method="LSODA", rtol=1e-10, atol=1e-13,
        ).y  # fmt: skip
        assert np.allclose(got, _reading(base, program, exact, values), rtol=1e-5, atol=1e-6)

    def test_output_is_a_derivative(self, system: str) -> None:
        """What is read of rates and accelerations is what the coordinates do."""
        base = self.base(system)
        n, program = base.n_coordinates, build_program(base.name, ())
        values = _values(base, program)
        for state in _random_states(base):
            moved = numpy_derivative(program)(0.0, (0.0, 0.0, 0.0), state, values)
            q, rates, accelerations = coordinates_of(n)
            here = dict(zip((*q, *rates, *accelerations), (*state, *moved[n:]), strict=True))
            wanted = base.equations.output.xreplace(here | dict.fromkeys(INPUT, 0.0) | base.guess)
            assert np.isclose(_reading(base, program, np.array(state)[:, None], np.array(values))[0], float(wanted))

    def test_effects_at_every_place(self, system: str) -> None:
        """Every effect acts where it is offered: it moves the system, and losses take energy away."""
        base = self.base(system)
        offered = [e for e in candidates(Model(base.name, ())) if "_at_" in e]
        assert {e.partition("_at_")[2] for e in offered} == set(base.places())
        bare = numpy_derivative(build_program(base.name, ()))
        for place in base.places():
            loss = f"viscous_damping_at_{place}"
            program = build_program(base.name, (loss,))
            xi = 2.0 * base.places()[place].inertia
            for state in _random_states(base):
                still = bare(0.0, (0.0, 0.0, 0.0), state, _values(base, build_program(base.name, ())))
                rubbed = numpy_derivative(program)(0.0, (0.0, 0.0, 0.0), state, [*_values(base, program)[:-1], xi])
                change = np.subtract(rubbed, still)[base.n_coordinates :]
                mass = np.array(_mass(base, state), float)
                power = float(np.array(state[base.n_coordinates :]) @ mass @ change)
                rate = float(np.dot(_jacobian(base, place, state), state[base.n_coordinates :]))
                assert np.isclose(power, -xi * rate**2)

    def test_description(self, system: str) -> None:
        """A model of it survives its own description."""
        declaration = self.systems[system]
        again = SystemDeclaration.from_dict(declaration.to_dict())
        assert again.identity == declaration.identity
        assert Model.from_dict(Model(self.base(system).name, ()).to_dict()).base == declaration.identity


def _random_states(base: DeclaredBase) -> list[list[float]]:
    rng = np.random.default_rng(1)
    return rng.normal(0.0, 0.5, (_STATES, 2 * base.n_coordinates)).tolist()


def _values(base: DeclaredBase, program: Program) -> list[float]:
    known = {x.name: value for x, value in base.guess.items()}
    return [known.get(name, 0.0) for name in program.parameters]


def _period(base: DeclaredBase) -> float:
    """Return the shortest period of a small motion, or one second where nothing swings."""
    stiffness = base.stiffness()
    squares = np.linalg.eigvals(np.linalg.solve(base.inertia, stiffness)).real
    return float(2 * np.pi / np.sqrt(squares.max())) if squares.max() > 0 else 1.0


def _reading(base: DeclaredBase, program: Program, states: NDArray, values: NDArray) -> NDArray:
    received = {
        a: sp.sympify(e).xreplace(dict.fromkeys(sp.symbols("r_0 r_1 r_2", real=True), 0)) for a, e in program.drive
    }
    law = program.reading[0].xreplace(received)
    known = [*program.states, *(sp.Symbol(p, real=True) for p in program.parameters)]
    found = sp.lambdify(known, law, "numpy")(*states, *values)
    return np.broadcast_to(found, states.shape[1:])


def _mass(base: DeclaredBase, state: list[float]) -> list[list[float]]:
    q, rates, _ = coordinates_of(base.n_coordinates)
    here = dict(zip((*q, *rates), state, strict=True)) | dict.fromkeys(INPUT, 0.0) | base.guess
    return [[float(e.xreplace(here)) for e in row] for row in sp.hessian(base.equations.kinetic, rates).tolist()]


def _jacobian(base: DeclaredBase, place: str, state: list[float]) -> list[float]:
    q, rates, _ = coordinates_of(base.n_coordinates)
    here = dict(zip((*q, *rates), state, strict=True)) | dict.fromkeys(INPUT, 0.0) | base.guess
    return [float(sp.diff(base.equations.places[place][0], x).xreplace(here)) for x in q]
