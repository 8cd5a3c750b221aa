from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq, fsolve

from discovery.effects.table_tilt import G
from discovery.equations.model import Model
from discovery.equations.program import build_program
from discovery.estimation.bench import Bench
from discovery.estimation.equilibrium import equilibrium
from discovery.estimation.fit import Fit, fit
from discovery.estimation.held_states import held_out
from discovery.estimation.natural_units import NaturalUnits
from discovery.estimation.predict import predict
from discovery.estimation.problem import Problem
from discovery.foundation.errors import ComputationError
from discovery.recordings.drive import Drive
from discovery.recordings.experiment import Experiment
from discovery.recordings.recording import Recording
from discovery.rigs.rig import Columns, ForceView, InputColumn, OutputColumn, Quantity, Rig, TimeColumn
from discovery.simulation.kernel.compile import numpy_derivative
from discovery.testing.states import every_effect

UNITS = NaturalUnits(1 / 3, 1.0, 1.0)
LINEAR = ("viscous_damping", "linear_stiffness")
DECLARED = (*LINEAR, "cubic_stiffness", "radius_law")
PAPER = {"xi": 0.0458, "alpha": 8.7907, "beta": 0.5139, "gamma": 0.4462}
NOISE = 3e-4
TIME = np.linspace(0.0, 8.0, 401)
RIG = Rig("arm", length=Quantity(1.0, 0.0))
#: A move of 0.9 rad by two constant accelerations, then rest.
MOVE = Drive(
    np.array([0.0, 0.5, 1.4, 2.3, 8.0]),
    np.array([[0.0, 0.5 / 0.9, -0.5 / 0.9, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.45, 0.9]]),
    np.array([0.5, 1.4, 2.3]),
)


def arm(output: np.ndarray, name: str = "r", time: np.ndarray = TIME, drive: Drive = MOVE) -> Experiment:
    recording = Recording(
        name, time, drive.evaluate(time)[0], output, ("tip_x", "tip_y"), ("m", "m"), np.full(2, NOISE), "", ""
    )
    return Experiment(recording, drive, RIG)


def bench(experiments: Sequence[Experiment]) -> Bench:
    return Bench("constant_radius", every_effect("constant_radius"), experiments, 0.02)


def simulated(
    values: dict[str, float],
    initial: tuple[float, float],
    seed: int | None = 0,
    name: str = "r",
    time: np.ndarray = TIME,
) -> Experiment:
    empty = arm(np.zeros((time.size, 2)), name, time)
    b = bench([empty])
    defaults = Model("constant_radius", b.effects).parameters
    every = {n: p.default for n, p in defaults.items()} | {"length": 1.0} | values
    (clean,) = b.predict(np.array([[every[n]] for n in b.names]), np.array(initial).reshape(1, 2, 1))
    noise = 0.0 if seed is None else NOISE * np.random.default_rng(seed).standard_normal((time.size, 2))
    return arm(clean[:, :, 0] + noise, name, time)


# Rest.


@pytest.mark.parametrize("motor", [0.0, 1.0, -2.2])
def test_a_tilted_table_against_a_linear_spring(motor: float) -> None:
    model = Model("constant_radius", (*LINEAR, "table_tilt"), {"length": 0.8})
    values = {"xi": 0.05, "alpha": 8.8, "phi_x": 0.01, "phi_y": -0.02}
    found = equilibrium(model, values, UNITS, (motor, 0.0, 0.0))

    # Per unit of inertia m l^2 the torque of gravity is g / l times the slope across the arm.
    def torque(delta: float) -> float:
        angle = motor + delta
        return -8.8 * delta + G / 0.8 * (-0.01 * np.sin(angle) - 0.02 * np.cos(angle))

    assert found == pytest.approx(brentq(torque, -1, 1), abs=1e-10)
    assert abs(found) > 5e-3


def test_rates_of_the_motor_and_forces_in_time_do_not_move_the_rest() -> None:
    model = Model("constant_radius", (*LINEAR, "equilibrium_offset", "periodic_disturbance"), {"length": 1.0})
    values = {"xi": 0.05, "alpha": 8.8, "delta_0": 0.07, "a_s": 0.5, "a_c": 0.5, "Omega": 2.0}
    assert equilibrium(model, values, UNITS, (0.3, 1.0, 2.0)) == pytest.approx(0.07, abs=1e-10)
    # Held as it is at that time, the force pushes.
    held = equilibrium(model, values, UNITS, (0.3, 1.0, 2.0), time=0.4)
    assert abs(held - 0.07) > 0.01


