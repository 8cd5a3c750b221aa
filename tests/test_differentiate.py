"""The smoother: exact on polynomials, accurate on noisy motion, honest about its own error."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from discovery.foundation.errors import InputError
from discovery.recordings.recording import Recording
from discovery.rigs.rig import Quantity, Rig
from discovery.signals.differentiate import smooth
from discovery.signals.motion import Motion, motion_of

W, XI = 2.9, 0.0458


def swing(t):
    """A decaying oscillation with its first two derivatives, complex exponential differentiated by hand."""
    s = -XI / 2 + 1j * W
    z = 0.7 * np.exp(s * t)
    return np.stack([z.real, (s * z).real, (s**2 * z).real])


def irregular(rng, n=2500, span=25.0):
    return np.sort(rng.uniform(0.0, span, n))


# (noise, largest rms error of value, rate, acceleration over the inner 96 %): a change of accuracy shows in a diff.
BOUNDS = [(3e-4, 8e-5, 6e-4, 8e-3), (1e-3, 2.5e-4, 1.5e-3, 2e-2), (3e-3, 7e-4, 4e-3, 4e-2)]


@pytest.mark.parametrize("layout", ["regular", "irregular", "gaps"])
@pytest.mark.parametrize("known", [True, False])
@pytest.mark.parametrize(("noise", "value", "rate", "acceleration"), BOUNDS)
def test_accuracy(noise, value, rate, acceleration, known, layout):
    rng = np.random.default_rng(3)
    t = np.arange(2500) / 100.0 if layout == "regular" else irregular(rng)
    y = swing(t)[0] + noise * rng.standard_normal(t.size)
    if layout == "gaps":
        y[400:430] = y[1500:1505] = np.nan
    track = smooth(t, y, noise if known else None)
    inner = (track.time > 0.5) & (track.time < 24.5)
    truth = swing(track.time)
    factor = 1.0 if layout == "regular" else 1.6
    for got, want, bound in zip((track.q, track.q_dot, track.q_ddot), truth, (value, rate, acceleration), strict=True):
        assert np.sqrt(np.mean((got - want)[inner] ** 2)) < factor * bound


@pytest.mark.parametrize("order", [0, 1, 2])
def test_standard_deviations_cover_the_error(order):
    rng = np.random.default_rng(0)
    t = np.arange(2500) / 100.0
    ratios = []
    for _ in range(10):
        track = smooth(t, swing(t)[0] + 1e-3 * rng.standard_normal(t.size), 1e-3)
        ratios.append((track.q, track.q_dot, track.q_ddot)[order] - swing(t)[order])
        ratios[-1] /= track.sd[order]
    assert 0.6 < np.sqrt(np.mean(np.square(ratios))) < 1.5


def test_noise_is_estimated_when_it_is_not_known():
    rng = np.random.default_rng(1)
    t = np.arange(2500) / 100.0
    track = smooth(t, swing(t)[0] + 1e-3 * rng.standard_normal(t.size))
    assert track.smoother.noise == pytest.approx(1e-3, rel=0.06)
    assert track.smoother.criterion == "generalised cross-validation"


def test_noisier_samples_count_less():
    rng = np.random.default_rng(2)
    t = np.arange(2000) / 100.0
    noise = np.where(t < 10.0, 1e-4, 1e-2)
    track = smooth(t, swing(t)[0] + noise * rng.standard_normal(t.size), noise)
    error = np.abs(track.q - swing(t)[0])
    assert np.sqrt(np.mean(error[t < 9.0] ** 2)) < 1e-4
    assert np.all(np.isfinite(track.sd))


@settings(max_examples=25, deadline=None)
@given(
    st.lists(st.floats(-3.0, 3.0), min_size=3, max_size=3),
    st.floats(1e-3, 1e3),
    st.integers(30, 200),
    st.integers(0, 10_000),
)
def test_quadratics_are_reproduced_at_any_scale_of_time(coefficients, span, n, seed):
    # The penalty does not see a quadratic: value, rate and acceleration are exact, whatever the sampling.
    t = span * np.sort(np.random.default_rng(seed).uniform(0.0, 1.0, n))
    u = t / span
    polynomial = np.polynomial.Polynomial(coefficients)
    track = smooth(t, polynomial(u), 1e-3)
    size = 1.0 + np.abs(coefficients).sum()
    for order, got in enumerate((track.q, track.q_dot, track.q_ddot)):
        assert np.allclose(got * span**order, polynomial.deriv(order)(u), atol=1e-4 * size)


def test_the_curve_and_its_derivatives_are_one():
    t = np.arange(1000) / 50.0
    track = smooth(t, swing(t)[0] + 1e-3 * np.random.default_rng(5).standard_normal(t.size), 1e-3)
    h = 1e-4
    inner = t[5:-5]
    numeric = (track.evaluate(inner + h) - track.evaluate(inner - h)) / (2 * h)
    assert np.allclose(numeric[0], track.evaluate(inner)[1], atol=1e-5)
    assert np.allclose(numeric[1], track.evaluate(inner)[2], atol=1e-4)
    assert np.array_equal(track.evaluate(t)[2], track.q_ddot)


@pytest.mark.parametrize(
    ("time", "values", "noise", "message"),
    [
        (np.arange(10.0), np.ones(10), 1.0, "too few"),
        (np.r_[0.0, 0.0, np.arange(1.0, 49.0)], np.ones(50), 1.0, "increase strictly"),
        (np.arange(50.0), np.ones(50), 0.0, "must be positive"),
    ],
)
def test_refusals(time, values, noise, message):
    with pytest.raises(InputError, match=message):
        smooth(time, values, noise)


class Ramp:
    """A motor at constant rate."""

    def evaluate(self, t):
        return np.stack([0.3 * t, np.full_like(t, 0.3), np.zeros_like(t)])


def arm(length=1.3):
    fields = dict.fromkeys(Rig.__dataclass_fields__)
    fields.update(name="arm", kind="flexible_arm", length=Quantity(length, 0.001))
    return Rig(**fields)


def recording(t, output, channels, noise):
    return Recording(
        name="r",
        time=t,
        input=None,
        output=output,
        channels=channels,
        units=("m",) * len(channels),
        noise=np.full(len(channels), noise),
        sha256="",
        source="",
    )


def test_an_arm_that_turns_more_than_once_is_unwrapped():
    t = np.arange(2500) / 100.0
    theta = 0.3 * t + 0.4 * np.sin(3.0 * t)  # beyond pi
    delta = theta - 0.3 * t
    rho = 1.3 * np.cos(0.44 * delta)
    output = np.column_stack([rho * np.cos(theta), rho * np.sin(theta)])
    output += 3e-4 * np.random.default_rng(0).standard_normal(output.shape)
    output[100:110, 0] = np.nan  # a gap in x alone hides the angle
    motion = motion_of(recording(t, output, ("tip_x", "tip_y"), 3e-4), arm(), Ramp())
    state = motion.state(t)
    assert np.abs(state.delta - delta)[20:-20].max() < 1e-3
    assert np.abs(state.delta_dot - 1.2 * np.cos(3.0 * t))[20:-20].max() < 2e-2
    assert motion.coordinate.time.size == t.size - 10
    assert np.abs(motion.radius.evaluate(t)[0] - rho / 1.3)[20:-20].max() < 1e-3


def test_a_tip_deflection_is_turned_into_an_angle():
    t = np.arange(1000) / 100.0
    delta = 0.5 * np.sin(3.0 * t)
    deflection = 1.3 * np.cos(delta / np.sqrt(5.0)) * np.sin(delta)
    motion = motion_of(recording(t, deflection[:, None], ("tip_deflection",), 3e-4), arm(), Ramp())
    assert np.abs(motion.state(t).delta - delta)[10:-10].max() < 2e-3
    with pytest.raises(InputError, match="motor_angle_rad"):
        motion_of(recording(t, deflection[:, None], ("tip_deflection",), 3e-4), arm(), None)


def test_an_oscillator_is_its_own_deflection():
    t = np.arange(1000) / 100.0
    motion = Motion("o", "oscillator", smooth(t, swing(t)[0], 1e-4), Ramp())
    state = motion.state(t)
    assert np.array_equal(state.delta, state.q)
    assert np.allclose(state.input, 0.3 * t)
