"""The drive: simulated encoders against the motion they recorded, interpolation against known signals."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from discovery.foundation.errors import InputError
from discovery.recordings.recording import Recording
from discovery.recordings.smooth_input import build_drive, smooth_motion
from discovery.rigs.rig import Columns, InputColumn, OutputColumn, Quantity, Rig, TimeColumn

HALF_WIDTH = 7e-5  # rad, the paper's encoder
NOISE = HALF_WIDTH / np.sqrt(3.0)


def step_acceleration(t, edges, acceleration):
    """Angle, rate and acceleration for constant accelerations between edges, from rest."""
    ramp = np.maximum(t[:, None] - np.asarray(edges), 0.0)
    jump = np.diff(acceleration, prepend=0.0, append=0.0)
    return np.stack([0.5 * ramp**2 @ jump, ramp @ jump, (ramp > 0.0) @ jump])


def trapezoid(start, turn, duration, ramp):
    acceleration = turn / (duration - ramp) / ramp
    edges = [start, start + ramp, start + duration - ramp, start + duration]
    return edges, lambda t: step_acceleration(t, edges, [acceleration, 0.0, -acceleration])


def s_curve(start, turn, duration, ramp):
    """Rates that rise and fall as the quintic smooth step."""
    rate = turn / (duration - ramp)

    def rise(t):
        u = t / ramp
        c = np.clip(u, 0.0, 1.0)
        angle = ramp * (c**4 * (2.5 - 3.0 * c + c**2) + np.maximum(u - 1.0, 0.0))
        return np.stack([angle, c**3 * (10.0 - 15.0 * c + 6.0 * c**2), 30.0 * c**2 * (1.0 - c) ** 2 / ramp])

    return lambda t: rate * (rise(t - start) - rise(t - start - duration + ramp))


def sine(t):
    w = 4.4
    return 0.3 * np.stack([np.sin(w * t), w * np.cos(w * t), -(w**2) * np.sin(w * t)])


def measure(truth, rng, n=2500, step=0.01, jitter=0.0):
    t = step * (np.arange(n) + rng.uniform(-jitter, jitter, n))
    y = truth(t)[0] + rng.uniform(-HALF_WIDTH, HALF_WIDTH, n)
    return t, np.round(y, 6)


def rms(values):
    return float(np.sqrt(np.mean(values**2)))


def errors(drive, truth, t):
    """Rms errors of the angle while accelerating, of the angle and rate at rest, largest error of the angle."""
    fine = np.linspace(t[0] + 0.02, t[-1] - 0.02, 7 * t.size)
    exact = truth(fine)
    error = drive.evaluate(fine) - exact
    moving = np.abs(exact[2]) > 1e-9
    rest = np.abs(exact[1]) < 1e-12
    at_rest = (rms(error[0, rest]), rms(error[1, rest])) if rest.any() else (0.0, 0.0)
    return rms(error[0, moving]), *at_rest, float(np.abs(error[0]).max())


# truth, sample spacing [s], bounds: angle in phases, angle at rest, rate at rest, largest angle [rad, rad/s];
# between a kink's true and its found time, a rest is no rest
PROFILES = {
    "paper": (trapezoid(1.003, 1.0, 1.12, 0.12)[1], 0.01, (2e-5, 5e-6, 1e-5, 5e-5)),
    "quick trapezoid": (trapezoid(0.3, 0.8, 0.3, 0.05)[1], 0.01, (2.5e-5, 5e-6, 1e-5, 6e-5)),
    "slow trapezoid": (trapezoid(2.0, 0.5, 10.0, 3.0)[1], 0.01, (2e-5, 1e-5, 1e-4, 5e-5)),
    "triangle": (trapezoid(0.3, 0.8, 1.0, 0.5)[1], 0.01, (2e-5, 5e-6, 1e-5, 5e-5)),
    "quick S, 7 samples": (s_curve(0.3, 0.8, 0.26, 0.06), 0.008, (5e-5, 5e-6, 1e-3, 2e-4)),
    "S": (s_curve(0.3, 1.0, 0.7, 0.12), 0.01, (4e-5, 5e-6, 5e-4, 2e-4)),
    "slow S": (s_curve(0.3, 1.2, 1.5, 0.25), 0.01, (3e-5, 5e-6, 3e-4, 1.5e-4)),
    "S without cruise": (s_curve(0.3, 1.2, 1.5, 0.74), 0.01, (2.5e-5, 6e-6, 2e-4, 1e-4)),
    "sine": (sine, 0.01, (2e-5, 0.0, 0.0, 1e-4)),
}


@pytest.mark.parametrize("jitter", [0.0, 0.3])
@pytest.mark.parametrize("name", PROFILES)
def test_error_of_the_angle(name, jitter):
    truth, step, bounds = PROFILES[name]
    recordings = [measure(truth, np.random.default_rng(seed), step=step, jitter=jitter) for seed in range(3)]
    measured = np.median([errors(smooth_motion(t, y, NOISE), truth, t) for t, y in recordings], axis=0)
    assert np.all(measured <= bounds), measured


@given(st.integers(0, 2**32 - 1), st.floats(0.3, 1.5), st.floats(0.4, 1.4), st.floats(0.06, 0.45), st.floats(0.3, 3.0))
@settings(max_examples=30, deadline=None)
def test_kinks_of_trapezoids_are_found(seed, turn, duration, part, start):
    edges, truth = trapezoid(start, turn, duration, part * duration)
    t, y = measure(truth, np.random.default_rng(seed), n=1000)
    drive = smooth_motion(t, y, NOISE)
    assert drive.kinks.size == 4
    np.testing.assert_allclose(drive.kinks, edges, atol=2e-3)
    for kink, sign in zip(drive.kinks, (1, -1, -1, 1), strict=True):
        left, right = drive.evaluate(kink, "left"), drive.evaluate(kink, "right")
        np.testing.assert_allclose(left[:2], right[:2], atol=1e-9)
        assert sign * (right[2] - left[2]) > 0.5 * np.abs(truth(t)[2]).max()


def test_smooth_moves_have_no_kinks():
    for name in ("quick S, 7 samples", "S", "slow S", "sine"):
        truth, step, _ = PROFILES[name]
        t, y = measure(truth, np.random.default_rng(5), step=step)
        drive = smooth_motion(t, y, NOISE)
        assert drive.kinks.size == 0
        left, right = drive.evaluate(drive.breakpoints[1:-1], "left"), drive.evaluate(drive.breakpoints[1:-1])
        np.testing.assert_allclose(left[2], right[2], atol=1e-6 * np.abs(right[2]).max())


@pytest.mark.parametrize("name", ["paper", "S", "sine"])
def test_acceleration_integrates_to_rate_and_angle(name):
    truth, step, _ = PROFILES[name]
    drive = smooth_motion(*measure(truth, np.random.default_rng(1), step=step), NOISE)
    start, stop = drive.breakpoints[:-1], drive.breakpoints[1:]
    nodes, weights = np.polynomial.legendre.leggauss(4)
    h = 0.5 * (stop - start)
    t = (0.5 * (start + stop) + h * nodes[:, None]).T.ravel()
    _, rate, acceleration = drive.evaluate(t).reshape(3, -1, 4)
    left, right = drive.evaluate(start), drive.evaluate(stop, "left")
    np.testing.assert_allclose(h * (rate @ weights), right[0] - left[0], atol=1e-13)
    np.testing.assert_allclose(h * (acceleration @ weights), right[1] - left[1], atol=1e-11)
    # what an arm at rest feels in the end: the whole motion from the accelerations alone
    moment = h * ((acceleration * (stop[-1] - t.reshape(-1, 4))) @ weights)
    turned = left[1, 0] * (stop[-1] - start[0]) + moment.sum()
    assert turned == pytest.approx(right[0, -1] - left[0, 0], abs=1e-9)


def test_nothing_rings_before_or_after_a_move():
    truth, _, _ = PROFILES["paper"]
    drive = smooth_motion(*measure(truth, np.random.default_rng(2)), NOISE)
    rest = np.concatenate([np.linspace(0.0, 0.99, 50), np.linspace(2.15, 24.9, 500)])
    value, rate, acceleration = drive.evaluate(rest)
    assert np.ptp(value[:50]) < 1e-9
    assert np.ptp(value[50:]) < 1e-9
    np.testing.assert_allclose([rate, acceleration], 0.0, atol=1e-9)


def test_outside_the_record_the_value_is_held():
    t = np.linspace(0.0, 1.0, 200)
    drive = smooth_motion(t, 0.5 * t**2, 1e-6)
    value, rate, acceleration = drive.evaluate([-1.0, 2.0])
    np.testing.assert_allclose(value, [0.0, 0.5], atol=1e-6)
    np.testing.assert_array_equal([rate, acceleration], 0.0)
    assert drive.evaluate(1.0, "left")[1, 0] == pytest.approx(1.0, abs=1e-4)
    assert drive.evaluate(1.0, "right")[1, 0] == 0.0


@pytest.mark.parametrize("n", [2, 3, 7, 8, 20])
@pytest.mark.parametrize("shape", [np.zeros_like, np.ones_like, np.square, lambda t: 3.0 * t])
def test_short_and_plain_records(n, shape):
    t = 0.01 * np.arange(n)
    np.testing.assert_allclose(smooth_motion(t, shape(t), NOISE).evaluate(t)[0], shape(t), atol=2e-4)


def test_encoder_without_stated_noise():
    truth, step, _ = PROFILES["paper"]
    t, y = measure(truth, np.random.default_rng(3), step=step)
    assert errors(build_drive(arm_recording(t, y), Rig("a", length=Quantity(1.0, 0.0))), truth, t)[0] < 2e-5


def test_quantised_encoder():
    truth, step, _ = PROFILES["paper"]
    t = step * np.arange(2500)
    y = 5e-4 * np.round(truth(t)[0] / 5e-4)
    rig = Rig("a", length=Quantity(1.0, 0.0), angle_noise=2.5e-4)
    assert errors(build_drive(arm_recording(t, y), rig), truth, t)[3] < 5e-4


def arm_recording(t, u):
    output = np.full((t.size, 2), np.nan)
    return Recording("r", t, u, output, ("tip_x", "tip_y"), ("m", "m"), np.ones(2), "", "r.csv")


def oscillator(interpolation):
    columns = Columns(TimeColumn(), InputColumn("u", "V", interpolation), OutputColumn("y", "V"))
    return Rig("o", kind="oscillator", columns=columns)


def multisine(t, n, step):
    """Random phases up to 0.4 of the sampling rate, the Silverbox's kind of input."""
    rng = np.random.default_rng(4)
    lines = np.arange(1, int(0.4 * n))
    phases = rng.uniform(0.0, 2.0 * np.pi, lines.size)
    return np.cos(2.0 * np.pi * lines * t[:, None] / (n * step) + phases).sum(axis=1) / np.sqrt(0.5 * lines.size)