def test_an_instrument_that_is_off_does_not_move_the_rest() -> None:
    model = Model("constant_radius", (*LINEAR, "angle_offset", "sensor_delay"), {"length": 1.0})
    values = {"xi": 0.05, "alpha": 8.8, "theta_0": 0.1, "tau": 0.01}
    assert equilibrium(model, values, UNITS, (0.0, 0.0, 0.0)) == pytest.approx(0.0, abs=1e-10)


def test_an_oscillator_rests_where_input_and_hard_spring_balance() -> None:
    model = Model("oscillator", (*LINEAR, "cubic_stiffness"))
    values = {"g": 2.0, "xi": 0.1, "alpha": 4.0, "beta": 3.0}
    found = equilibrium(model, values, NaturalUnits(0.5, 0.5, 1.0), (1.5, 0.0, 0.0))
    assert 4 * found + 3 * found**3 == pytest.approx(3.0, abs=1e-9)


@pytest.mark.parametrize("tilt", [(-1.5e-3, 2e-3), (0.0, 0.02)])
@pytest.mark.parametrize("motor", [pytest.param(0.0, marks=pytest.mark.slow), 1.0])
@pytest.mark.parametrize(("base", "n"), [("elastica", 3), ("elastica_4", 4)])
def test_the_rod_bends_under_its_own_weight_too(base: str, n: int, motor: float, tilt: tuple[float, float]) -> None:
    effects = (*LINEAR, "table_tilt")
    model = Model(base, effects, {"length": 1.0, "mu": 0.2845, "tau_r": 0.0})
    values = {"xi": 0.0458, "alpha": 8.09, "phi_x": tilt[0], "phi_y": tilt[1]}
    found = equilibrium(model, values, UNITS, (motor, 0.0, 0.0))
    # All coordinates at rest, by another solver.
    program = build_program(base, effects)
    derivative, known = numpy_derivative(program), {**model.known, **values}
    parameters = [known[n] for n in program.parameters]
    still = [0.0] * n
    q = fsolve(
        lambda q: derivative(0.0, (motor, 0.0, 0.0), [*q, *still], parameters)[n : 2 * n], np.zeros(n), xtol=1e-13
    )
    import sympy as sp

    from discovery.declarations.symbols import theta_m

    x, y = sp.lambdify([*program.states[:n], theta_m], list(model.mechanics.reading(None)))(*q, motor)
    assert found == pytest.approx(np.arctan2(y, x) - motor, abs=1e-9)
    # Small bending: tip load and distributed load (1/3 and 1/8 of P l^3/EI) across the rod, 3 EI/l^3 = alpha m_eff.
    across = -tilt[0] * np.sin(motor) + tilt[1] * np.cos(motor)
    tip_share = 1 / (1 + 33 / 140 * 0.2845)
    small = G * across * tip_share * (1 + 3 / 8 * 0.2845) / 8.09
    assert found == pytest.approx(small, rel=5 * abs(tilt[1]) + 0.003)


def test_a_rest_is_one_where_rounding_keeps_the_solver_from_its_last_digits() -> None:
    model = Model("elastica_4", (*LINEAR, "table_tilt"), {"length": 1.0, "mu": 0.28450735999667964, "tau_r": 3.5e-7})
    values = {
        "xi": 0.045790626099172185,
        "alpha": 8.092666466599324,
        "phi_x": -0.0014804807553830943,
        "phi_y": 0.0020249217960886757,
    }
    here, beside = (equilibrium(model, values, UNITS, (motor, 0.0, 0.0)) for motor in (0.0, 1e-4))
    assert here == pytest.approx(beside, abs=1e-6)


def test_no_rest_is_said() -> None:
    model = Model("constant_radius", (*LINEAR, "equilibrium_offset"), {"length": 1.0})
    values = {"xi": 0.05, "alpha": 8.8, "delta_0": 5.0}
    with pytest.raises(ComputationError, match="no rest position"):
        equilibrium(model, values, UNITS, (0.0, 0.0, 0.0))


@pytest.mark.parametrize(
    ("base", "effects", "values", "drive"),
    [
        ("oscillator", ("viscous_damping",), {"g": 1.0, "xi": 0.2}, 0.0),
        ("oscillator", ("coulomb_friction",), {"g": 1.0, "f_c": 0.2}, 0.5),
        ("base_excited", ("viscous_damping",), {"p": 1.0, "xi": 0.2}, 0.5),
        ("falling_body", ("quadratic_drag",), {"c_2": 0.1}, 0.0),
    ],
)
def test_without_a_restoring_force_a_prediction_begins_at_zero(
    base: str, effects: tuple[str, ...], values: dict[str, float], drive: float
) -> None:
    assert equilibrium(Model(base, effects), values, UNITS, (drive,)) == 0.0


