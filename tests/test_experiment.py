from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from discovery.recordings.drive import Drive
from discovery.recordings.experiment import Experiment, largest_deflection, make_experiment
from discovery.recordings.recording import Recording
from discovery.rigs.rig import Columns, InputColumn, OutputColumn, Quantity, Rig, TimeColumn

LENGTH = 0.8
ARM = Rig("arm", length=Quantity(LENGTH, 1e-3), angle_noise=7e-5)
TIME = np.linspace(0.0, 6.0, 301)
#: A motor that turns at half a radian a second from the start on: value, rate and acceleration are plain.
TURNING = Drive(np.array([0.0, 6.0]), np.array([[0.5], [0.2]]), np.empty(0))
UNITS = {"tip_x": "m", "tip_y": "m", "tip_angle": "rad", "tip_deflection": "m", "output": "V"}


def recorded(channels: tuple[str, ...], output: np.ndarray, noise: float = 3e-4, rig: Rig = ARM, **options):
    time = options.pop("time", TIME)
    recording = Recording(
        "swing",
        time,
        TURNING.evaluate(time)[0],
        output,
        channels,
        tuple(UNITS[c] for c in channels),
        np.full(len(channels), noise),
        "",
        "",
    )
    return Experiment(recording, TURNING, rig, **options)


def tip(deflection: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    angle = TURNING.evaluate(TIME)[0] + deflection
    rho = LENGTH * np.cos(0.45 * deflection)
    return rho * np.cos(angle), rho * np.sin(angle)


DEFLECTION = 0.6 * np.cos(3.0 * TIME)


# Channels.


def test_the_channels_of_a_reading_are_those_of_the_recording() -> None:
    x, y = tip(DEFLECTION)
    reading = np.stack([x, y], axis=1)[:, :, None].repeat(2, axis=2)
    motor = TURNING.evaluate(TIME)[0]
    angle = motor + DEFLECTION
    expected = {
        ("tip_x", "tip_y"): np.stack([x, y], axis=1),
        # The arm turns by more than half a turn: the angle goes on.
        ("tip_angle",): angle[:, None],
        ("tip_deflection",): (np.hypot(x, y) * np.sin(DEFLECTION))[:, None],
    }
    assert angle.max() > np.pi - 0.5
    for channels, value in expected.items():
        experiment = recorded(channels, np.zeros((TIME.size, len(channels))))
        found = experiment.channels(reading)
        assert found.shape == (TIME.size, len(channels), 2)
        np.testing.assert_allclose(found[:, :, 1], value, atol=1e-12)


def test_the_output_of_an_oscillator_is_its_reading() -> None:
    rig = Rig("o", "oscillator", columns=Columns(TimeColumn(), None, OutputColumn("y", "V")))
    experiment = recorded(("output",), DEFLECTION[:, None], rig=rig)
    reading = DEFLECTION[:, None, None]
    assert experiment.channels(reading) is reading
    assert not experiment.system.has_rod
    np.testing.assert_array_equal(experiment.deflection, DEFLECTION)
    np.testing.assert_array_equal(experiment.motor_angle, 0.0)


# Deflection.


@pytest.mark.parametrize("turns", [0, 1, -2])
def test_deflection_from_the_position_or_from_the_angle(turns: int) -> None:
    x, y = tip(DEFLECTION)
    angle = TURNING.evaluate(TIME)[0] + DEFLECTION
    from_position = recorded(("tip_x", "tip_y"), np.stack([x, y], axis=1))
    np.testing.assert_allclose(from_position.deflection, DEFLECTION, atol=1e-12)
    from_angle = recorded(("tip_angle",), angle[:, None])
    np.testing.assert_allclose(from_angle.deflection, DEFLECTION, atol=1e-12)
    # Whole turns of the motor do not enter the position.
    turned = Drive(TURNING.breakpoints, TURNING.coefficients + np.array([[0.0], [2 * np.pi * turns]]), TURNING.kinks)
    elsewhere = Experiment(from_position.recording, turned, ARM)
    np.testing.assert_allclose(elsewhere.deflection, DEFLECTION, atol=1e-12)


def test_deflection_from_the_distance_to_the_undeflected_line() -> None:
    distance = LENGTH * np.sin(DEFLECTION)
    distance[5] = 1.1 * LENGTH
    experiment = recorded(("tip_deflection",), distance[:, None])
    expected = DEFLECTION.copy()
    expected[5] = np.pi / 2
    np.testing.assert_allclose(experiment.deflection, expected, atol=1e-12)


def test_the_largest_deflection_is_that_of_the_fitted_part_and_bears_an_outlier() -> None:
    time = np.linspace(0.0, 6.0, 5001)
    output = (0.4 * np.sin(3 * time) * np.where(time > 3, 2.0, 1.0) + TURNING.evaluate(time)[0])[:, None]
    output[100] = 1.4
    output[200] = np.nan
    assert largest_deflection([recorded(("tip_angle",), output, time=time)]) == pytest.approx(0.8, rel=0.01)
    first = recorded(("tip_angle",), output, time=time, fitted_samples=2000)
    assert largest_deflection([first]) == pytest.approx(0.4, rel=0.01)
    assert largest_deflection([first], whole=True) == pytest.approx(0.8, rel=0.01)


# Weights.


def test_weights_are_one_over_the_noise_but_in_gaps_and_held_out_samples() -> None:
    output = np.zeros((TIME.size, 2))
    output[10:20, 0] = np.nan
    experiment = recorded(("tip_x", "tip_y"), output, fitted_samples=200)
    weights = experiment.weights()
    assert weights.shape == output.shape
    assert (weights[:10] == 1 / 3e-4).all()
    assert (weights[10:20, 0] == 0).all()
    assert (weights[10:20, 1] == 1 / 3e-4).all()
    assert (weights[200:] == 0).all()
    assert experiment.fitted == slice(0, 200)


# The start.


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 1000), st.floats(-0.5, 0.5), st.floats(-2.0, 2.0))
def test_the_first_guess_of_the_state_is_good_to_its_noise(seed: int, deflection: float, rate: float) -> None:
    motion = deflection * np.cos(3 * TIME) + rate / 3 * np.sin(3 * TIME)
    noisy = TURNING.evaluate(TIME)[0] + motion + 3e-4 * np.random.default_rng(seed).standard_normal(TIME.size)
    experiment = recorded(("tip_angle",), noisy[:, None])
    found = experiment.initial_guess
    # Nine samples at 50 Hz decide at least: 0.003 rad and 0.06 rad/s, and as much again from the bend of the motion.
    assert found[0] == pytest.approx(deflection, abs=5e-3)
    assert found[1] == pytest.approx(rate, abs=0.15)


