"""Exports: what leaves the package computes what the compiled kernel computes."""

from __future__ import annotations

import doctest
import json
import re
import subprocess
import sys
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.mathtext import MathTextParser

from discovery.declarations import registry, symbols
from discovery.declarations.effect import ARM, Kinetic
from discovery.declarations.effect import Drive as DriveEffect
from discovery.declarations.parameters import Parameter
from discovery.declarations.registry import catalogue, effect_name
from discovery.equations.equation import equation_terms
from discovery.equations.model import Model
from discovery.equations.program import RECORDED, build_program
from discovery.estimation.declared import declared_model, rig_uncertainty
from discovery.estimation.fit import fit
from discovery.export import (
    FORMATS,
    FittedModel,
    export_model,
    from_json,
    read_fitted,
    to_json,
    to_latex,
    to_numpy,
    to_sympy,
    to_sympy_file,
)
from discovery.foundation.errors import InputError
from discovery.mechanics import get_base
from discovery.mechanics.base import ROOT_JOINTS
from discovery.recordings.drive import Drive
from discovery.recordings.experiment import make_experiment
from discovery.recordings.recording import read_recording
from discovery.results.provenance import surroundings
from discovery.rigs.rig_file import read_rig
from discovery.simulation.kernel.compile import numpy_derivative
from discovery.simulation.simulate import Simulator
from discovery.testing.states import every_effect

ROOT = Path(__file__).parents[1]
LINES = ("accelerometer", "base_excited", "moving_pivot", "servo", "inverse_dynamics", "falling_body")
BASES = ("constant_radius", "reduced", "oscillator", "elastica", *LINES)
#: The same; the text of three coordinates with every effect takes long.
QUICK_FIRST = [pytest.param(base, marks=pytest.mark.slow) if base == "elastica" else base for base in BASES]
#: An arm, a driven body, a reading of the acceleration, and a motion that is given.
FOUR = ("constant_radius", "oscillator", "accelerometer", "inverse_dynamics")
CLOSED = ("constant_radius", "reduced", "oscillator", *LINES)
TIME = np.linspace(0.0, 0.48, 121)
STEP = 0.002
SINGLY = [(b, e) for b in ("constant_radius", "oscillator") for e in every_effect(b)]
SINGLY += [("reduced", "base_compliance"), ("base_excited", "second_mode"), ("inverse_dynamics", "constant_force")]
SINGLY += [("base_excited", "ground_damping")]
SINGLY += [("inverse_dynamics", "friction_through_play"), *(("elastica_1", e) for e in sorted(ROOT_JOINTS))]
#: One by one on bases whose files are tried with all of their effects at once.
SLOWLY = [(b, e) for b in ("reduced", "accelerometer", "inverse_dynamics") for e in every_effect(b)]
EACH = [*SINGLY, *(pytest.param(*pair, marks=pytest.mark.slow) for pair in SLOWLY if pair not in SINGLY)]
TYPICAL = {
    "alpha": 8.8,
    "length": 0.9,
    "mu": 0.28,
    "tau_r": 1e-4,
    "xi": 0.05,
    "g": 1.3,
    "p": 0.7,
    "m": 2.5,
    "c_max": 0.3,
}


class Sine:
    """A smooth input."""

    kinks = np.empty(0)

    def evaluate(self, time, side="right"):
        phase = 2.0 * np.atleast_1d(time)
        return 0.5 * np.array([np.sin(phase), 2 * np.cos(phase), -4 * np.sin(phase)])


DRIVE = Sine()


def some_values(model: Model) -> dict[str, float]:
    """Return a number for every parameter, at which its effect is felt."""
    return {
        n: TYPICAL.get(n, p.default if p.shape else float(np.clip(p.prior.width, *p.bounds)))
        for n, p in model.parameters.items()
    }


def with_stiffness(base: str, *effects: str) -> Model:
    return Model(base, tuple(dict.fromkeys(("linear_stiffness", *effects))))


def module(source: str, library: str = "numpy", *, compiled: bool = False) -> dict[str, Any]:
    """Run an exported source that may import one library only; by itself, or with numba where it asks for that."""
    assert set(re.findall(r"^(?:import|from) (\w+)", source, re.MULTILINE)) <= {library}
    namespace: dict[str, Any] = {}
    exec(compile(source, "model.py", "exec"), namespace)
    if not compiled and library == "numpy":
        namespace["_compile"] = lambda: False
    return namespace


def recorded(model: Model, time: np.ndarray) -> tuple[Any, ...]:
    if model.mechanics.input_moves:
        return tuple(DRIVE.evaluate(time))
    return (lambda at: DRIVE.evaluate(at)[0],)


def kernel(
    model: Model, values: dict[str, float], start: tuple[float, float], step: float = STEP, drive: Any = DRIVE
) -> np.ndarray:
    """Return the readings of the kernel that knows every effect of the base, those beyond the model's absent."""
    whole = Model(model.base, every_effect(model.base))
    simulator = Simulator(whole.base, whole.effects, TIME, drive, step=step)
    parameters = np.array([[values.get(n, whole.parameters[n].default)] for n in simulator.names])
    return simulator(parameters, *[np.array([v]) for v in start])[:, :, 0].T


# numpy.


@cache
def everything(base: str) -> tuple[Model, dict[str, float], dict[str, Any]]:
    """Return a base with all of its effects, numbers for it, and what its file defines."""
    model = Model(base, every_effect(base))
    values = some_values(model)
    return model, values, module(to_numpy(model, values))


