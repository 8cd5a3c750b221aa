from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from discovery_datasets.manoeuvres import trapezoid
from scipy.integrate import simpson
from test_coupling import PLAIN, arm_on

from benchmarks.paper.theory.arm_motion import move_arm
from benchmarks.paper.theory.coupling import Arm
from benchmarks.paper.theory.drivetrain.driven_arm import DrivenMotion, drive_arm
from benchmarks.paper.theory.drivetrain.motor import ASSUMED_MOTOR, Motor, PositionController
from benchmarks.paper.theory.drivetrain.study import PAPER_ARM, EncoderStudy, encoder_as_input, trapezoid_command
from discovery.declarations import symbols as s
from discovery.foundation.errors import InputError
from discovery.mechanics import get_base
from discovery.recordings.drive import Drive
from discovery.simulation.kernel.compile import numpy_derivative

TEN_HERTZ = PositionController(2 * np.pi * 10)
#: A controller so weak that the motor is free.
FREE = PositionController(1e-9, feed_forward=False)
STILL = Drive(np.array([0.0, 1.0]), np.zeros((1, 1)), np.empty(0))
#: Without friction.
SMOOTH = replace(ASSUMED_MOTOR, viscous_friction=0.0)
#: (bandwidth [rad/s], integral time [s], feed-forward), largest error on the paper's manoeuvre without arm [rad].
TRACKING = [
    (30.0, np.inf, True, 1e-8),
    (30.0, np.inf, False, 0.3),
    (120.0, np.inf, False, 0.07),
    (30.0, 0.1, False, 0.3),
]


def balance(motor: Motor, motion: DrivenMotion) -> np.ndarray:
    """K i - J n^2 theta_m'' - friction - Gamma_c of eq. (10)."""
    moving = motor.hub_inertia * motion.alpha_m + motor.friction(motion.omega_m)
    return motor.hub_constant * motion.current - moving - motion.coupling_torque


def test_the_gears_two_sides_are_one_motor() -> None:
    time, command = np.linspace(0.0, 3.0, 61), trapezoid_command(1.0, 1.4)
    geared = Motor(6e-6, 1e-5, 0.04, 50.0, coulomb=1e-3, current_limit=0.3)
    direct = Motor(6e-6 * 2500, 1e-5 * 2500, 0.04 * 50, 1.0, coulomb=0.05, current_limit=0.3)
    a, b = (drive_arm(PAPER_ARM, m, TEN_HERTZ, command, time) for m in (geared, direct))
    np.testing.assert_allclose(a.theta_m, b.theta_m, atol=1e-7)
    np.testing.assert_allclose(a.current, b.current, atol=1e-5)
    assert geared.hub_inertia == pytest.approx(0.015)
    assert geared.hub_constant == pytest.approx(2.0)


@pytest.mark.parametrize("base", ["constant_radius", "elastica_2"])
def test_the_papers_balance_holds_at_every_moment(base: str) -> None:
    quintic = Drive(np.array([0.0, 1.0]), np.array([[6.0], [-15.0], [10.0], [0.0], [0.0], [0.0]]), np.array([1.0]))
    motor, time = replace(ASSUMED_MOTOR, coulomb=2e-3, creep=0.1), np.linspace(0.0, 1.0, 1001)
    motion = drive_arm(arm_on(base, xi=0.05, tau_r=0.0005), motor, TEN_HERTZ, quintic, time)
    moving = motor.hub_inertia * motion.alpha_m + motor.friction(motion.omega_m)
    current = np.abs(motor.hub_constant * motion.current).max()
    np.testing.assert_allclose(balance(motor, motion), 0.0, atol=1e-12)
    assert np.abs(moving).max() > 0.2 * current
    assert np.abs(motion.coupling_torque).max() > 0.2 * current
    # Angle, rate and acceleration belong together.
    inner = slice(1, -1)
    np.testing.assert_allclose(np.gradient(motion.theta_m, time)[inner], motion.omega_m[inner], atol=1e-4)
    np.testing.assert_allclose(np.gradient(motion.omega_m, time)[inner], motion.alpha_m[inner], atol=2e-2)
    # Work of the motor: kinetic energy of the rotor, friction, and what went into the arm.
    spent = (motor.friction(motion.omega_m) + motion.coupling_torque) * motion.omega_m
    work = simpson(motor.hub_constant * motion.current * motion.omega_m - spent, x=time)
    assert work == pytest.approx(motor.hub_inertia * motion.omega_m[-1] ** 2 / 2, abs=1e-7)
    assert simpson(np.abs(spent), x=time) > 0.05


def test_a_free_hub_and_its_tip_swing_against_each_other() -> None:
    # J n^2 theta_m'' = alpha m l^2 delta, theta_t'' = -alpha delta: delta'' = -alpha (1 + m l^2 / J n^2) delta.
    arm = Arm(replace(PAPER_ARM.model, effects=PLAIN), {"xi": 0.0, "alpha": 8.79}, 0.044)
    time = np.linspace(0.0, 2.0, 101)
    motion = drive_arm(arm, SMOOTH, FREE, STILL, time, deflection=0.4)
    omega = np.sqrt(8.79 * (1 + 0.044 / SMOOTH.hub_inertia))
    np.testing.assert_allclose(motion.theta_t - motion.theta_m, 0.4 * np.cos(omega * time), atol=1e-6)
    np.testing.assert_allclose(motion.current, 0.0, atol=1e-9)


