"""The twin against theory, against itself with more modes, and against a discretisation that shares nothing with it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from discovery_datasets.arm import NODES, PAPER_RIG, Arm
from discovery_datasets.beam import discretise, integration_matrix
from discovery_datasets.disturbances import (
    DISTURBANCES,
    STANDARD_GRAVITY,
    CameraOriginOffset,
    CoulombFriction,
    Disturbance,
    EncoderRipple,
    InitialCurvature,
    PeriodicDisturbance,
    PositionScale,
    QuadraticDrag,
    SensorDelay,
    StiffnessDrift,
    StructuralDamping,
    TableTilt,
    ViscoelasticRelaxation,
)
from discovery_datasets.manoeuvres import minimum_jerk, rest, sequence, trapezoid
from discovery_datasets.recordings import MANOEUVRES, sample_times
from discovery_datasets.twin import record, simulate, static_tip, write_csv
from hypothesis import given
from hypothesis import strategies as st
from numpy.polynomial import Chebyshev
from scipy.integrate import odeint
from scipy.integrate import trapezoid as trapezoid_rule
from scipy.linalg import eigh
from scipy.optimize import brentq

FRICTIONLESS = replace(PAPER_RIG, disc_friction=0.0)
SHORT = {"modes": 3, "nodes": 8}
FINE = 1e-10


def tip(motion):
    return motion.tip_x + 1j * motion.tip_y


# --- space discretisation


def test_integration_is_exact_for_polynomials():
    position, integral = integration_matrix(9)
    for power in range(9):
        np.testing.assert_allclose(integral @ position**power, position ** (power + 1) / (power + 1), atol=1e-14)


def test_curvature_shapes_are_orthonormal_and_free_of_moment_at_the_tip():
    beam = discretise(1.0, 0.01, 0.04, modes=5, nodes=20)
    fits = [Chebyshev.fit(beam.position, shape, 7, domain=[0, 1]) for shape in beam.angle_shapes.T[1:]]
    curvature = np.array([fit.deriv()(beam.position) for fit in fits]).T
    np.testing.assert_allclose(curvature.T @ (beam.weights[:, None] * curvature), np.eye(5), atol=1e-10)
    np.testing.assert_allclose(curvature[-1], 0.0, atol=1e-10)


def test_too_few_nodes_are_refused():
    with pytest.raises(ValueError, match="5 modes need at least 7 nodes"):
        discretise(1.0, 0.01, 0.04, modes=5, nodes=6)


# --- statics and linear limit


@pytest.mark.parametrize(
    ("load", "deflection", "shortening"),
    [(1, 0.30172, 0.05643), (2, 0.49346, 0.16064), (5, 0.71379, 0.38763), (10, 0.81061, 0.55500)],
)
def test_static_deflection_is_mattiassons(load, deflection, shortening):
    # K. Mattiasson, Int. J. Numer. Methods Eng. 17, 1981: cantilever under a transverse end load P l^2 / EI
    rig = replace(PAPER_RIG, length=0.8)
    force = 1j * load * rig.flexural_rigidity / rig.length**2
    position = static_tip(rig, tip_force=force, modes=8, nodes=20) / rig.length
    assert position.imag == pytest.approx(deflection, abs=6e-6)
    assert 1 - position.real == pytest.approx(shortening, abs=6e-6)


def linear_modes(rig, modes=7):
    """Angular frequencies [rad/s] and shapes of the twin's small vibrations about the straight rod at rest."""
    still = np.zeros(modes + 1)
    mass = Arm.of(rig, (), modes, modes + 7).balance(0.0, still, still, still[1:])[0][1:, 1:]
    square, shapes = eigh(rig.flexural_rigidity / rig.length * np.eye(modes), mass)
    return np.sqrt(square), shapes


def analytic_frequency(rig, below, above):
    """Root of the frequency equation of a clamped beam with a tip mass, between two wave numbers times length."""
    ratio = rig.tip_mass / rig.beam_mass

    def equation(k):
        flexure = np.cos(k) * np.sinh(k) - np.sin(k) * np.cosh(k)
        return 1 + np.cos(k) * np.cosh(k) + ratio * k * flexure

    wave = brentq(equation, below, above, xtol=1e-14)
    return wave**2 * np.sqrt(rig.flexural_rigidity / (rig.beam_mass * rig.length**3))