def exported(model: Model, values: dict[str, float], start: tuple[float, float], step: float = STEP) -> np.ndarray:
    return simulated(module(to_numpy(model, values)), model, start, step)


def simulated(namespace: dict[str, Any], model: Model, start: tuple[float, float], step: float = STEP) -> np.ndarray:
    simulate = namespace["simulate"]
    return simulate(TIME, *recorded(model, TIME), deflection=start[0], rate=start[1], step=step)


def assert_follows(got: np.ndarray, model: Model, values: dict[str, float], start: tuple[float, float]) -> None:
    """Compare with the kernel, which goes on with Taylor's series of the input where the file asks for the input."""
    late = module(to_numpy(model, values))["lateness"](TIME)
    known = (late <= TIME) & (TIME - late <= TIME[-1]) | model.mechanics.reads_state
    assert known.sum() > 100
    # An acceleration magnifies what short steps leave of rates where dry friction turns: 2e-9, at half of them 1e-10.
    near = 1e-9 if model.mechanics.reads_state else 1e-8
    np.testing.assert_allclose(got[:, known], kernel(model, values, start)[:, known], rtol=0, atol=near)


@pytest.mark.parametrize(("base", "effect"), EACH)
def test_the_numpy_file_follows_the_kernel_with_each_effect(base: str, effect: str) -> None:
    # Laws may be shares of the viscous damping.
    bare = with_stiffness(base, "viscous_damping")
    model = with_stiffness(base, "viscous_damping", effect)
    values = some_values(model)
    got = exported(model, values, (0.2, -0.3))
    assert_follows(got, model, values, (0.2, -0.3))
    if model != bare:
        assert np.abs(got - kernel(bare, some_values(bare), (0.2, -0.3))).max() > 1e-6, "the effect is not felt"


def test_every_effect_was_tried() -> None:
    assert {e for _, e in SINGLY} == set(catalogue())


@pytest.mark.slow
@pytest.mark.parametrize("base", QUICK_FIRST)
def test_the_numpy_file_follows_the_kernel_with_all_effects(base: str) -> None:
    model, values, namespace = everything(base)
    assert_follows(simulated(namespace, model, (0.2, -0.3)), model, values, (0.2, -0.3))


@pytest.mark.parametrize("base", ["constant_radius", "oscillator", "accelerometer"])
def test_a_sensor_that_runs_ahead_reads_beyond_the_last_step(base: str) -> None:
    model = with_stiffness(base, "sensor_delay")
    values = {**some_values(model), "tau": -0.05}
    assert_follows(exported(model, values, (0.2, 0.1)), model, values, (0.2, 0.1))


def test_the_exported_integrator_is_of_order_four() -> None:
    model = with_stiffness("constant_radius", "cubic_stiffness")
    values = some_values(model)
    fine = exported(model, values, (0.4, 0.0), 2.5e-4)
    time, motor = TIME[::30], DRIVE.evaluate(TIME[::30])
    assert np.diff(time)[0] == pytest.approx(0.12)
    simulate = module(to_numpy(model, values))["simulate"]
    error = [np.abs(simulate(TIME, *DRIVE.evaluate(TIME), deflection=0.4, step=h) - fine).max() for h in (0.004, 0.002)]
    assert error[0] / error[1] == pytest.approx(16, rel=0.1)
    # A coarse record of a smooth motor is joined to sixth order.
    coarse = simulate(time, *motor, deflection=0.4, step=2.5e-4)
    np.testing.assert_allclose(coarse, fine[:, ::30], atol=2e-7)


def test_a_jump_of_the_acceleration_is_given_twice() -> None:
    """The motor starts to turn with constant acceleration: the kernel is told by a kink, the file by a double time."""
    kink, a = 0.2005, 3.0
    rest = np.array([[0.0, 0.5 * a], [0.0, 0.0], [0.0, 0.0]])
    drive = Drive(np.array([0.0, kink, 1.0]), rest, np.array([kink]))
    model = with_stiffness("constant_radius", "viscous_damping", "sensor_delay")
    values = {**some_values(model), "tau": 0.013}
    expected = kernel(model, values, (0.0, 0.0), 5e-4, drive)
    first = int(np.searchsorted(TIME, kink))
    time = np.insert(TIME, first, [kink, kink])
    motor = np.concatenate([drive.evaluate(time[: first + 1], side="left"), drive.evaluate(time[first + 1 :])], axis=1)
    got = module(to_numpy(model, values))["simulate"](time, *motor, step=5e-4)
    np.testing.assert_allclose(np.delete(got, [first, first + 1], axis=1), expected, rtol=0, atol=1e-9)
    assert np.ptp(expected) > 0.1


def test_parameter_sets_run_side_by_side() -> None:
    model = with_stiffness("reduced", "coulomb_friction", "sensor_delay", "viscoelastic_relaxation")
    values = some_values(model)
    namespace = module(to_numpy(model, values))
    alpha, tau, deflection = np.array([8.0, 9.0, 10.0]), np.array([0.0, 0.01, -0.02]), np.array([0.1, 0.2, 0.3])
    motor = DRIVE.evaluate(TIME)
    sets = {**namespace["PARAMETERS"], "alpha": alpha, "tau": tau}
    together = namespace["simulate"](TIME, *motor, deflection=deflection, parameters=sets, step=STEP)
    assert together.shape == (2, TIME.size, 3)
    for k in range(3):
        one = {**values, "alpha": alpha[k], "tau": tau[k]}
        alone = namespace["simulate"](TIME, *motor, deflection=deflection[k], parameters=one, step=STEP)
        np.testing.assert_allclose(together[..., k], alone, rtol=0, atol=1e-13)