def test_a_servo_rests_at_its_reference_and_a_pendulum_hangs_on_its_moving_base() -> None:
    servo = {"g": 2.0, "k_p": 3.0, "k_v": 0.5, "xi": 0.1}
    assert equilibrium(Model("servo", ("viscous_damping",)), servo, UNITS, (0.4,)) == pytest.approx(0.4, abs=1e-10)
    hanging = equilibrium(Model("base_excited", ("gravity_torque",)), {"g_c": 9.0, "g_s": 0.0}, UNITS, (0.4,))
    assert hanging == pytest.approx(-0.4, abs=1e-10)


def test_a_mode_does_not_move_the_rest_of_the_coordinate() -> None:
    model = Model("oscillator", (*LINEAR, "second_mode"))
    values = {"g": 2.0, "xi": 0.1, "alpha": 4.0, "g_2": 0.5, "omega_2": 9.0, "zeta_2": 0.1}
    assert equilibrium(model, values, UNITS, (1.0,)) == pytest.approx(0.5, abs=1e-10)


def test_a_prescribed_motion_needs_no_initial_state() -> None:
    columns = Columns(TimeColumn(), InputColumn("q", "m", "spline"), OutputColumn("f", "N"))
    rig = Rig("d", "drive", columns=columns, view=ForceView(20.0, 10.0))
    polynomial = np.array([[0.02], [-0.3], [1.2], [0.1]])
    drive = Drive(TIME[[0, -1]], polynomial, np.empty(0))
    position, rate, change = drive.evaluate(TIME)
    noise = 1e-3 * np.random.default_rng(0).standard_normal(TIME.size)
    force = 4.0 * (change + 0.3 * rate) + noise

    def experiment(output: np.ndarray) -> Experiment:
        recording = Recording("d", TIME, position, output[:, None], ("output",), ("N",), np.array([1e-3]), "", "")
        return Experiment(recording, drive, rig)

    found = fit(Model("inverse_dynamics", ("viscous_damping",), {"m_0": 2.0}), [experiment(force)])
    assert found.values == {"m": pytest.approx(4.0, abs=0.01), "xi": pytest.approx(0.6, abs=0.01)}
    mean, sd = predict(found, experiment(np.zeros(TIME.size)))
    np.testing.assert_allclose(mean[20:-20, 0], (4.0 * (change + 0.3 * rate))[20:-20], atol=2e-3)
    assert (sd > 0).all()


@pytest.mark.slow
def test_a_rod_that_leans_on_its_play_rests_where_it_settles() -> None:
    # A bent rod at rest pushes on nothing: with play, too, its tip stays at the angle of the rest.
    effects = (*LINEAR, "equilibrium_offset", "base_backlash")
    model = Model("elastica", effects, {"length": 1.0, "mu": 0.2, "tau_r": 2e-4})
    values = {"xi": 0.03, "alpha": 8.8, "delta_0": -0.02, "w_p": 1e-4, "c_p": 0.03, "b_p": 0.02}
    for hub in (0.0, 1.2):
        assert equilibrium(model, values, UNITS, (hub, 0.0, 0.0)) == pytest.approx(-0.02, abs=2e-3)


# Prediction.


@pytest.fixture(scope="module")
def fitted() -> Fit:
    train = simulated(PAPER, (0.0, 0.0))
    model = Model("constant_radius", DECLARED, {"length": 1.0})
    start = {"xi": 0.04, "alpha": 8.7, "beta": 0.4, "gamma": 0.45}
    return fit(model, [train], start=start, bench=bench([train]), units=UNITS)


def at(fitted: Fit, **values: float) -> Fit:
    x = fitted.minimum.x.copy()
    x[[fitted.problem.free.index(name) for name in values]] = list(values.values())
    return replace(fitted, minimum=replace(fitted.minimum, x=x))


def later(name: str = "wanted") -> Experiment:
    """Another hold, longer and irregularly sampled."""
    time = np.sort(np.random.default_rng(1).uniform(0.0, 12.0, 200))
    return arm(np.full((200, 2), np.nan), name, time)