def test_small_vibrations_have_the_analytic_frequencies():
    rig = replace(PAPER_RIG, length=1.3)
    frequencies, _ = linear_modes(rig)
    assert frequencies[0] == pytest.approx(analytic_frequency(rig, 0.5, 1.8), rel=1e-10)
    assert frequencies[1] == pytest.approx(analytic_frequency(rig, 3.2, 4.7), rel=1e-7)
    assert frequencies[2] == pytest.approx(analytic_frequency(rig, 6.5, 7.8), rel=1e-4)


def test_a_small_first_mode_swings_as_a_cosine():
    frequencies, shapes = linear_modes(FRICTIONLESS, 5)
    time = np.linspace(0, 6, 301)
    start = 1e-4 * shapes[:, 0] / np.linalg.norm(shapes[:, 0])
    motion = simulate(FRICTIONLESS, rest(), time, initial=(start, np.zeros(5)), rtol=FINE)
    np.testing.assert_allclose(motion.tip_y, motion.tip_y[0] * np.cos(frequencies[0] * time), atol=1e-4 * 1e-5)


# --- dynamics


def test_power_of_the_motor_is_energy_gained_and_lost_to_friction():
    time = np.linspace(0, 3, 6001)
    motion = simulate(PAPER_RIG, minimum_jerk(1.2, 1.0, start=0.2), time, rtol=FINE)
    _, rate, _ = minimum_jerk(1.2, 1.0, start=0.2)(time)
    velocity = np.gradient(tip(motion), time, edge_order=2)
    supplied = trapezoid_rule(motion.base_torque * rate, time)
    lost = trapezoid_rule(PAPER_RIG.disc_friction * np.abs(velocity) ** 2, time)
    energy = motion.kinetic_energy + motion.elastic_energy
    assert energy[0] == 0.0
    assert energy[-1] > 0.01
    assert supplied - lost == pytest.approx(energy[-1], rel=2e-6)


def test_energy_is_conserved_without_friction():
    manoeuvre = trapezoid(1.0, 1.4, start=0.1)
    time = np.linspace(0, 3, 31)
    motion = simulate(FRICTIONLESS, manoeuvre, time, rtol=FINE)
    free = (motion.kinetic_energy + motion.elastic_energy)[time > manoeuvre.kinks[-1]]
    assert np.ptp(free) < 1e-7 * free.mean()


def test_swinging_about_another_angle_is_the_same_motion_turned():
    time = np.linspace(0, 2, 41)
    here = tip(simulate(PAPER_RIG, trapezoid(0.7, 1.0), time, **SHORT))
    there = tip(simulate(PAPER_RIG, trapezoid(0.7, 1.0, initial=2.0), time, **SHORT))
    mirrored = tip(simulate(PAPER_RIG, trapezoid(-0.7, 1.0), time, **SHORT))
    np.testing.assert_allclose(there, here * np.exp(2j), atol=1e-7)
    np.testing.assert_allclose(mirrored, here.conj(), atol=1e-7)


def test_the_rest_before_the_move_is_at_rest():
    time = np.linspace(0, 0.5, 11)
    motion = simulate(PAPER_RIG, trapezoid(1.0, 1.0, start=0.5), time)
    np.testing.assert_array_equal(tip(motion), np.ones(11))


@pytest.mark.slow
def test_the_largest_manoeuvre_is_converged_to_a_hundredth_of_a_millimetre():
    time = sample_times()
    motion = simulate(PAPER_RIG, MANOEUVRES["holdout_beyond"], time)
    finer = simulate(PAPER_RIG, MANOEUVRES["holdout_beyond"], time, modes=6, nodes=NODES + 2, rtol=1e-9)
    assert np.abs(motion.deflection).max() > 0.95
    assert np.abs(tip(motion) - tip(finer)).max() < 1e-5


