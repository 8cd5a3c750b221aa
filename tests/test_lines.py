"""Systems with one coordinate on a line, each base against mathematics of its own."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import pytest
import sympy as sp
from numpy.typing import NDArray
from scipy.integrate import OdeSolution, solve_ivp
from scipy.signal import TransferFunction, lsim

from discovery.declarations.effect import Mode, Sensor
from discovery.declarations.registry import get_effect
from discovery.equations.equation import equation_of_motion, equation_terms
from discovery.equations.lacking import candidates, eventual_candidates
from discovery.equations.model import Model
from discovery.equations.program import build_program
from discovery.export import to_json, to_latex, to_sympy
from discovery.recordings.drive import Drive
from discovery.report.equations import model_formulas
from discovery.simulation.grid import DriveLike
from discovery.simulation.kernel.compile import numpy_derivative
from discovery.simulation.simulate import Simulator

LINEAR = ("viscous_damping", "linear_stiffness")
ON_A_LINE = ("oscillator", "accelerometer", "base_excited", "moving_pivot", "servo", "inverse_dynamics", "falling_body")
TIME = np.linspace(0.0, 4.0, 401)
TYPICAL = {"alpha": 9.0, "xi": 0.3, "xi_1": 0.3, "g": 1.3}
MODE = {"g_2": -0.4, "omega_2": 11.0, "zeta_2": 0.03}


@dataclass(frozen=True)
class Swing:
    """A smooth input with its derivatives."""

    amplitude: float = 0.7
    rate: float = 2.3
    kinks: NDArray = field(default_factory=lambda: np.empty(0))

    def evaluate(self, time, side="right"):
        phase = self.rate * np.atleast_1d(time) + 0.4
        return self.amplitude * np.array([np.sin(phase), self.rate * np.cos(phase), -(self.rate**2) * np.sin(phase)])


def simulate(
    base: str,
    effects: tuple[str, ...],
    values: Mapping[str, float],
    drive: DriveLike | None,
    start: tuple[float, float] = (0.0, 0.0),
    time: NDArray = TIME,
) -> NDArray:
    """Return the reading (m,) from the kernel of everything that acts on the base; what is not named is absent."""
    model, whole = Model(base, effects), Model(base, eventual_candidates(Model(base, ())))
    assert values.keys() <= model.parameters.keys()
    sim = Simulator(base, whole.effects, time, drive, step=0.005)
    numbers = np.array([[values.get(n, whole.parameters[n].default)] for n in sim.names])
    return sim(numbers, np.array([start[0]]), np.array([start[1]]))[:, 0, 0]


def some_values(model: Model) -> dict[str, float]:
    """Return a number for every parameter, at which its effect is felt."""
    return {
        n: TYPICAL.get(n, p.default if p.shape or p.fixed else float(np.clip(p.prior.width, *p.bounds)))
        for n, p in model.parameters.items()
    }


def reference(slopes, start: list[float]) -> NDArray:
    """Return the states (n, m) of an equation written once more."""
    return solve_ivp(slopes, TIME[[0, -1]], start, "DOP853", TIME, rtol=1e-11, atol=1e-12).y


# A base that moves.


def test_a_body_on_a_moving_base_obeys_newton_in_the_fixed_frame() -> None:
    drive = Swing()
    effects = (*LINEAR, "cubic_stiffness", "gravity_torque")
    found = simulate("base_excited", effects, {"alpha": 9.0, "xi": 0.3, "beta": 4.0, "g_c": 2.0}, drive, (0.2, -0.5))

    def slopes(t: float, y: NDArray) -> list[float]:
        u, rate, _ = drive.evaluate(t)[:, 0]
        q, turn = y[0] - u, y[1] - rate
        return [y[1], -0.3 * turn - 9.0 * q - 4.0 * q**3 - 2.0 * np.sin(y[0])]

    u, rate, _ = drive.evaluate(0.0)[:, 0]
    np.testing.assert_allclose(found, reference(slopes, [u + 0.2, rate - 0.5])[0] - drive.evaluate(TIME)[0], atol=1e-8)


def test_a_pendulum_on_a_moving_pivot_obeys_newton() -> None:
    drive, length = Swing(), 0.7
    values = {"xi": 0.3, "g_c": 9.81 / length, "p": 1 / length}
    found = simulate("moving_pivot", ("viscous_damping", "gravity_torque"), values, drive, (0.2, -0.5))

    def slopes(t: float, y: NDArray) -> list[float]:
        # Of the bob at u + l sin q, -l cos q, the part across the string.
        return [y[1], -0.3 * y[1] - 9.81 / length * np.sin(y[0]) - drive.evaluate(t)[2, 0] / length * np.cos(y[0])]

    np.testing.assert_allclose(found, reference(slopes, [0.2, -0.5])[0], atol=1e-8)


def test_participation_scales_what_the_base_does() -> None:
    drive = Swing()
    found = simulate("base_excited", LINEAR, {"alpha": 9.0, "xi": 0.3, "p": -2.5}, drive)
    expected = reference(lambda t, y: [y[1], -0.3 * y[1] - 9.0 * y[0] + 2.5 * drive.evaluate(t)[2, 0]], [0.0, 0.0])
    np.testing.assert_allclose(found, expected[0], atol=1e-8)


# A controller.


@pytest.mark.parametrize("limit", [0.8, 1e6])
def test_a_servo_follows_its_reference_as_far_as_its_command_reaches(limit: float) -> None:
    drive = Swing()
    values = {"g": 3.0, "k_p": 4.0, "k_v": 0.9, "c_max": limit, "xi": 0.6, "f_c": 0.2, "v_c": 0.05}
    found = simulate("servo", ("viscous_damping", "coulomb_friction"), values, drive, (0.1, 0.0))
    cut = []

    def slopes(t: float, y: NDArray) -> list[float]:
        command = 0.9 * (4.0 * (drive.evaluate(t)[0, 0] - y[0]) - y[1])
        cut.append(abs(command) > limit)
        return [y[1], 3.0 * np.clip(command, -limit, limit) - 0.6 * y[1] - 0.2 * y[1] / np.hypot(y[1], 0.05)]

    np.testing.assert_allclose(found, reference(slopes, [0.1, 0.0])[0], atol=1e-5)
    assert any(cut) == (limit < 1)


# A fall.


def test_a_fall_with_quadratic_drag_approaches_its_terminal_speed() -> None:
    g, drag = 9.81, 0.8
    terminal = np.sqrt(g / drag)
    found = simulate("falling_body", ("quadratic_drag",), {"g_0": g, "c_2": drag}, None, (20.0, 0.0))
    np.testing.assert_allclose(found, 20.0 - terminal**2 / g * np.log(np.cosh(g * TIME / terminal)), atol=1e-7)


def test_a_throw_with_linear_drag() -> None:
    g, xi, speed = 9.81, 0.7, 6.0
    found = simulate("falling_body", ("viscous_damping",), {"g_0": g, "xi": xi}, None, (2.0, speed))
    expected = 2.0 - g / xi * TIME + (speed + g / xi) * (1 - np.exp(-xi * TIME)) / xi
    np.testing.assert_allclose(found, expected, atol=1e-8)


# An acceleration.


def _kinked(effect: str, values: dict[str, float], drive: Swing) -> NDArray[np.bool_]:
    """Return where the input passes a bend of what the drive makes of it, within the reach of the differences."""
    force = np.abs(drive.evaluate(TIME)[0])
    units = {p.name: p.unit for p in get_effect(effect).parameters()}
    bends = [values[n] if unit == "u" else 1 / values[n] for n, unit in units.items() if unit in ("u", "u^-1")]
    passed = [np.diff(force > bend, append=force[-1] > bend) for bend in bends]
    near = np.convolve(np.any(passed, axis=0), np.ones(7), mode="same") > 0 if passed else np.zeros(TIME.size, bool)
    return near[2:-2]


@pytest.mark.parametrize("effect", eventual_candidates(Model("accelerometer", ())))
def test_an_accelerometer_reads_the_second_derivative(effect: str) -> None:
    drive, start = Swing(), (0.4, -0.3)
    model = Model("accelerometer", tuple(dict.fromkeys((*LINEAR, effect))))
    values = some_values(model)
    if "z_t" in values:
        # At the width of its prior a zero drifts too little to be seen in so short a time.
        values["z_t"] = 2e-3
    found = simulate("accelerometer", model.effects, values, drive, start)
    sensor = get_effect(effect)
    moving = model.without([effect]) if isinstance(sensor, Sensor) else model
    felt = {n: values[n] for n in moving.parameters}
    # Beyond both ends, for the derivatives; the motion is the same one.
    path = simulate("oscillator", moving.effects, felt, drive, start)
    step = TIME[1]
    second = (-path[:-4] + 16 * path[1:-3] - 30 * path[2:-2] + 16 * path[3:-1] - path[4:]) / (12 * step**2)
    inner = TIME[2:-2]
    if isinstance(sensor, Sensor):
        known = {sp.Symbol(n, real=True): v for n, v in values.items()}
        time, read = sp.symbols("t read", real=True)
        late = sp.lambdify(time, sp.sympify(sensor.lateness()).subs(known))(inner) + 0 * inner
        law = sp.lambdify([read, time], sp.sympify(sensor.oscillator_reading(read)).subs(known))
        expected, seen = law(np.interp(inner - late, inner, second), inner), inner > inner[0] + late
        # Straight lines between samples.
        tolerance = 2e-3 if late.any() else 2e-5
    else:
        # Dry friction turns with the rate within a sample.
        rate = np.gradient(path, step)[2:-2]
        expected, seen, tolerance = second, (np.abs(rate) > 0.1) & ~_kinked(effect, values, drive), 4e-5
    assert seen.mean() > 0.8
    np.testing.assert_allclose(found[2:-2][seen], expected[seen], atol=tolerance)
    if effect not in LINEAR:
        bare = simulate(
            "accelerometer", LINEAR, {n: values[n] for n in Model("accelerometer", LINEAR).parameters}, drive, start
        )
        assert np.abs(bare - found).max() > 100 * tolerance


# A force.


@dataclass(frozen=True)
class Recorded:
    """A motion that an oscillator made, as a drive."""

    path: OdeSolution
    acceleration: object
    kinks: NDArray = field(default_factory=lambda: np.empty(0))

    def evaluate(self, time, side="right"):
        time = np.atleast_1d(time)
        states = self.path(time)
        return np.array(
            [states[0], states[1], [self.acceleration(t, y)[1] for t, y in zip(time, states.T, strict=True)]]
        )


@pytest.mark.parametrize("effect", candidates(Model("inverse_dynamics", ())))
def test_the_force_of_an_oscillators_motion_is_its_input(effect: str) -> None:
    drive = Swing()
    model = Model("oscillator", tuple(dict.fromkeys((*LINEAR, effect))))
    values = some_values(model)
    program = build_program(model.base, model.effects)
    derivative = numpy_derivative(program)
    numbers = [values[n] for n in program.parameters]

    def slopes(t: float, y: NDArray) -> NDArray:
        return np.array(derivative(t, drive.evaluate(t)[:, 0], y, numbers), float)

    start = [0.5, -0.2] + [0.0] * (len(program.states) - 2)
    path = solve_ivp(slopes, TIME[[0, -1]], start, "DOP853", dense_output=True, rtol=1e-10, atol=1e-11).sol
    inertia = 2.5
    held = {**{n: v for n, v in values.items() if n != "g"}, "m": inertia, "m_0": inertia}
    found = simulate("inverse_dynamics", model.effects, held, Recorded(path, slopes))
    expected = inertia * values["g"] * drive.evaluate(TIME)[0]
    np.testing.assert_allclose(found, expected, atol=1e-5)
    without = {n: v for n, v in held.items() if n in Model("inverse_dynamics", LINEAR).parameters}
    if effect not in LINEAR:
        assert np.abs(simulate("inverse_dynamics", LINEAR, without, Recorded(path, slopes)) - expected).max() > 1e-3


# Two modes.


@pytest.mark.parametrize("base", ["oscillator", "accelerometer", "base_excited"])
def test_two_modes_are_a_sum_of_two_transfer_functions(base: str) -> None:
    edges = np.array([0.0, 0.5, 1.2, 4.0])
    levels = np.array([1.0, -2.0, 0.5])
    # A force that is held, or a base under accelerations that are.
    pieces, angle, rate = [], 0.0, 0.0
    for level, length in zip(levels, np.diff(edges), strict=True):
        pieces.append([level / 2, rate, angle])
        angle, rate = angle + rate * length + level * length**2 / 2, rate + level * length
    moves = base == "base_excited"
    drive = Drive(edges, np.array(pieces).T if moves else levels[None], edges[1:-1])
    effects = (*LINEAR, "second_mode")
    driven = {"p": -1.3} if moves else {"g": 1.3}
    found = simulate(base, effects, {"alpha": 9.0, "xi": 0.3, **driven, **MODE}, drive)
    held = levels[np.clip(np.searchsorted(edges, TIME + 1e-9, side="right") - 1, 0, 2)]
    seen = [1.3, 0.0, 0.0] if base == "accelerometer" else [1.3]
    first, second = [1.0, 0.3, 9.0], [1.0, 2 * 0.03 * 11.0, 121.0]
    expected = np.zeros_like(TIME)
    for size, modal in ((1.0, first), (MODE["g_2"], second)):
        _, answer, _ = lsim(TransferFunction(size * np.array(seen), modal), held, TIME, interp=False)
        expected += answer
    np.testing.assert_allclose(found, expected, atol=2e-5)


def test_a_mode_starts_at_rest_and_does_not_move_the_first() -> None:
    free = simulate(
        "oscillator", (*LINEAR, "second_mode"), {"alpha": 9.0, "xi": 0.3, "g": 1.3, **MODE}, None, (0.5, 0.0)
    )
    np.testing.assert_array_equal(
        free, simulate("oscillator", LINEAR, {"alpha": 9.0, "xi": 0.3, "g": 1.3}, None, (0.5, 0.0))
    )


# The equations as they are written.


def test_without_an_input_the_equation_has_no_drive() -> None:
    free = Model("oscillator", (*LINEAR, "second_mode"), {"g": 0.0})
    assert equation_of_motion(free).rhs == 0
    assert not any(slope.has(sp.Symbol("u", real=True)) for _, slope in equation_terms(free).memory)


def test_the_equation_of_each_base() -> None:
    written = {base: str(equation_of_motion(Model(base, LINEAR))) for base in ON_A_LINE}
    left = "Eq(alpha*q + q'*xi + q'', {})"
    assert written["oscillator"] == written["accelerometer"] == left.format("g*u")
    assert written["base_excited"] == left.format("-p*u''")
    assert written["moving_pivot"] == left.format("-p*u''*cos(q)")
    assert written["falling_body"] == left.format("-g_0")
    assert written["inverse_dynamics"] == "Eq(alpha*u + m*u''/m_0 + u'*xi, F/m_0)"
    command = equation_terms(Model("servo", LINEAR)).drive
    q, rate, u = sp.symbols("q q' u", real=True)
    numbers = {"g": 2.0, "k_p": 3.0, "k_v": 0.5, "c_max": 0.4}
    at = {**{sp.Symbol(n, real=True): v for n, v in numbers.items()}, q: 0.1, u: 0.2, rate: -0.02}
    assert float(command.subs(at)) == pytest.approx(2 * 0.5 * (3 * 0.1 + 0.02))
    assert float(command.subs({**at, u: -1.0})) == pytest.approx(2 * -0.4)


@pytest.mark.parametrize(
    ("base", "read", "pushed"),
    [
        ("oscillator", "q + z_2_0", r"g g_{2} u"),
        ("accelerometer", "q'' + z_2_0''", r"g g_{2} u"),
        ("base_excited", "q + z_2_0", r"- g_{2} p \ddot{u}"),
    ],
)
def test_a_mode_is_written_with_its_states_and_its_part_in_the_reading(base: str, read: str, pushed: str) -> None:
    model = Model(base, (*LINEAR, "second_mode", "position_scale"))
    values = {**some_values(model), **MODE}
    equation = json.loads(to_json(model, values))["equation"]
    assert f"output = {read}" in equation["text"]
    assert equation["text"][1] == "z_2_0' = zd_2_0"
    text = to_latex(model)
    assert rf"\ddot{{z_{{2}}}} = {pushed}" in text
    shown = r"\ddot{q} + \ddot{z_{2}}" if base == "accelerometer" else "q + z_{2}"
    assert rf"\left({shown}\right) \left(s + 1\right)" in text
    (mode, rate), found = (e.lhs for e in to_sympy(model).memory), to_sympy(model)
    assert {mode.name, rate.name} == {"z_2_0'", "zd_2_0'"}
    assert sp.Symbol("z_2_0", real=True) in found.reading[0].free_symbols
    words = [line.words for line in model_formulas({"base": base, "effects": model.effects}, "oscillator")]
    assert words == ["Equation of motion", get_effect("second_mode").title(), "What the instrument reads"]


def test_only_what_the_input_pushes_has_another_mode() -> None:
    offered = {base for base in ON_A_LINE if any(isinstance(get_effect(e), Mode) for e in candidates(Model(base, ())))}
    assert offered == {"oscillator", "accelerometer", "base_excited"}