def interpolation_error(interpolation):
    n, step = 1000, 1e-3
    t = step * np.arange(n)
    drive = build_drive(arm_recording(t, multisine(t, n, step)), oscillator(interpolation))
    fine = np.linspace(t[50], t[-50], 5003)
    return rms(drive.evaluate(fine)[0] - multisine(fine, n, step))


def test_interpolations_rank_as_theory_says():
    """Band limited, cubic spline, straight lines, hold: each better than the next on a band-limited input."""
    found = [interpolation_error(name) for name in ("band_limited", "spline", "linear", "hold")]
    assert found[0] < 0.01
    assert all(first < 0.7 * second for first, second in itertools.pairwise(found)), found


@pytest.mark.parametrize("interpolation", ["band_limited", "spline", "linear", "hold"])
def test_interpolations_pass_through_the_samples(interpolation):
    t = 0.5 + 0.02 * np.arange(200)
    u = np.random.default_rng(6).normal(size=200)
    drive = build_drive(arm_recording(t, u), oscillator(interpolation))
    np.testing.assert_allclose(drive.evaluate(t)[0], u, atol=1e-9)


def test_band_limited_is_exact_for_half_periods_and_their_rates():
    t = np.linspace(0.0, 1.0, 65)
    drive = build_drive(arm_recording(t, 2.0 + t + np.sin(12.0 * np.pi * t)), oscillator("band_limited"))
    fine = np.linspace(0.05, 0.95, 999)
    value, rate, _ = drive.evaluate(fine)
    np.testing.assert_allclose(value, 2.0 + fine + np.sin(12.0 * np.pi * fine), atol=2e-6)
    np.testing.assert_allclose(rate, 1.0 + 12.0 * np.pi * np.cos(12.0 * np.pi * fine), atol=2e-3)