def test_a_free_motor_and_arm_keep_their_angular_momentum_and_energy() -> None:
    arm, time = arm_on("elastica_2"), np.linspace(0.0, 1.0, 51)
    motion = drive_arm(arm, SMOOTH, FREE, STILL, time, deflection=0.7, rate=1.0)
    rows = replace(arm.program, derivative=_channels("elastica_2", arm), slopes=(s.h, s.U))
    hub = np.stack([motion.theta_m, motion.omega_m, motion.alpha_m])
    h, _ = numpy_derivative(rows)(time, hub, motion.states, arm.parameters)
    total = arm.inertia * h + SMOOTH.hub_inertia * motion.omega_m
    np.testing.assert_allclose(total, total[0], rtol=1e-7)
    assert np.ptp(motion.omega_m) > 1.0
    # The power that leaves the rotor is Gamma_c times its rate.
    fine = np.linspace(0.0, 1.0, 2001)
    again = drive_arm(arm, SMOOTH, FREE, STILL, fine, deflection=0.7, rate=1.0)
    change = SMOOTH.hub_inertia * (again.omega_m[-1] ** 2 - again.omega_m[0] ** 2) / 2
    assert -simpson(again.coupling_torque * again.omega_m, x=fine) == pytest.approx(change, rel=1e-6)


def _channels(base: str, arm: Arm) -> tuple:
    mechanics = get_base(base).mechanics()
    return (*mechanics.assignments, *((c, channel.value) for c, channel in mechanics.channels.items()))


@pytest.mark.parametrize("base", ["constant_radius", "elastica_1"])
def test_a_heavy_motor_is_a_given_input(base: str) -> None:
    time, command = np.linspace(0.0, 3.0, 61), trapezoid_command(1.0, 1.4)
    arm = arm_on(base, xi=0.05)
    driven = drive_arm(arm, replace(ASSUMED_MOTOR, gear_ratio=1e5), TEN_HERTZ, command, time)
    given = move_arm(arm, command, time)
    np.testing.assert_allclose(driven.theta_m, driven.command, atol=1e-8)
    np.testing.assert_allclose(driven.x, given.x, atol=1e-7)
    np.testing.assert_allclose(driven.coupling_torque, given.coupling_torque, atol=1e-6)


@pytest.mark.parametrize(("bandwidth", "integral_time", "feed_forward", "largest"), TRACKING)
def test_the_manoeuvre_comes_out(bandwidth: float, integral_time: float, feed_forward: bool, largest: float) -> None:
    controller = PositionController(bandwidth, integral_time=integral_time, feed_forward=feed_forward)
    time, command = np.linspace(0.0, 4.0, 401), trapezoid_command(1.0, 1.0)
    motion = drive_arm(PAPER_ARM, ASSUMED_MOTOR, controller, command, time, coupled=False)
    assert np.abs(motion.theta_m - motion.command).max() < largest
    np.testing.assert_allclose(motion.theta_m[-1], 1.0, atol=1e-4)
    assert np.abs(motion.coupling_torque).max() > 0.1


def test_without_feed_forward_friction_leaves_the_known_lag() -> None:
    controller = PositionController(30.0, feed_forward=False)
    time, ramp = np.linspace(0.0, 2.0, 41), Drive(np.array([0.0, 5.0]), np.array([[0.7], [0.0]]), np.empty(0))
    motion = drive_arm(PAPER_ARM, ASSUMED_MOTOR, controller, ramp, time, coupled=False)
    lag = ASSUMED_MOTOR.hub_damping * 0.7 / (ASSUMED_MOTOR.hub_inertia * 30.0**2)
    assert motion.command[-1] - motion.theta_m[-1] == pytest.approx(lag, rel=1e-6)


def test_an_integral_takes_a_steady_pull_away() -> None:
    # A tilted table pulls for ever.
    tilted = arm_on("reduced", (*PLAIN, "table_tilt"), xi=2.0, phi_x=0.0, phi_y=0.05)
    time = np.linspace(0.0, 8.0, 81)
    plain, integral = (
        drive_arm(tilted, ASSUMED_MOTOR, PositionController(30.0, integral_time=t), STILL, time) for t in (np.inf, 0.2)
    )
    pull = -plain.coupling_torque[-1]
    assert plain.theta_m[-1] == pytest.approx(pull / (ASSUMED_MOTOR.hub_inertia * 900), rel=1e-3)
    assert plain.theta_m[-1] > 1e-3
    assert abs(integral.theta_m[-1]) < 1e-6