@pytest.mark.parametrize(
    "base", ["oscillator", *(pytest.param(b, marks=pytest.mark.slow) for b in ("reduced", "inverse_dynamics"))]
)
def test_what_numba_compiles_is_what_numpy_does_alone(base: str) -> None:
    """With all effects, and several parameter sets."""
    model, values, alone = everything(base)
    name = next(iter(values))
    sets = {**values, name: values[name] * np.array([1.0, 1.01])}
    given = {"deflection": np.array([0.2, 0.1]), "rate": -0.3, "parameters": sets, "step": STEP}
    compiled = module(to_numpy(model, values), compiled=True)
    found = compiled["simulate"](TIME, *recorded(model, TIME), **given)
    assert compiled["_compiled_slopes"].signatures
    expected = alone["simulate"](TIME, *recorded(model, TIME), **given)
    assert alone["_compiled_slopes"] is None
    assert found.shape == expected.shape
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12)


@pytest.mark.slow
def test_what_is_compiled_is_kept_beside_the_file_and_never_of_another_model(tmp_path: Path) -> None:
    code = (
        "import model; x = model.simulate([0.0, 0.5], 0.0, deflection=0.1); "
        "print(repr(float(x[0, 1])), sum(model._march.stats.cache_hits.values()))"
    )
    model, said = with_stiffness("oscillator"), []
    for alpha in (9.0, 9.0, 16.0):
        text = to_numpy(model, {"alpha": alpha, "g": 0.0})
        if not said or alpha != 9.0:
            (tmp_path / "model.py").write_text(text)
        done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, check=True, capture_output=True, text=True)
        said.append(done.stdout.split())
    assert [hits for _, hits in said] == ["0", "1", "0"]
    assert said[0][0] == said[1][0]
    for (value, _), omega in zip(said[1:], (3.0, 4.0), strict=True):
        assert float(value) == pytest.approx(0.1 * np.cos(0.5 * omega), abs=1e-5)


def test_without_numba_numpy_is_enough(monkeypatch: pytest.MonkeyPatch) -> None:
    model = with_stiffness("oscillator")
    namespace = module(to_numpy(model, {"alpha": 9.0, "g": 0.0}), compiled=True)
    monkeypatch.setitem(sys.modules, "numba", None)
    (found,) = namespace["simulate"](TIME, 0.0, deflection=0.2)
    assert not namespace["_compile"]()
    np.testing.assert_allclose(found, 0.2 * np.cos(3.0 * TIME), atol=1e-6)


@pytest.mark.parametrize("time", [0.0, [0.0], [0.0, 0.0], [0.0, 1.0, 0.5], [[0.0, 1.0]], [0.0, np.nan]])
def test_times_that_make_no_record_are_refused(time: float | list) -> None:
    model = with_stiffness("oscillator")
    with pytest.raises(ValueError, match="never decrease"):
        module(to_numpy(model, some_values(model)))["simulate"](time, 0.0)


def test_a_step_that_is_no_step_is_refused() -> None:
    model = with_stiffness("oscillator")
    for step in (0.0, np.nan):
        with pytest.raises(ValueError, match="step must be a positive time"):
            module(to_numpy(model, some_values(model)))["simulate"]([0.0, 1.0], 0.0, step=step)


