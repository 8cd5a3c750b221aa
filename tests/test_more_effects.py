"""Errors of input and clock, friction, gravity, the radius and a periodic force, each against a law of its own."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp
from scipy.special import ellipk

from discovery.declarations.effect import ARM, OSCILLATOR
from discovery.declarations.registry import catalogue, get_effect
from discovery.declarations.symbols import v2
from discovery.equations.lacking import candidates
from discovery.equations.model import Model
from discovery.estimation.declared import declared_model
from discovery.export import to_numpy
from discovery.foundation.errors import InputError
from discovery.recordings.drive import Drive
from discovery.recordings.experiment import Experiment
from discovery.recordings.recording import Recording
from discovery.rigs.rig import Columns, InputColumn, OutputColumn, Rig, TimeColumn
from discovery.simulation.grid import DriveLike
from discovery.simulation.simulate import Simulator
from discovery.testing.states import every_effect

LINEAR = ("viscous_damping", "linear_stiffness")
TIME = np.linspace(0.0, 6.0, 601)
ARM_VALUES = {"xi": 0.05, "alpha": 8.8, "length": 1.0}


@dataclass(frozen=True)
class Swing:
    """A hub that swings smoothly."""

    amplitude: float = 0.5
    rate: float = 1.7
    kinks: np.ndarray = field(default_factory=lambda: np.empty(0))

    def evaluate(self, time, side="right"):
        phase = self.rate * np.atleast_1d(time)
        return self.amplitude * np.array([np.sin(phase), self.rate * np.cos(phase), -(self.rate**2) * np.sin(phase)])


@dataclass(frozen=True)
class Changed:
    """A hub whose angle is a function of another one's; f returns it with two derivatives."""

    drive: DriveLike
    f: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray]]
    kinks: np.ndarray = field(default_factory=lambda: np.empty(0))

    def evaluate(self, time, side="right"):
        angle, rate, change = self.drive.evaluate(time, side)
        value, first, second = self.f(angle)
        return np.array([value, first * rate, first * change + second * rate**2])


def simulate(
    effects: tuple[str, ...],
    values: Mapping[str, float],
    *,
    base: str = "constant_radius",
    drive: DriveLike | None = None,
    time: np.ndarray = TIME,
    start: tuple[float, float] = (0.2, 0.0),
    step: float = 0.005,
) -> np.ndarray:
    """Return the reading (m, r) of a model from the kernel of all effects; what is not named is at its default."""
    if drive is None and base == "constant_radius":
        drive = Swing()
    sim = Simulator(base, every_effect(base), time, drive, step=step)
    declared = Model(base, every_effect(base)).parameters
    assert values.keys() <= set(Model(base, effects).parameters)
    numbers = [[values.get(n, declared[n].default)] for n in sim.names]
    return sim(np.array(numbers), np.array([start[0]]), np.array([start[1]]))[:, :, 0]


def reference(slopes: Callable[[float, np.ndarray], list[float]], start: list[float]) -> np.ndarray:
    """Return the states (n, m) of an equation written once more, by an adaptive method of order eight."""
    return solve_ivp(slopes, TIME[[0, -1]], start, "DOP853", TIME, rtol=1e-11, atol=1e-12).y


# What the hub really does.

OF_THE_HUB = {
    "encoder_ripple": (
        {"r_s": 0.03, "r_c": -0.02, "N_e": 7.0},
        lambda a: (
            a + 0.03 * np.sin(7 * a) - 0.02 * (np.cos(7 * a) - 1),
            1 + 7 * (0.03 * np.cos(7 * a) + 0.02 * np.sin(7 * a)),
            49 * (-0.03 * np.sin(7 * a) + 0.02 * np.cos(7 * a)),
        ),
    ),
    "input_gain": ({"k_h": 0.04}, lambda a: (1.04 * a, 1.04 + 0 * a, 0 * a)),
    "input_offset": ({"theta_h": 0.06}, lambda a: (a + 0.06, 1 + 0 * a, 0 * a)),
}