def rigid_chain(rig, manoeuvre, time, links):
    """Tip of a chain of rigid bars with springs in the joints: no shape functions, error of order 1 / links^2."""
    h = rig.length / links
    line_density = rig.beam_mass / rig.length
    beyond = line_density * h * (links - 1 - np.arange(links)) + rig.tip_mass
    later = np.maximum.outer(np.arange(links), np.arange(links))
    inertia = h * h * (line_density * h / 2 + beyond[later])
    np.fill_diagonal(inertia, line_density * h**3 / 3 + h * h * beyond)
    spring = rig.flexural_rigidity / h
    stiffness = spring * (2 * np.eye(links) - np.eye(links, k=1) - np.eye(links, k=-1))
    stiffness[0, 0] = 3 * spring
    stiffness[-1, -1] = spring
    root = np.zeros(links)
    root[0] = 2 * spring  # half a cell to the clamp

    def derivative(t, state):
        angle, rate = state[:links], state[links:]
        c, s = np.cos(angle), np.sin(angle)
        velocity = h * np.array([-(s @ rate), c @ rate])
        friction = rig.disc_friction * h * (c * velocity[1] - s * velocity[0])
        centripetal = s * (inertia @ (c * rate**2)) - c * (inertia @ (s * rate**2))
        load = root * manoeuvre(t)[0] - stiffness @ angle - friction - centripetal
        return np.concatenate([rate, np.linalg.solve(inertia * (np.outer(c, c) + np.outer(s, s)), load)])

    path = odeint(derivative, np.zeros(2 * links), time, tfirst=True, rtol=1e-8, atol=1e-9, mxstep=100_000)
    return h * np.exp(1j * path[:, :links]).sum(axis=1)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("counts", "distance"),
    [
        ((3, 4, 6, 8), 2.5e-4),
        ((4, 6, 8, 12), 1.5e-5),
        ((6, 8, 12, 16), 3e-6),
    ],
)
def test_a_chain_of_rigid_links_extrapolates_to_the_twin(counts, distance):
    manoeuvre = minimum_jerk(1.2, 0.8, start=0.0)
    time = np.linspace(0, 1.2, 25)
    motion = simulate(PAPER_RIG, manoeuvre, time)
    exact = tip(motion)
    assert np.abs(motion.deflection).max() > 0.7
    counts = np.array(counts)
    chains = np.array([rigid_chain(PAPER_RIG, manoeuvre, time, n) for n in counts])
    powers = counts[:, None] ** (-2.0 * np.arange(4))
    errors = np.abs(chains - exact).max(axis=1)
    assert np.log(errors[0] / errors[-1]) / np.log(counts[-1] / counts[0]) == pytest.approx(2, abs=0.05)
    extrapolated = np.linalg.solve(powers, chains)[0]
    assert np.abs(extrapolated - exact).max() < distance


# --- undeclared effects

STRENGTHS = {
    "coulomb_friction": (CoulombFriction(0.0), CoulombFriction(4e-4)),
    "quadratic_drag": (QuadraticDrag(0.0), QuadraticDrag(1e-3)),
    "periodic_disturbance": (PeriodicDisturbance(0.0, 2.0), PeriodicDisturbance(1e-3, 2.0)),
    "table_tilt": (TableTilt(), TableTilt(x=1e-3, y=-1e-3)),
    "initial_curvature": (InitialCurvature(0.0), InitialCurvature(0.02)),
    "stiffness_drift": (StiffnessDrift(0.0), StiffnessDrift(-5e-3)),
    "structural_damping": (StructuralDamping(0.0), StructuralDamping(2e-3)),
    "viscoelastic_relaxation": (ViscoelasticRelaxation(0.0, 0.5), ViscoelasticRelaxation(0.05, 0.5)),
    "encoder_ripple": (EncoderRipple(0.0, 8.0), EncoderRipple(3e-3, 8.0)),
    "sensor_delay": (SensorDelay(0.0), SensorDelay(0.01)),
    "camera_origin_offset": (CameraOriginOffset(), CameraOriginOffset(x=2e-3)),
    "position_scale": (PositionScale(0.0), PositionScale(3e-3)),
}
TIME = np.linspace(0, 2, 41)