def test_a_prediction_starts_at_rest_and_says_what_the_fit_says(fitted: Fit) -> None:
    value, sd = predict(fitted, later())
    # The prediction chooses a step of its own: equal to the stated accuracy of both.
    np.testing.assert_allclose(value, fitted.predict([later()], np.zeros((1, 2)))[0], atol=2e-6)
    time = later().recording.time
    before = time < 0.5
    np.testing.assert_allclose(value[before], np.column_stack([np.ones(200), np.zeros(200)])[before], atol=1e-12)
    assert (sd[before] < 1e-9).all()
    assert sd[time > 6].max() > 1e-5


def test_a_prediction_from_a_given_state(fitted: Fit) -> None:
    value, _ = predict(fitted, later(), (0.2, -0.3))
    np.testing.assert_allclose(value, fitted.predict([later()], np.array([[0.2, -0.3]]))[0], atol=2e-6)


def test_the_deviations_are_those_of_a_sample_of_fits(fitted: Fit) -> None:
    _, sd = predict(fitted, later())
    names = fitted.problem.free
    m = len(names)
    rng = np.random.default_rng(0)
    draws = rng.multivariate_normal(fitted.minimum.x[:m], fitted.covariance[:m, :m], size=2000).T
    single = Problem(fitted.model, bench([later()]), UNITS, {})
    tips = single.bench.predict(*single.expand(np.concatenate([draws, np.zeros((2, 2000))])))[0]
    sampled = tips.std(axis=2)
    moving = sampled > 1e-7
    assert moving.sum() > 300
    # 2000 draws: 1.6 per cent, over several hundred readings.
    np.testing.assert_allclose(sd[moving], sampled[moving], rtol=0.1)
    assert np.median(sd[moving] / sampled[moving]) == pytest.approx(1.0, abs=0.03)


@pytest.mark.parametrize("held", [False, True])
def test_a_motion_under_a_force_in_time_begins_as_training_did(held: bool) -> None:
    model = Model("constant_radius", (*LINEAR, "periodic_disturbance"), {"length": 1.0})
    values = {"xi": 0.05, "alpha": 8.8, "b_c": 0.4, "Omega": 9.0}
    first = equilibrium(model, values, UNITS, (0.0,), time=0.0) if held else 0.0
    found = fit(model, (simulated(values, (first, 0.0)),), start=values)
    (x, y), *_ = predict(found, later())[0]
    assert np.arctan2(y, x) == pytest.approx(first, abs=0.015)
    assert abs(equilibrium(model, values, UNITS, (0.0,), time=0.0)) > 0.04


def test_deviations_are_told_where_the_motion_blows_up_beside_the_estimate(fitted: Fit) -> None:
    softer = fitted.problem.free.index("beta")
    widths = np.ones(len(fitted.covariance))
    widths[softer] = 60.0 / np.sqrt(fitted.covariance[softer, softer])
    unsure = replace(fitted, covariance=fitted.covariance * np.outer(widths, widths))
    with pytest.raises(ComputationError):
        predict(at(unsure, beta=-29.0), later(), (1.2, 0.0))
    found, sd = predict(unsure, later(), (1.2, 0.0))
    assert np.isfinite(found).all()
    assert np.isfinite(sd).all()
    assert sd.max() > 100 * predict(fitted, later(), (1.2, 0.0))[1].max()


def test_the_rest_moves_with_the_parameters() -> None:
    # At rest on a tilted table, the reading is as uncertain as the tilt over the stiffness.
    truth = {**PAPER, "phi_x": 0.0, "phi_y": 0.01}
    model = Model("constant_radius", (*DECLARED, "table_tilt"), {"length": 1.0})
    rest = equilibrium(model, truth, UNITS, (0.0, 0.0, 0.0))
    train = simulated(truth, (rest, 0.0))
    start = {**PAPER, "phi_x": 1e-3, "phi_y": 8e-3}
    found = fit(model, [train], start=start, bench=bench([train]), units=UNITS)
    value, sd = predict(found, later())
    first = int(np.argmin(later().recording.time))
    assert np.arctan2(value[first, 1], value[first, 0]) == pytest.approx(rest, abs=4 * sd[first, 1])
    k = found.problem.free.index("phi_y")
    expected = np.sqrt(found.covariance[k, k]) * G / PAPER["alpha"]
    assert sd[first, 1] == pytest.approx(expected, rel=0.1)


# Held-out recordings.