@pytest.mark.slow
@pytest.mark.parametrize("base", BASES)
def test_slopes_are_those_of_the_program_over_many_samples(base: str) -> None:
    model, values, namespace = everything(base)
    rng = np.random.default_rng(1)
    program = build_program(model.base, model.effects)
    state, motor = rng.uniform(-0.4, 0.4, (len(program.states), 40)), rng.uniform(-1, 1, (3, 40))
    inputs = motor if model.mechanics.input_moves else motor[:1]
    expected = numpy_derivative(program)(0.7, motor, state, [values[n] for n in program.parameters])
    slopes = namespace["derivative"](0.7, state, *inputs)
    # A sharp joint amplifies round-off, to 1.3e-10 on one processor.
    np.testing.assert_allclose(slopes, np.array(np.broadcast_arrays(*expected, state[0])[:-1]), rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("base", BASES)
def test_the_initial_state_is_the_bases(base: str) -> None:
    model = with_stiffness(base, "viscoelastic_relaxation")
    deflection, rate, motor = np.array([0.1, -0.7]), np.array([0.3, 0.2]), np.array([0.4, -0.5])
    arm = model.mechanics.system == ARM
    state = module(to_numpy(model, some_values(model)))["initial_state"](deflection, rate, *(motor if arm else ()))
    q, qd = get_base(base).initial_coordinates(deflection, rate, motor)
    n = len(q)
    np.testing.assert_allclose(state[: 2 * n], np.concatenate([q, qd]), rtol=1e-13, atol=1e-15)
    assert (state[2 * n :] == 0).all()


class EncoderRipple(DriveEffect):
    """The encoder reads with a ripple, a gain and a drift."""

    e_r = Parameter("q", "ripple", latex="e_r")
    e_t = Parameter("q s^-1", "drift", latex="e_t")

    def expression(self):
        return 1.1 * symbols.theta_m + self.e_r * sp.sin(4 * symbols.theta_m) + self.e_t * symbols.t


class AddedInertia(Kinetic):
    """More mass at the tip, and an inertia that depends on the position."""

    m_a = Parameter("1", "added mass", latex="m_a")

    def expression(self):
        s = symbols
        return self.m_a * ((s.v_x**2 + s.v_y**2) / 2 + (1 + s.x * s.delta) * s.omega * s.delta_dot)


@pytest.fixture
def planted(monkeypatch: pytest.MonkeyPatch) -> tuple[str, ...]:
    """Return effects of kinds that the catalogue does not have, known for one test."""
    effects = {e.id(): e for e in (EncoderRipple(), AddedInertia())}
    monkeypatch.setattr(registry, "catalogue", lambda: {**catalogue(), **effects})
    return tuple(effects)


@pytest.mark.parametrize("base", ["constant_radius", "reduced", "elastica_2"])
def test_drive_and_kinetic_effects_are_exported(base: str, planted: tuple[str, ...]) -> None:
    law = ("radius_law",) if base == "constant_radius" else ()
    model = with_stiffness(base, *planted, *law)
    values = {**some_values(model), "e_r": 0.02, "e_t": 0.3, "m_a": 0.4}
    program = build_program(model.base, model.effects)
    rng = np.random.default_rng(3)
    time, state, motor = 0.7, rng.uniform(-0.4, 0.4, (len(program.states), 9)), rng.uniform(-1, 1, (3, 9))
    namespace = module(to_numpy(model, values))
    expected = numpy_derivative(program)(time, motor, state, [values[n] for n in program.parameters])
    slopes = namespace["derivative"](time, state, *motor)
    np.testing.assert_allclose(slopes, np.array(expected), rtol=1e-12, atol=1e-12)
    # The instrument sees the arm where the motor really is.
    received = 1.1 * motor[0] + 0.02 * np.sin(4 * motor[0]) + 0.3 * time
    bare = with_stiffness(base, *law)
    plain = module(to_numpy(bare, {n: values[n] for n in bare.parameters}))["reading"](time, state, received)
    np.testing.assert_allclose(namespace["reading"](time, state, motor[0]), plain, rtol=1e-13)
    assert r"\theta_m = " in to_latex(model, values)
    found = to_sympy(model)
    if found.equation is None:
        return
    rate = motor[1] * (1.1 + 0.08 * np.cos(4 * motor[0])) + 0.3
    bend = motor[2] * (1.1 + 0.08 * np.cos(4 * motor[0])) - 0.32 * np.sin(4 * motor[0]) * motor[1] ** 2
    meaning = {
        **values, "theta_t": state[0], "theta_t'": state[1], "theta_t''": slopes[1], "delta": state[0] - received,
        "delta'": state[1] - rate, "theta_m''": bend,
    }  # fmt: skip
    left = found.equation.lhs
    names = sorted(left.free_symbols, key=str)
    np.testing.assert_allclose(sp.lambdify(names, left)(*[meaning[x.name] for x in names]), 0.0, atol=1e-12)


# sympy.


@cache
def evaluator(base: str):
    model = Model(base, every_effect(base))
    found = to_sympy(model)
    time = sp.Symbol("t", real=True)
    arguments = [time, *found.recorded, *found.states, *found.parameters]
    # One assignment after the other, as the documentation says.
    steps, known = [], list(arguments)
    for symbol, expression in (*found.drive, *found.assignments):
        steps.append(sp.lambdify(known, expression))
        known.append(symbol)
    last = sp.lambdify(known, [*found.slopes, *found.reading])

    def evaluate(*values: float) -> list[float]:
        numbers = list(values)
        for step in steps:
            numbers.append(step(*numbers))
        return last(*numbers)

    return model, found, evaluate


@pytest.mark.parametrize(
    "base", [pytest.param(b, marks=pytest.mark.slow) if b in ("reduced", "elastica") else b for b in BASES]
)
def test_the_sympy_program_is_the_kernels(base: str) -> None:
    model, found, evaluate = evaluator(base)
    program = build_program(model.base, model.effects)
    values = some_values(model)
    rng = np.random.default_rng(2)
    numbers = [values[n] for n in program.parameters]
    assert [p.name for p in found.parameters] == list(program.parameters)
    state, motor = rng.uniform(-0.4, 0.4, len(program.states)), rng.uniform(-1, 1, 3)
    got = evaluate(0.3, *motor[: len(found.recorded)], *state, *numbers)
    expected = numpy_derivative(program)(0.3, motor, state, numbers)
    # The kernel solves for the accelerations by cofactors, whose rounding is not that of SymPy's elimination.
    np.testing.assert_allclose(got[: len(expected)], expected, rtol=1e-10, atol=1e-12)
    assert found.lateness == program.lateness


@pytest.mark.parametrize("base", [pytest.param(b, marks=pytest.mark.slow) if b == "reduced" else b for b in CLOSED])
@settings(max_examples=5, deadline=None)
@given(numbers=st.lists(st.floats(-0.6, 0.6), min_size=7, max_size=7))
def test_the_equation_of_motion_holds_for_the_kernels_acceleration(base: str, numbers: list[float]) -> None:
    """Lagrange's equation, derived from energies, against the program's forces and mass."""
    model, found, _ = evaluator(base)
    angle, rate, strain, *motor, time = numbers
    # Away from the kink of drag.
    rate += 1.0
    values = some_values(model)
    program = build_program(model.base, model.effects)
    state = [angle, rate] + [strain] * (len(program.states) - 2)
    slopes = numpy_derivative(program)(time, motor, state, [values[n] for n in program.parameters])
    arm = model.mechanics.system == ARM
    given = {**values, "t": time, **{r.name: m for r, m in zip(RECORDED, motor, strict=True)}}
    given |= {z.name: strain for z in program.states[2:]}
    # The deflection is that from what the arm receives, not from what is recorded.
    received = [_lambdified(e, names := _sorted(e))(*[given[x.name] for x in names]) for _, e in program.drive]
    deflection, turn = (angle - received[0], rate - received[1]) if arm else (angle, rate)
    meaning = {
        **values, "theta_t": angle, "theta_t'": rate, "theta_t''": slopes[1], "q": angle, "q'": rate, "q''": slopes[1],
        "delta": deflection, "delta'": turn, "theta_m''": received[-1], "u": received[0], "t": time,
        "r_0": motor[0],
        **{z.name: strain for z in program.states[2:]},
        **{f"{z.name}'": slope for z, slope in zip(program.states[2:], slopes[2:], strict=True)},
    }  # fmt: skip
    if not arm and model.mechanics.input_moves:
        meaning |= dict(zip(("u", "u'", "u''"), received, strict=True))
    if model.mechanics.prescribed:
        told = {
            **given,
            **dict(zip(("u", "u'", "u''"), received, strict=True)),
            **dict(zip(map(str, program.states), state, strict=True)),
            # What the instrument adds is no part of the force.
            "theta_0": 0.0,
        }
        meaning["F"] = _lambdified(found.reading[0], names := _sorted(found.reading[0]))(*[told[x.name] for x in names])
    for equation in (found.equation, *found.memory):
        left = equation.lhs - equation.rhs
        names = _sorted(left)
        assert abs(_lambdified(left, names)(*[meaning[x.name] for x in names])) < 1e-10


def _sorted(expression: sp.Expr) -> tuple[sp.Symbol, ...]:
    return tuple(sorted(expression.free_symbols, key=str))


@cache
def _lambdified(expression: sp.Expr, names: tuple[sp.Symbol, ...]):
    return sp.lambdify(names, expression)


def test_numbers_are_substituted_on_request() -> None:
    model = Model("reduced", ("viscous_damping", "linear_stiffness", "viscoelastic_relaxation"))
    found = to_sympy(model, {"alpha": 8.5, "mu": 0.0})
    assert {p.name for p in found.parameters} == {"length", "xi", "v", "tau_v"}
    everything = (found.equation, *found.memory, *found.slopes, *found.reading)
    names = {x.name for e in everything if e is not None for x in e.free_symbols}
    assert names.isdisjoint({"alpha", "mu"})
    assert names >= {"xi", "v"}
    slope = found.equation.lhs.diff(sp.Symbol("delta", real=True)).subs("delta", 0)  # type: ignore[union-attr]
    still = dict.fromkeys(slope.free_symbols, 0)
    assert float(slope.xreplace(still)) == pytest.approx(8.5)


def test_the_reduced_equation_expands_to_the_papers_third_order() -> None:
    """Finding h: c1 = 1/5, c2 = -2/5, c3 = 1/25, beta = 0.122 alpha, and -1/25 delta^2 theta_m''."""
    terms = equation_terms(Model("reduced", ("linear_stiffness",), {"mu": 0.0}))
    delta, rate, turn, motor, small = sp.symbols("delta theta_t' delta' theta_m'' epsilon", real=True)
    whole = sp.Add(*[t for _, t in terms.terms]) / terms.inertia
    scaled = whole.subs({x: small * x for x in (delta, rate, turn, motor)}, simultaneous=True).subs("mu", 0)
    third = sp.series(scaled.subs(sp.Symbol("mu", real=True), 0), small, 0, 4).removeO().coeff(small, 3)
    alpha = sp.Symbol("alpha", real=True)
    beta = sp.Rational(13, 210) - sp.Rational(1, 10) + sp.Rational(1, 5) - sp.Rational(1, 25)
    expected = alpha * beta * delta**3 + delta * rate**2 / 5 - 2 * delta * turn * rate / 5 + delta * turn**2 / 25
    assert sp.expand(third - (expected - delta**2 * motor / 25)) == 0


@pytest.mark.parametrize(
    "base", [pytest.param(b, marks=pytest.mark.slow) if b in ("reduced", "elastica") else b for b in BASES]
)
def test_the_sympy_file_rebuilds_the_expressions(base: str) -> None:
    model, found, _ = evaluator(base)
    values = some_values(model)
    source = to_sympy_file(model, values)
    assert set(re.findall(r"^(?:import|from) (\w+)", source, re.MULTILINE)) == {"sympy"}
    names = re.findall(r"^(\w+) = Symbol", source, re.MULTILINE)
    assert len(names) == len(set(names))
    namespace: dict[str, Any] = {}
    exec(source, namespace)
    numbers = {x: sp.Float(0.1 + 0.03 * i) for i, x in enumerate(sorted({
        x for e in (*found.slopes, *found.reading, *found.initial, *(e for _, e in (*found.drive, *found.assignments)))
        for x in e.free_symbols}, key=str))}  # fmt: skip

    def close(one: sp.Expr, other: sp.Expr) -> None:
        if one == other:
            return
        assert float(sp.sympify(one).xreplace(numbers)) == pytest.approx(float(other.xreplace(numbers)), rel=1e-13)

    assert [a for a, _ in namespace["assignments"]] == [a for a, _ in found.assignments]
    for (_, one), (_, other) in zip(namespace["assignments"], found.assignments, strict=True):
        close(one, other)
    for key in ("slopes", "reading", "initial"):
        for one, other in zip(namespace[key], getattr(found, key), strict=True):
            close(one, other)
    assert [a for a, _ in namespace["drive"]] == [a for a, _ in found.drive]
    for (_, one), (_, other) in zip(namespace["drive"], found.drive, strict=True):
        close(one, other)
    assert namespace["lateness"] == found.lateness
    assert (namespace["equation"] is None) == (base not in CLOSED)
    assert {x.name: v for x, v in namespace["PARAMETERS"].items()}.items() <= values.items()
    if base in CLOSED:
        assert found.equation is not None
        difference = namespace["equation"].lhs - namespace["equation"].rhs - found.equation.lhs + found.equation.rhs
        assert sp.factor_terms(sp.expand(difference)) == 0


# LaTeX.


def mathematics(text: str) -> list[str]:
    """Return the formulas of an exported text, the table's included."""
    body = text.partition(r"\begin{align*}")[2].partition(r"\end{align*}")[0]
    rows = [row.split("&&")[0].replace("&", "").strip() for row in re.split(r"\\\\\n", body)]
    return [*rows, *re.findall(r"(?<!\\)\$(.+?)(?<!\\)\$", text)]


@pytest.mark.parametrize("base", [b if b in FOUR else pytest.param(b, marks=pytest.mark.slow) for b in BASES])
def test_the_latex_is_balanced_and_renders(base: str) -> None:
    model = Model(base, every_effect(base))
    text = to_latex(model, some_values(model))
    plain = re.sub(r"\\[{}]", "", text)
    depth = np.cumsum([{"{": 1, "}": -1}.get(c, 0) for c in plain])
    assert depth.min() >= 0
    assert depth[-1] == 0
    assert re.findall(r"\\begin\{(.+?)\}", text) == re.findall(r"\\end\{(.+?)\}", text) == ["align*", "tabular"]
    assert text.count(r"\left") == text.count(r"\right")
    formulas = mathematics(text)
    assert len(formulas) > 2 * len(model.parameters)
    parser = MathTextParser("path")
    for formula in formulas:
        # What a reader without the macros of amsmath knows of its own accord.
        shown = formula.replace(r"\arg", r"\mathrm{arg}")
        parser.parse(f"${shown}$")
    table = text.partition(r"\begin{tabular}")[2]
    for parameter in model.parameters.values():
        assert parameter.meaning.replace("%", r"\%") in table
    for effect in model.effects:
        shown = effect_name(effect) in text
        assert shown or catalogue()[effect].kind in ("sensor", "drive"), effect


def test_the_latex_has_the_papers_equations() -> None:
    model = Model("constant_radius", ("viscous_damping", "linear_stiffness", "cubic_stiffness", "radius_law"))
    text = to_latex(model)
    for part in (r"\ddot{\theta}_t", r"+ \xi \dot{\theta}_t", r"+ \alpha \delta", r"+ \beta \delta^{3} = 0"):
        assert part in text
    assert r"\rho_t = l \cos{\left(\delta \gamma \right)}" in text
    assert "tabular" not in text
    assert r"\varphi_{1}(s) = 2 s - s^{2} &&" in to_latex(with_stiffness("elastica_2"))


def test_what_gives_way_at_the_root_and_along_the_rod_is_written_whole() -> None:
    model = with_stiffness("elastica_2", "base_hysteresis", "hysteresis", "input_gain", "base_compliance")
    text = json.loads(to_json(model, some_values(model)))["equation"]["text"]
    assert text[0] == "theta(s, t) = theta_m(t) + sum_k q_k(t) (phi_k(s) + c_b phi_k'(0))"
    assert text[-1] == "theta_m = p + r_0*(k_h + 1), r_0 being what is recorded"
    assert any(line.startswith("base_hysteresis: p = ") and "P = -alpha*root*p'" in line for line in text)
    assert "hysteresis: P = 3 int_0^1 (-alpha*bend_dot*h_b*z_h) ds, bend = kappa(s, t)/3" in text
    assert {line.partition(" ")[0] for line in text} >= {"z_c'", "z_h'"}
    latex = to_latex(model)
    for part in (
        r"P = - \alpha b \dot{p}, \quad b = \frac{1}{3} \kappa(0, t)",
        r"P = 3 \int_0^1 \left(- \alpha \dot{b} h_b z_{h}\right) \mathrm{d}s",
        r"\theta_m = p + \theta_{m,\mathrm{rec}} \left(k_h + 1\right)",
    ):
        assert part in latex


@pytest.mark.parametrize(
    ("value", "sd", "shown"),
    [
        (8.093003, 2.8e-5, r"8.093003 \pm 0.000028"),
        (736758.49, 110.47, r"736760 \pm 110"),
        (1.4799e-5, 3.6e-7, r"(1.480 \pm 0.036) \times 10^{-5}"),
        (0.0, float("nan"), "0"),
        (2e-5, float("nan"), r"2 \times 10^{-5}"),
        (-0.5, 0.0, "-0.5"),
    ],
)
def test_values_are_written_with_at_least_two_digits_of_their_deviation(value: float, sd: float, shown: str) -> None:
    model = with_stiffness("oscillator")
    covariance = np.array([[sd**2]])
    found = FittedModel(model, {"alpha": value, "g": 1.0}, ("alpha",), covariance)
    row = next(line for line in to_latex(found).splitlines() if line.startswith(r"$\alpha$ & "))
    assert row.split("&")[1].strip() == f"${shown}$"


# JSON, and a model from a fit.


@pytest.fixture(scope="module")
def fitted():
    folder = ROOT / "datasets" / "arm_coulomb"
    rig = read_rig(folder / "rig.toml")
    experiment = make_experiment(read_recording(folder / "train_large.csv", rig), rig, fitted_samples=600)
    model = declared_model(experiment).with_effect("coulomb_friction", "sensor_delay")
    return fit(model, [experiment])


def test_json_gives_back_model_and_numbers(fitted) -> None:
    text = to_json(fitted)
    found, expected = from_json(text), FittedModel.from_fit(fitted)
    assert replace(found, physical={}) == replace(expected, physical={})
    # What lies at a bound has no interval.
    np.testing.assert_equal(found.physical, expected.physical)
    assert found.model == fitted.model
    np.testing.assert_array_equal(found.covariance, fitted.covariance)
    assert found.sd == pytest.approx(fitted.sd, rel=1e-15, nan_ok=True)
    content = json.loads(text)
    documented = (ROOT / "docs" / "EXPORT.md").read_text(encoding="utf-8")
    assert all(f"`{key}`" in documented for key in content)
    assert content["equation"]["text"][0] == "{0.lhs} = {0.rhs}".format(fitted.model.equation())
    assert to_json(found) == text


def test_what_the_fit_held_is_exported(fitted) -> None:
    found = FittedModel.from_fit(fitted)
    assert found.values["length"] == 1.0
    # The creep speed is declared in natural units; the fit used it in SI.
    declared = fitted.model.parameters["v_c"]
    assert found.values["v_c"] == pytest.approx(declared.default * fitted.problem.units.scale(declared), rel=1e-15)
    assert found.values["v_c"] != declared.default
    assert found.provenance["data"][0]["sha256"] == fitted.problem.bench.experiments[0].recording.sha256
    assert found.initial["train_large"] == tuple(fitted.minimum.x[-2:])
    assert found.provenance["git_revision"] == surroundings()["git_revision"]


def test_what_was_fitted_is_not_known() -> None:
    """The mass ratio of a rig file is fitted within its uncertainty: its number is that of the fit."""
    folder = ROOT / "datasets" / "arm"
    rig = read_rig(folder / "rig.toml")
    experiment = make_experiment(read_recording(folder / "train_paper.csv", rig), rig, fitted_samples=300)
    model = declared_model(experiment).on_base("reduced")
    result = fit(model, [experiment], gaussian=rig_uncertainty(experiment))
    found = FittedModel.from_fit(result)
    assert "mu" in model.known
    assert found.model.known.keys() == model.known.keys() - {"mu"}
    assert found.values["mu"] == result.values["mu"] != model.known["mu"]


def test_the_numpy_file_reads_what_the_instrument_read(fitted) -> None:
    """On the recording itself, its smooth drive given at samples and joints."""
    (experiment,) = fitted.problem.bench.experiments
    drive, sampled = experiment.drive, experiment.recording.time
    stop = 4.0
    joints = drive.breakpoints[(drive.breakpoints > sampled[0]) & (drive.breakpoints < stop)]
    smooth = np.union1d(sampled[sampled <= stop], joints)
    kinks = drive.kinks[(drive.kinks > sampled[0]) & (drive.kinks < stop)]
    time = np.sort(np.concatenate([smooth, kinks]))
    motor = drive.evaluate(time)
    before = np.flatnonzero(np.diff(time, append=np.inf) == 0)
    motor[:, before] = drive.evaluate(time[before], side="left")
    namespace = module(to_numpy(fitted))
    deflection, rate = FittedModel.from_fit(fitted).initial["train_large"]
    got = namespace["simulate"](time, *motor, deflection=deflection, rate=rate, step=fitted.problem.bench.step / 4)
    wanted = sampled <= stop
    ours = got[:, np.searchsorted(time, sampled[wanted], side="right") - 1]
    np.testing.assert_allclose(ours, fitted.predict()[0][wanted].T, rtol=0, atol=2e-6)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda c: c.update(schema="other"), "not a 'discovery-model'"),
        (lambda c: c.update(schema_version=99), "newer than 1. Update"),
        (lambda c: c.pop("model"), "Export it again"),
        (lambda c: c["parameters"].pop(), "no value of"),
        (lambda c: c["model"].update(base="circle"), "no base called 'circle'"),
    ],
)
def test_json_that_is_no_model_is_refused(change, message: str) -> None:
    model = with_stiffness("oscillator")
    content = json.loads(to_json(model, some_values(model)))
    change(content)
    with pytest.raises(InputError, match=message):
        from_json(json.dumps(content))
    with pytest.raises(InputError, match="Export it again"):
        from_json("[1, 2")