@pytest.mark.parametrize("base", ["constant_radius", "elastica_1"])
@pytest.mark.parametrize("effect", OF_THE_HUB)
def test_a_wrong_input_is_another_motion_of_the_hub(effect: str, base: str) -> None:
    values, law = OF_THE_HUB[effect]
    values = {**ARM_VALUES, **values, **({"mu": 0.2} if base == "elastica_1" else {})}
    without = {n: v for n, v in values.items() if n in Model(base, LINEAR).parameters}
    drive = Swing()
    moved = Changed(drive, law)
    found = simulate((*LINEAR, effect), values, base=base, drive=drive)
    # The starting deflection of constant_radius is told against the recorded angle.
    (first, speed, _), (angle, rate, _) = moved.evaluate(0.0)[:, 0], drive.evaluate(0.0)[:, 0]
    shift = (angle - first, rate - speed) if base == "constant_radius" else (0.0, 0.0)
    expected = simulate(LINEAR, without, base=base, drive=moved, start=(0.2 + shift[0], shift[1]))
    np.testing.assert_allclose(found, expected, atol=1e-9)
    assert np.abs(found - simulate(LINEAR, without, base=base, drive=drive)).max() > 0.01


def test_the_hubs_zero_is_the_cameras_unless_something_knows_a_direction() -> None:
    def readings(*effects: str, **values: float) -> tuple[np.ndarray, np.ndarray]:
        hub = simulate(
            (*LINEAR, *effects, "input_offset"), {**ARM_VALUES, **values, "theta_h": 0.05}, start=(0.25, 0.0)
        )
        camera = simulate((*LINEAR, *effects, "angle_offset"), {**ARM_VALUES, **values, "theta_0": 0.05})
        return hub, camera

    np.testing.assert_allclose(*readings(), atol=1e-12)
    hub, camera = readings("table_tilt", phi_x=0.02)
    assert np.abs(hub - camera).max() > 1e-3


# Friction.


def test_without_its_bump_stribeck_friction_is_coulombs() -> None:
    start = {"base": "oscillator", "start": (0.3, 0.0)}
    dry = simulate((*LINEAR, "coulomb_friction"), {"alpha": 9.0, "f_c": 0.1, "v_c": 2e-3}, **start)
    same = simulate((*LINEAR, "stribeck_friction"), {"alpha": 9.0, "f_k": 0.1, "v_e": 2e-3, "v_s": 0.1}, **start)
    np.testing.assert_allclose(same, dry, atol=1e-12)


def test_stribeck_friction_falls_from_its_creep_value_to_its_sliding_value() -> None:
    v = sp.Symbol("v", positive=True)
    dissipation = get_effect("stribeck_friction").expression().subs(v2, v**2)
    numbers = {"f_k": 0.3, "f_b": 0.5, "v_s": 0.1, "v_e": 1e-5}
    known = {symbol: numbers[symbol.name] for symbol in dissipation.free_symbols - {v}}
    force = sp.lambdify(v, sp.diff(dissipation, v).subs(known))
    speeds = np.array([1e-3, 0.05, 0.1, 0.2, 1.0])
    np.testing.assert_allclose(force(speeds), 0.3 + 0.5 * np.exp(-((speeds / 0.1) ** 2)), rtol=1e-4)
    assert force(1e-8) < 1e-3


def test_asymmetric_damping_shrinks_forward_and_backward_half_swings_differently() -> None:
    """Each half swing of a linear oscillator decays by exp(-pi c / sqrt(4 alpha - c^2)), with its own c."""
    alpha, xi, a_v = 9.0, 0.3, 0.4
    found = simulate(
        (*LINEAR, "asymmetric_viscous_damping"), {"alpha": alpha, "xi": xi, "a_v": a_v},
        base="oscillator", time=np.linspace(0, 6, 6001), start=(-0.4, 0.0),
    )[:, 0]  # fmt: skip
    inner = found[1:-1]
    extremes = inner[((inner > found[:-2]) & (inner > found[2:])) | ((inner < found[:-2]) & (inner < found[2:]))]
    amplitudes = np.abs(np.concatenate([[found[0]], extremes]))
    coefficients = xi * np.array([1 + a_v, 1 - a_v] * 3)[: amplitudes.size - 1]
    expected = np.exp(-np.pi * coefficients / np.sqrt(4 * alpha - coefficients**2))
    assert amplitudes.size > 4
    np.testing.assert_allclose(amplitudes[1:] / amplitudes[:-1], expected, rtol=1e-5)