def test_linear_and_hold_have_kinks_at_the_samples():
    t, u = np.array([0.0, 1.0, 3.0]), np.array([0.0, 2.0, -2.0])
    linear = build_drive(arm_recording(t, u), oscillator("linear"))
    np.testing.assert_array_equal(linear.kinks, t)
    np.testing.assert_allclose(linear.evaluate([0.5, 2.0])[:2], [[1.0, 0.0], [2.0, -2.0]])
    np.testing.assert_allclose(linear.evaluate([1.0], "left")[1], [2.0])
    np.testing.assert_allclose(linear.evaluate([1.0], "right")[1], [-2.0])
    hold = build_drive(arm_recording(t, u), oscillator("hold"))
    np.testing.assert_allclose(hold.evaluate([0.99, 1.0, 2.9, 3.0, 9.0])[0], [0.0, 2.0, 2.0, -2.0, -2.0])
    np.testing.assert_allclose(hold.evaluate([1.0], "left")[0], [0.0])


def test_free_decay_has_no_drive():
    recording = arm_recording(np.arange(5.0), np.zeros(5))
    columns = Columns(TimeColumn(), None, OutputColumn("y", "V"))
    assert build_drive(recording, Rig("o", kind="oscillator", columns=columns)) is None


def test_band_limited_needs_equal_spacing():
    t = np.cumsum(np.random.default_rng(0).uniform(0.5, 1.5, 100))
    with pytest.raises(InputError, match=r"r\.csv: the times are not equally spaced.*spline"):
        build_drive(arm_recording(t, np.sin(t)), oscillator("band_limited"))