def test_numbers_are_asked_for() -> None:
    model = with_stiffness("constant_radius")
    with pytest.raises(InputError, match="no value of length"):
        to_numpy(model, {"alpha": 8.0})
    with pytest.raises(InputError, match="no parameter alfa"):
        to_json(model, {"alfa": 8.0})
    known = Model(model.base, model.effects, {"length": 0.5})
    assert module(to_numpy(known, {"alpha": 8.0}))["PARAMETERS"] == {"length": 0.5, "alpha": 8.0}


@pytest.mark.parametrize("kind", [np.float64, np.float32, int])
def test_numbers_of_any_kind_are_written_plainly(kind: type) -> None:
    model = with_stiffness("oscillator")
    found = FittedModel(model, {"alpha": kind(8), "g": kind(1)}, initial={"a": (kind(1), kind(0))}, step=kind(1))
    for text, library in ((to_numpy(found), "numpy"), (to_sympy_file(found), "sympy")):
        assert set(module(text, library)["PARAMETERS"].values()) == {8.0, 1.0}
        assert "np.float" not in text
    assert from_json(to_json(found)).values == {"alpha": 8.0, "g": 1.0}
    for wrong, message in (("a", "give a number"), (np.nan, "not finite"), (np.inf, "not finite")):
        for write in (to_sympy, to_json):
            with pytest.raises(InputError, match=f"value of alpha is .*{message}"):
                write(model, {"alpha": wrong, "g": 1.0})
    with pytest.raises(InputError, match="no parameter alfa"):
        to_sympy(model, {"alfa": 8.0})
    # What `Fit.values` holds beside the parameters.
    assert to_sympy(model, {"alpha": 8.0, "delta_0_init[a]": 0.1}).equation == to_sympy(model, {"alpha": 8.0}).equation