def test_asymmetric_damping_feeds_no_motion_at_its_bounds() -> None:
    alpha, xi, bounds = 9.0, 0.3, get_effect("asymmetric_viscous_damping").parameters()[0].bounds
    for a_v in bounds:
        found = simulate(
            (*LINEAR, "asymmetric_viscous_damping"), {"alpha": alpha, "xi": xi, "a_v": a_v},
            base="oscillator", time=np.linspace(0, 6, 6001), start=(-0.4, 0.0),
        )[:, 0]  # fmt: skip
        energy = 0.5 * np.gradient(found, 1e-3) ** 2 + 0.5 * alpha * found**2
        # Rates by differences, of readings between steps.
        assert np.diff(energy[1:-1]).max() < 1e-7
        assert energy[-2] < 0.5 * energy[1]


# Gravity.


@pytest.mark.parametrize("amplitude", [0.2, 1.5, 3.0])
def test_a_pendulum_has_the_period_of_the_elliptic_integral(amplitude: float) -> None:
    g_c, g_s = 9.0 * np.cos(0.3), 9.0 * np.sin(0.3)
    period = 4 / 3.0 * ellipk(np.sin(amplitude / 2) ** 2)
    # It hangs at 0.3 rad.
    found = simulate(
        ("gravity_torque",), {"g_c": g_c, "g_s": g_s}, base="oscillator",
        time=np.array([0.0, period / 4, period / 2, period]), start=(0.3 + amplitude, 0.0), step=0.002,
    )[:, 0]  # fmt: skip
    np.testing.assert_allclose(found - 0.3, [amplitude, 0.0, -amplitude, amplitude], atol=1e-8)


def _oscillator(unit: str) -> Experiment:
    time = np.linspace(0.0, 1.0, 20)
    columns = Columns(TimeColumn(), InputColumn("u", "V", "spline"), OutputColumn("y", unit))
    rig = Rig("pendulum", OSCILLATOR, None, columns=columns, declared=("viscous_damping", "gravity_torque"))
    drive = Drive(np.array([0.0, 1.0]), np.array([[0.0], [0.0], [0.0]]), np.empty(0))
    output = np.zeros((20, 1))
    return Experiment(Recording("r", time, time, output, ("output",), (unit,), np.ones(1), "", ""), drive, rig)


def test_gravity_asks_for_an_angle() -> None:
    model = Model("oscillator", LINEAR)
    assert "gravity_torque" in candidates(model, "rad")
    assert "gravity_torque" not in candidates(model, "V")
    assert set(candidates(model, "rad")) - set(candidates(model, "V")) == {"gravity_torque"}
    assert "gravity_torque" not in candidates(Model("elastica", LINEAR))
    assert declared_model(_oscillator("rad")).effects == ("viscous_damping", "gravity_torque")
    with pytest.raises(InputError, match=r"gravity_torque needs an angle in rad, but the coordinate is in V"):
        declared_model(_oscillator("V"))


# The clock.


def test_a_wrong_clock_reads_the_motion_at_other_times() -> None:
    drift, height, angular, phase = 0.01, 0.05, 9.0, 2.0
    x = angular * TIME - phase
    # The fundamental and the overtones of a sawtooth between 0 and 1, a hundredth less each.
    k = np.arange(1, 3000)[:, None]
    nearest = np.sum(0.99**k / k**2) / np.sum(0.99 ** (2 * k) / k**2)
    sawtooth = 0.5 - nearest * np.sum(0.99**k * np.sin(k * x) / k, axis=0) / np.pi
    late = drift * TIME + height * sawtooth
    values = {"alpha": 9.0, "xi": 0.1}
    clock = {"d_t": drift, "j_t": height, "Omega_j": angular, "phi_j": phase}
    found = simulate((*LINEAR, "time_base_error"), {**values, **clock}, base="oscillator")
    decay, rate = 0.05, np.sqrt(9.0 - 0.05**2)
    at = TIME - late
    expected = 0.2 * np.exp(-decay * at) * (np.cos(rate * at) + decay / rate * np.sin(rate * at))
    # Before the first sample, the state is continued by a parabola.
    np.testing.assert_allclose(found[at >= 0, 0], expected[at >= 0], atol=1e-8)
    assert np.ptp(sawtooth) > 0.8
    assert np.abs(found[:, 0] - simulate(LINEAR, values, base="oscillator")[:, 0]).max() > 0.02