def test_a_gap_at_the_start_does_not_stop_the_guess() -> None:
    motion = TURNING.evaluate(TIME)[0] + 0.3 * np.cos(3 * TIME)
    motion[:6] = np.nan
    found = recorded(("tip_angle",), motion[:, None]).initial_guess
    assert found[0] == pytest.approx(0.3, abs=0.02)
    assert found[1] == pytest.approx(0.0, abs=0.3)


# From a recording.


def test_a_free_decay_has_no_drive() -> None:
    rig = Rig("o", "oscillator", columns=Columns(TimeColumn(), None, OutputColumn("y", "V")))
    recording = Recording("d", TIME, None, DEFLECTION[:, None], ("output",), ("V",), np.array([1e-3]), "", "")
    experiment = make_experiment(recording, rig, fitted_samples=100)
    assert experiment.drive is None
    assert experiment.fitted_samples == 100


def test_the_motor_angle_is_the_smooth_one() -> None:
    rng = np.random.default_rng(0)
    truth = np.clip(0.5 * (TIME - 1.0), 0.0, 1.0)
    recording = Recording(
        "m",
        TIME,
        truth + rng.uniform(-7e-5, 7e-5, TIME.size),
        np.zeros((TIME.size, 1)),
        ("tip_angle",),
        ("rad",),
        np.array([3e-4]),
        "",
        "",
    )
    columns = Columns(TimeColumn("time_s"), InputColumn("motor_angle_rad", "rad", "motion"), OutputColumn("", "m"))
    experiment = make_experiment(recording, Rig("arm", length=Quantity(1.0, 0.0), angle_noise=7e-5, columns=columns))
    away = (np.abs(TIME - 1) > 0.2) & (np.abs(TIME - 3) > 0.2)
    assert np.abs(experiment.motor_angle - truth)[away].max() < 4e-5