@pytest.fixture(scope="module")
def undisturbed():
    return simulate(PAPER_RIG, trapezoid(1.0, 1.2), TIME, **SHORT)


def reading(motion):
    return motion.reading_x + 1j * motion.reading_y


@pytest.mark.parametrize("effect", DISTURBANCES)
def test_an_effect_of_no_strength_changes_nothing_and_a_real_one_is_seen(effect, undisturbed):
    none, real = STRENGTHS[effect]
    assert none.id == real.id == effect
    without = simulate(PAPER_RIG, trapezoid(1.0, 1.2), TIME, disturbances=[none], **SHORT)
    np.testing.assert_allclose(reading(without), reading(undisturbed), atol=1e-9)
    with_it = simulate(PAPER_RIG, trapezoid(1.0, 1.2), TIME, disturbances=[real], **SHORT)
    assert np.abs(reading(with_it) - reading(undisturbed)).max() > 3e-4


def test_friction_and_drag_only_take_energy():
    start = np.array([0.6, 0.0, 0.0])
    for effect in (CoulombFriction(2e-3), QuadraticDrag(2e-3), StructuralDamping(5e-3)):
        motion = simulate(
            FRICTIONLESS, rest(), TIME, disturbances=[effect], initial=(start, np.zeros(3)), rtol=FINE, **SHORT
        )
        energy = motion.kinetic_energy + motion.elastic_energy
        assert (np.diff(energy) < 1e-10).all()
        assert energy[-1] < 0.97 * energy[0]


def test_dry_friction_lowers_the_amplitude_by_a_constant_step_each_half_swing():
    force, stiffness = 1e-3, 3 * PAPER_RIG.flexural_rigidity / PAPER_RIG.length**3
    frequencies, shapes = linear_modes(FRICTIONLESS, 3)
    start = 0.1 * shapes[:, 0] / np.linalg.norm(shapes[:, 0])
    time = np.arange(5) * np.pi / frequencies[0]
    motion = simulate(
        FRICTIONLESS,
        rest(),
        time,
        disturbances=[CoulombFriction(force, speed=1e-4)],
        initial=(start, np.zeros(3)),
        **SHORT,
    )
    np.testing.assert_allclose(-np.diff(np.abs(motion.tip_y)), 2 * force / stiffness, rtol=0.05)


def test_a_delayed_camera_reports_the_past(undisturbed):
    late = simulate(PAPER_RIG, trapezoid(1.0, 1.2), TIME, disturbances=[SensorDelay(0.1)], **SHORT)
    np.testing.assert_allclose(reading(late)[2:], tip(undisturbed)[:-2], atol=1e-6)
    np.testing.assert_allclose(reading(late)[:2], tip(undisturbed)[0], atol=1e-12)
    np.testing.assert_allclose(tip(late), tip(undisturbed), atol=1e-6)


def test_a_misplaced_and_a_wrongly_scaled_camera(undisturbed):
    effects = [PositionScale(0.01), CameraOriginOffset(x=1e-3, y=-2e-3)]
    motion = simulate(PAPER_RIG, trapezoid(1.0, 1.2), TIME, disturbances=effects, **SHORT)
    np.testing.assert_allclose(reading(motion), 1.01 * tip(undisturbed) + (1e-3 - 2e-3j), atol=1e-12)


def test_a_tilted_table_bends_the_arm_at_rest_as_beam_theory_says():
    slope, rig = 1e-4, PAPER_RIG
    weight = STANDARD_GRAVITY * slope
    expected = weight * rig.length**3 / rig.flexural_rigidity * (rig.tip_mass / 3 + rig.beam_mass / 8)
    motion = simulate(rig, rest(np.pi / 2), TIME[:5], disturbances=[TableTilt(x=slope)])
    np.testing.assert_allclose(motion.tip_x, expected, rtol=1e-5)
    assert np.abs(motion.rates).max() < 1e-9