# The radius.


@pytest.mark.parametrize("tau", [0.0, 0.0137])
def test_changes_of_the_radius_add_up(tau: float) -> None:
    effects = ("radius_law", "radius_quartic", "radius_tension")
    values = {**ARM_VALUES, "gamma": 0.45, "r_4": 0.1, "r_T": 0.4, "tau": tau}
    drive, start = Swing(), (0.5, -0.4)
    found = simulate((*LINEAR, *effects, "sensor_delay"), values, start=start)

    def slopes(t: float, y: np.ndarray) -> list[float]:
        return [y[1], -0.05 * y[1] - 8.8 * (y[0] - drive.evaluate(t)[0, 0])]

    path = solve_ivp(slopes, (0.0, 6.0), [0.5, 0.85 - 0.4], "DOP853", dense_output=True, rtol=1e-11, atol=1e-12).sol
    seen = tau <= TIME
    late = TIME[seen] - tau
    theta, omega = path(late)
    delta = theta - drive.evaluate(late)[0]
    rho = np.cos(0.45 * delta) + 0.1 * delta**4 + 0.4 * delta**2 * omega**2 / 8.8
    np.testing.assert_allclose(np.hypot(*found[seen].T), rho, atol=1e-8)
    assert np.abs(rho - np.cos(0.45 * delta)).max() > 0.01


@pytest.mark.parametrize("sensors", [pytest.param((), marks=pytest.mark.slow), ("sensor_delay",)])
def test_an_exported_radius_knows_its_rates(sensors: tuple[str, ...]) -> None:
    model = Model("constant_radius", (*LINEAR, "radius_law", "radius_tension", *sensors))
    values = {**ARM_VALUES, "gamma": 0.45, "r_T": 0.4, **dict.fromkeys(("tau",) * len(sensors), 0.0137)}
    namespace: dict = {}
    exec(to_numpy(model, values), namespace)
    told = namespace["simulate"](TIME, *Swing().evaluate(TIME), 0.5, -0.4, step=0.005)
    expected = simulate(model.effects, values, start=(0.5, -0.4))
    # Between samples, the export interpolates the motion of the hub.
    np.testing.assert_allclose(told.T, expected, atol=1e-7)


def test_the_radius_of_the_exact_arm_has_these_terms_already() -> None:
    for base in ("reduced", "elastica", "elastica_2", "elastica_1"):
        assert not {"radius_quartic", "radius_tension"} & set(candidates(Model(base, LINEAR)))
    assert {"radius_quartic", "radius_tension"} <= set(candidates(Model("constant_radius", LINEAR)))


@pytest.mark.parametrize("clamp", ["base_compliance", "base_backlash", "base_hysteresis"])
def test_a_clamp_imitates_a_rod_that_is_not_uniform(clamp):
    assert get_effect(clamp).imitates({}, 0.1, 10.0, 0.01, 1.0, 1.0) is True


# A periodic force.


@pytest.mark.parametrize(("zeta_2", "duration", "alike"), [(0.3, 7.0, False), (0.3, 6.0, True), (1.1, 7.0, True)])
def test_a_mode_that_does_not_vibrate_imitates_what_drifts(zeta_2, duration, alike):
    values = {"g_2": 1.0, "omega_2": 1.0, "zeta_2": zeta_2}
    assert get_effect("second_mode").imitates(values, 0.1, duration, 0.01, 1.0, 1.0) is alike


def test_a_force_that_hardly_repeats_imitates_others_and_one_that_never_does_could_be_anything() -> None:
    effect = get_effect("periodic_disturbance")
    found = [effect.imitates({"Omega": 2.0}, 0.1, cycles * np.pi, 0.01, 1.0, 1.0) for cycles in (0.9, 1.1, 2.9, 3.1)]
    assert found == [np.inf, 1.0, 1.0, 0.0]