@pytest.mark.parametrize(
    "name", ['a """quoted""" rig', "back\\slash \\N{no}", 'ends with "', "@DRIVE@ line\r\nend\u2028"]
)
def test_no_name_breaks_a_file(name: str) -> None:
    model = with_stiffness("oscillator")
    provenance = {
        "discovery": "1", "rig": {"name": name, "sha256": "0" * 64}, "data": [{"source": name, "sha256": "1" * 64}],
    }  # fmt: skip
    found = FittedModel(model, some_values(model), initial={name: (0.1, 0.0)}, provenance=provenance)
    for text, library in ((to_numpy(found), "numpy"), (to_sympy_file(found), "sympy")):
        shown = " ".join(name.split()).replace('"""', "'''")
        assert f"Rig: {shown} (sha" in module(text, library)["__doc__"]
    head = to_latex(found).partition(r"\begin{align*}")[0]
    assert len(head.splitlines()) == 3
    assert all(line.startswith("% ") for line in head.splitlines())


# Files.


def stored(folder: Path, name: str = "loop.json") -> FittedModel:
    model = Model("oscillator", ("linear_stiffness", "cubic_stiffness"), {"g": 0.0})
    found = FittedModel(model, some_values(model), ("alpha",), np.array([[0.25]]), initial={"a": (0.1, 0.0)}, step=1e-3)
    linear = model.without(["cubic_stiffness"])
    models = {"after": found.to_dict(), "before": FittedModel(linear, some_values(linear)).to_dict()}
    (folder / name).write_text(json.dumps({"models": models, "provenance": {"git_revision": "abc123"}}))
    return found