def test_the_current_stays_within_its_limit() -> None:
    motor = replace(ASSUMED_MOTOR, current_limit=0.12)
    controller = PositionController(2 * np.pi * 10, integral_time=0.3)
    time, command = np.linspace(0.0, 8.0, 801), trapezoid_command(1.0, 1.4)
    motion = drive_arm(PAPER_ARM, motor, controller, command, time)
    assert np.abs(motion.current).max() == 0.12
    np.testing.assert_allclose(balance(motor, motion), 0.0, atol=1e-12)
    # It falls behind, does not wind up, and ends as without a limit.
    late = np.abs(motion.theta_m - motion.command)
    assert late.max() > 0.1
    assert late[time > 6].max() < 0.004
    assert np.abs(motion.current)[time > 7].max() < 0.12


def test_dry_friction_holds_the_hub_against_the_arm() -> None:
    time = np.linspace(0.0, 1.0, 51)
    holding = replace(SMOOTH, coulomb=0.004)
    motion = drive_arm(PAPER_ARM, holding, FREE, STILL, time, deflection=0.3)
    assert np.abs(motion.coupling_torque).max() < 0.004 * 50
    assert np.abs(motion.theta_m).max() < 1e-3
    free = drive_arm(PAPER_ARM, SMOOTH, FREE, STILL, time, deflection=0.3)
    assert np.abs(free.theta_m).max() > 0.1


def test_the_command_is_the_twins_trapezoid() -> None:
    manoeuvre, drive, time = (
        trapezoid(0.9, 1.3, start=0.4),
        trapezoid_command(0.9, 1.3, start=0.4),
        np.linspace(0, 2, 203),
    )
    np.testing.assert_allclose(drive.evaluate(time), np.array(manoeuvre(time)), atol=1e-12)
    np.testing.assert_allclose(drive.kinks, manoeuvre.kinks)


GEARS = (5, 20, 50, 100)


@cache
def study(*gears: int) -> EncoderStudy:
    return encoder_as_input(np.random.default_rng(0), gear_ratios=gears)


@pytest.mark.parametrize("gears", [(50,), pytest.param(GEARS, marks=pytest.mark.slow)])
def test_the_encoder_is_a_complete_input_whatever_the_motor_does(gears: tuple[int, ...]) -> None:
    found = study(*gears)
    assert (np.abs(found.bias_encoder) < 3e-4).all()
    assert (np.abs(found.bias_encoder) < 2 * found.sd_encoder).all()
    # A tenth of the camera's noise.
    assert (found.residual_encoder < 3e-5).all()


@pytest.mark.slow
def test_the_command_is_an_input_only_where_the_motor_is_deaf() -> None:
    found = study(*GEARS)
    assert (np.diff(found.hub_peak) < 0).all()
    assert (np.diff(found.tip_peak) < 0).all()
    assert (np.diff(np.abs(found.bias_command)) < 0).all()
    np.testing.assert_allclose(found.hub_peak[1:], found.hub_predicted[1:], rtol=0.05)
    # The controller is a spring in series with the rod.
    series = -8.7907 / (found.inertia_ratio * TEN_HERTZ.bandwidth**2)
    np.testing.assert_allclose(found.bias_command[1:], series[1:], rtol=0.12)
    assert abs(found.bias_command[2]) > 30 * abs(found.bias_encoder[2])
    assert found.tip_peak[2] > 0.03


@pytest.mark.parametrize("name", ["inertia", "torque_constant", "gear_ratio", "current_limit", "creep"])
def test_a_motor_needs_positive_quantities(name: str) -> None:
    with pytest.raises(InputError, match=f"{name} must be positive"):
        replace(ASSUMED_MOTOR, **{name: 0.0})


@pytest.mark.parametrize("name", ["viscous_friction", "coulomb"])
def test_friction_is_not_negative(name: str) -> None:
    with pytest.raises(InputError, match=f"{name} must not be negative"):
        replace(ASSUMED_MOTOR, **{name: -1e-9})


@pytest.mark.parametrize("name", ["bandwidth", "damping", "integral_time"])
def test_a_controller_needs_positive_quantities(name: str) -> None:
    with pytest.raises(InputError, match=f"{name} must be positive"):
        replace(TEN_HERTZ, **{name: np.nan})


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"time": np.array([0.0, 1.0, 0.5])}, "increasing order"),
        ({"time": np.array([0.0, np.nan])}, "increasing order"),
        ({"time": np.empty(0)}, "increasing order"),
        ({"drive": None}, "pass a drive"),
        ({"deflection": np.nan}, "finite initial deflection"),
        ({"rate": np.inf}, "finite initial deflection"),
    ],
)
def test_a_motion_that_cannot_be_is_refused(wrong: dict, message: str) -> None:
    asked = {"drive": STILL, "time": np.array([0.0, 0.1]), **wrong}
    drive, time = asked.pop("drive"), asked.pop("time")
    with pytest.raises(InputError, match=message):
        move_arm(PAPER_ARM, drive, time, **asked)
    with pytest.raises(InputError, match=message):
        drive_arm(PAPER_ARM, ASSUMED_MOTOR, TEN_HERTZ, drive, time, **asked)