def test_a_force_that_repeats_within_two_readings_could_be_anything() -> None:
    effect = get_effect("periodic_disturbance")
    found = [effect.imitates({"Omega": share * np.pi / 0.05}, 1.0, 100.0, 0.05, 1.0, 1.0) for share in (0.9, 1.1)]
    assert found == [0.0, np.inf]


def test_a_periodic_force_keeps_its_direction_while_the_arm_turns() -> None:
    push = {"a_s": 0.3, "a_c": -0.1, "b_s": 0.2, "b_c": 0.4, "Omega": 4.0}
    drive = Swing()
    found = simulate((*LINEAR, "periodic_disturbance"), {**ARM_VALUES, **push})

    def slopes(t: float, y: np.ndarray) -> list[float]:
        along_x, along_y = 0.3 * np.sin(4 * t) - 0.1 * np.cos(4 * t), 0.2 * np.sin(4 * t) + 0.4 * np.cos(4 * t)
        across = along_y * np.cos(y[0]) - along_x * np.sin(y[0])
        return [y[1], -0.05 * y[1] - 8.8 * (y[0] - drive.evaluate(t)[0, 0]) + across]

    theta = reference(slopes, [0.2, 0.85])[0]
    np.testing.assert_allclose(found, np.array([np.cos(theta), np.sin(theta)]).T, atol=1e-8)


def test_a_periodic_force_across_the_arm_turns_with_it() -> None:
    drive = Swing()
    push = {"n_s": 0.3, "n_c": -0.1, "Omega": 4.0}
    found = simulate((*LINEAR, "periodic_disturbance"), {**ARM_VALUES, **push})

    def slopes(t: float, y: np.ndarray) -> list[float]:
        across = 0.3 * np.sin(4 * t) - 0.1 * np.cos(4 * t)
        return [y[1], -0.05 * y[1] - 8.8 * (y[0] - drive.evaluate(t)[0, 0]) + across]

    theta = reference(slopes, [0.2, 0.85])[0]
    np.testing.assert_allclose(found, np.array([np.cos(theta), np.sin(theta)]).T, atol=1e-8)


def test_an_oscillator_has_one_direction() -> None:
    effect = get_effect("periodic_disturbance")
    assert [p.name for p in effect.fitted(OSCILLATOR)] == ["a_s", "a_c", "Omega"]
    assert [p.name for p in effect.fitted(ARM)] == ["a_s", "a_c", "b_s", "b_c", "n_s", "n_c", "Omega"]
    assert Model("oscillator", ("periodic_disturbance",)).free == ("g", "a_s", "a_c", "Omega")
    across = {"alpha": 9.0, "b_s": 0.5, "b_c": 0.5, "n_s": 0.5, "n_c": 0.5}
    still = simulate((*LINEAR, "periodic_disturbance"), across, base="oscillator", start=(0.0, 0.0))
    assert not still.any()


@pytest.mark.parametrize("system", [ARM, OSCILLATOR])
def test_what_a_fit_estimates_is_what_a_model_leaves_free(system: str) -> None:
    base = "constant_radius" if system == ARM else "oscillator"
    for name, effect in catalogue().items():
        if system in effect.systems:
            free = set(Model(base, (name,)).free)
            assert {p.name for p in effect.fitted(system)} == free - {"g"}


def test_what_nothing_ties_lacks_no_law_of_a_place_of_rest_before_something_ties_it() -> None:
    loose, tied = Model("oscillator", ("viscous_damping",)), Model("oscillator", ("viscous_damping", "gravity_torque"))
    anchored = {"cubic_stiffness", "hysteresis", "amplitude_dependent_damping", "viscoelastic_relaxation"}
    offered = {*candidates(loose, declared=loose.effects)}
    assert offered >= {"linear_stiffness", "gravity_torque", "cogging", "second_mode", "coulomb_friction"}
    assert not offered & anchored
    assert {*candidates(tied, declared=loose.effects)} >= anchored