def test_a_folder_is_exported_in_every_format(tmp_path: Path) -> None:
    stored(tmp_path)
    found = read_fitted(tmp_path)
    out = tmp_path / "new" / "files"
    assert (
        {p.name for p in export_model(found, out)}
        == {p.name for p in out.iterdir()}
        == {f for kind in FORMATS.values() for f in kind.files}
    )
    assert from_json((out / "model.json").read_text()) == found
    assert found.provenance["git_revision"] == "abc123"
    assert read_fitted(tmp_path, "before").model.effects == ("linear_stiffness",)
    code = (
        "import sys, model; x = model.simulate([0.0, 0.5, 1.0], 0.0, deflection=0.1); "
        "assert x.shape == (1, 3); assert 'sympy' not in sys.modules; assert 'discovery' not in sys.modules"
    )
    subprocess.run([sys.executable, "-W", "error", "-c", code], cwd=out, check=True)


@pytest.mark.parametrize("path", ["reports/arm/model.json", Path("model.json"), ""])
def test_a_path_in_place_of_text_is_named(path: Any) -> None:
    with pytest.raises(InputError, match=r"reads text, not a path.*read_text"):
        from_json(path)


def test_unusable_folders_and_formats_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"There is no folder .*nowhere; name the one that `discovery run`"):
        read_fitted(tmp_path / "nowhere")
    with pytest.raises(InputError, match=r"holds no results\.json and no loop\.json"):
        read_fitted(tmp_path)
    (tmp_path / "loop.json").write_text("{}")
    with pytest.raises(InputError, match="earlier version"):
        read_fitted(tmp_path)
    (tmp_path / "loop.json").write_text("{")
    with pytest.raises(InputError, match="cannot be read"):
        read_fitted(tmp_path)
    found = stored(tmp_path)
    with pytest.raises(InputError, match="no format word; there are sympy, latex"):
        export_model(found, tmp_path / "out", ["json", "word"])
    with pytest.raises(InputError, match="No format is named; name some of sympy, latex"):
        export_model(found, tmp_path / "out", [])
    assert not (tmp_path / "out").exists()


def test_the_page_is_true(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    results = doctest.testfile(str(ROOT / "docs" / "EXPORT.md"), module_relative=False)
    assert results.attempted >= 10
    assert results.failed == 0