def test_held_out_recordings_get_their_initial_state_only() -> None:
    right, wrong = dict(PAPER), {**PAPER, "alpha": 8.9}
    clean = simulated(PAPER, (0.15, -0.2), seed=None, name="h")
    noisy = simulated(PAPER, (0.15, -0.2), seed=4, name="h")
    other = simulated(PAPER, (0.0, 0.3), seed=5, name="i")
    model = Model("constant_radius", DECLARED, {"length": 1.0})
    together = bench([noisy, other])
    good, bad = held_out([(model, right), (model, wrong)], together, UNITS)
    assert [p.shape for p in good] == [(401, 2), (401, 2)]
    # Two numbers from 802 readings.
    distance = np.abs(good[0] - clean.recording.output)
    assert distance.max() < NOISE
    # A wrong stiffness stays wrong: the phase runs away.
    residual = (bad[0] - noisy.recording.output) / NOISE
    assert np.mean(residual**2) > 25
    assert np.mean(((good[0] - noisy.recording.output) / NOISE) ** 2) == pytest.approx(1.0, abs=0.2)


def test_a_rival_beside_it_does_not_change_a_prediction() -> None:
    noisy = simulated(PAPER, (0.15, -0.2), seed=4, name="h")
    model = Model("constant_radius", DECLARED, {"length": 1.0})
    delayed = (model.with_effect("sensor_delay"), {**PAPER, "tau": 0.02})
    together = bench([noisy])
    (alone,) = held_out([(model, PAPER)], together, UNITS)
    both = held_out([(model, PAPER), delayed], together, UNITS)
    np.testing.assert_array_equal(alone[0], both[0][0])
    assert np.abs(both[1][0] - both[0][0]).max() > 1e-4


def test_the_instruments_effects_are_in_what_it_would_read() -> None:
    columns = Columns(TimeColumn(), InputColumn("u", "V", "spline"), OutputColumn("y", "V"))
    still = Drive(TIME[[0, -1]], np.zeros((1, 1)), np.empty(0))
    recording = Recording(
        "o", TIME, 0 * TIME, np.full((TIME.size, 1), 0.03), ("output",), ("V",), np.array([1e-3]), "", ""
    )
    e = Experiment(recording, still, Rig("o", "oscillator", columns=columns))
    model = Model("oscillator", (*LINEAR, "angle_offset"))
    b = Bench("oscillator", every_effect("oscillator"), [e], 0.02)
    values = {"g": 1.0, "xi": 0.1, "alpha": 9.0, "theta_0": 0.03}
    ((found,),) = held_out([(model, values)], b, NaturalUnits(1 / 3, 0.3, 1.0))
    np.testing.assert_allclose(found[:, 0], 0.03, atol=1e-6)


def test_an_arm_under_a_force_in_time_rests_near_its_straight_shape() -> None:
    """The force on the higher shapes hides the place of rest from a slow motion through it."""
    values = {
        "xi": 0.09, "alpha": 5.8, "tau_r": 1e-4, "mu": 0.033, "length": 1.0, "c_b": 0.0208, "Omega": 3.23,
        "a_s": 0.17, "a_c": -0.1, "b_s": 0.00307, "b_c": -0.00367, "n_s": 0.00147, "n_c": 0.00038,
    }  # fmt: skip
    effects = ("viscous_damping", "linear_stiffness", "periodic_disturbance", "base_compliance")
    found = equilibrium(Model("elastica_4", effects), values, NaturalUnits(0.415, 0.3, 1.0), [0.0], 0.0)
    assert 0.0 < abs(found) < 0.002


def test_a_given_state_is_what_an_instrument_that_errs_reads() -> None:
    time = np.arange(0.0, 10.0, 0.02)
    effects = ("viscous_damping", "linear_stiffness", "position_scale", "angle_offset")
    rig = Rig("o", "oscillator", columns=Columns(TimeColumn(), None, OutputColumn("y", "m")), declared=effects)
    swing = 0.3 * np.exp(-0.1 * time) * np.cos(3.0 * time)
    recording = Recording("a", time, None, swing[:, None], ("output",), ("m",), np.array([1e-3]), "", "")
    experiment = Experiment(recording, None, rig)
    found = fit(Model("oscillator", effects, {"g": 0.0, "s": 0.2, "theta_0": 0.03}), [experiment])
    output, _ = predict(found, experiment, initial=(0.25, -0.1))
    assert output[0, 0] == pytest.approx(0.25, abs=1e-9)
    assert np.gradient(output[:, 0], time, edge_order=2)[0] == pytest.approx(-0.1, abs=2e-3)