def test_a_bent_rod_rests_on_a_circle():
    curvature = 0.3
    motion = simulate(PAPER_RIG, rest(), TIME[:5], disturbances=[InitialCurvature(curvature)])
    circle = (np.exp(1j * curvature * PAPER_RIG.length) - 1) / (1j * curvature)
    np.testing.assert_allclose(tip(motion), circle, atol=1e-9)


def test_a_constant_force_holds_the_arm_where_statics_says():
    force = PeriodicDisturbance(amplitude=0.1, frequency=0.0, phase=np.pi / 2, direction=2.0)
    motion = simulate(PAPER_RIG, rest(), TIME[:5], disturbances=[force])
    np.testing.assert_allclose(tip(motion), static_tip(PAPER_RIG, tip_force=0.1 * np.exp(2j)), atol=1e-9)


def test_a_quickly_relaxing_rod_is_a_kelvin_voigt_rod():
    ratio, time = 0.5, 2e-3
    start = (np.array([0.3, 0.0]), np.zeros(2))
    both = [
        simulate(PAPER_RIG, rest(), TIME, disturbances=[effect], initial=start, modes=2, nodes=8)
        for effect in (ViscoelasticRelaxation(ratio, time), StructuralDamping(ratio * time))
    ]
    undamped = simulate(PAPER_RIG, rest(), TIME, initial=start, modes=2, nodes=8)
    apart = np.abs(tip(both[0]) - tip(both[1])).max()
    assert apart < 0.1 * np.abs(tip(both[1]) - tip(undamped)).max()


def test_stiffness_that_drifts_changes_the_frequency():
    frequencies, shapes = linear_modes(FRICTIONLESS, 3)
    start = (1e-3 * shapes[:, 0] / np.linalg.norm(shapes[:, 0]), np.zeros(3))
    rate = 0.02
    motion = simulate(FRICTIONLESS, rest(), TIME, disturbances=[StiffnessDrift(rate)], initial=start, **SHORT)
    # WKB: phase is the integral of the frequency, amplitude falls with the fourth root of the stiffness
    phase = frequencies[0] * 2 / (3 * rate) * ((1 + rate * TIME) ** 1.5 - 1)
    expected = motion.tip_y[0] * np.cos(phase) * (1 + rate * TIME) ** -0.25
    np.testing.assert_allclose(motion.tip_y, expected, atol=5e-3 * abs(motion.tip_y[0]))


@given(angle=st.floats(-3, 3), rate=st.floats(-2, 2), acceleration=st.floats(-5, 5))
def test_rippled_base_motion_has_consistent_derivatives(angle, rate, acceleration):
    ripple = EncoderRipple(amplitude=4e-3, cycles=7.0, phase=0.4)
    step = 1e-4
    before, now, after = (
        ripple.base_motion(angle + rate * t + acceleration * t * t / 2, rate + acceleration * t, acceleration)
        for t in (-step, 0.0, step)
    )
    assert (after[0] - before[0]) / (2 * step) == pytest.approx(now[1], abs=1e-5)
    assert (after[1] - before[1]) / (2 * step) == pytest.approx(now[2], abs=1e-4)


def test_the_base_class_is_neutral(undisturbed):
    motion = simulate(PAPER_RIG, trapezoid(1.0, 1.2), TIME, disturbances=[Disturbance()], **SHORT)
    np.testing.assert_array_equal(reading(motion), reading(undisturbed))


# --- manoeuvres


@given(
    angle=st.floats(-2, 2).filter(lambda a: abs(a) > 0.05),
    rate=st.floats(0.2, 3),
    ramp=st.floats(0.02, 0.5),
    start=st.floats(0, 2),
)
def test_trapezoid_is_continuous_and_keeps_its_word(angle, rate, ramp, start):
    manoeuvre = trapezoid(angle, rate, start=start, initial=0.3, ramp=ramp)
    duration = abs(angle) / rate / (1 - ramp)
    assert manoeuvre.kinks[0] == start
    assert manoeuvre.kinks[-1] - start == pytest.approx(duration)
    assert manoeuvre.kinks[1] - start == pytest.approx(ramp * duration)
    for kink in manoeuvre.kinks:
        (low, high), (slow, fast), _ = manoeuvre([kink - 1e-9, kink + 1e-9])
        assert high == pytest.approx(low, abs=1e-7)
        assert fast == pytest.approx(slow, abs=1e-6 * (1 + rate / (ramp * duration)))
    time = np.linspace(start, start + duration, 2001)
    values, rates, _ = manoeuvre(time)
    assert np.abs(rates).max() == pytest.approx(rate, rel=1e-9)
    assert values[0] == pytest.approx(0.3)
    assert values[-1] == pytest.approx(0.3 + angle)
    assert trapezoid_rule(rates, time) == pytest.approx(angle, rel=1e-4)


def test_minimum_jerk_is_smooth_at_both_ends():
    angle, rate, acceleration = minimum_jerk(0.8, 1.5, start=1.0)([0.9, 1.0, 1.75, 2.5, 2.6])
    np.testing.assert_allclose(angle, [0, 0, 0.4, 0.8, 0.8], atol=1e-12)
    np.testing.assert_allclose(rate, [0, 0, 1.875 * 0.8 / 1.5, 0, 0], atol=1e-12)
    np.testing.assert_allclose(acceleration, 0, atol=1e-12)


def test_sequence_counts_the_second_move_from_the_end_of_the_first():
    both = sequence(trapezoid(-0.9, 1.1), trapezoid(0.5, 0.8, start=9.0))
    angle, _, _ = both([0.0, 8.0, 20.0])
    np.testing.assert_allclose(angle, [0.0, -0.9, -0.4], atol=1e-12)
    with pytest.raises(ValueError, match="before the first ends"):
        sequence(trapezoid(1.0, 1.0), trapezoid(1.0, 1.0, start=1.0))


@pytest.mark.parametrize(("rate", "ramp"), [(0.0, 0.12), (-1.0, 0.12), (1.0, 0.0), (1.0, 0.6)])
def test_impossible_moves_are_refused(rate, ramp):
    with pytest.raises(ValueError, match="trapezoid needs"):
        trapezoid(1.0, rate, ramp=ramp)
    with pytest.raises(ValueError, match="positive duration"):
        minimum_jerk(1.0, 0.0)


@pytest.mark.parametrize("time", [[0.0], [0.0, 1.0, 1.0], [1.0, 0.0]])
def test_times_must_increase(time):
    with pytest.raises(ValueError, match="strictly increasing"):
        simulate(PAPER_RIG, rest(), time)


# --- instruments


def test_noise_is_what_the_instruments_are_said_to_have():
    motion = simulate(PAPER_RIG, rest(0.4), np.arange(20000) / 100.0, modes=1, nodes=4)
    frame = record(motion, rng=np.random.default_rng(5))
    assert list(frame) == ["time_s", "motor_angle_rad", "tip_x_m", "tip_y_m"]
    encoder = frame["motor_angle_rad"] - 0.4
    assert encoder.abs().max() <= 7e-5
    assert encoder.std() == pytest.approx(7e-5 / np.sqrt(3), rel=0.02)
    errors = np.column_stack([frame["tip_x_m"] - motion.tip_x, frame["tip_y_m"] - motion.tip_y])
    np.testing.assert_allclose(errors.std(axis=0), 3e-4, rtol=0.03)
    assert abs(np.corrcoef(errors.T)[0, 1]) < 0.03


def test_csv_has_six_decimals_and_leaves_no_draft(tmp_path, undisturbed):
    frame = record(undisturbed, rng=np.random.default_rng(1))
    write_csv(frame, tmp_path / "new" / "a.csv")
    lines = (tmp_path / "new" / "a.csv").read_text().splitlines()
    assert lines[0] == "time_s,motor_angle_rad,tip_x_m,tip_y_m"
    assert all(len(cell.split(".")[1]) == 6 for line in lines[1:] for cell in line.split(","))
    assert [p.name for p in (tmp_path / "new").iterdir()] == ["a.csv"]
