from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.special import ellipk

from discovery.signals.amplitude import backbone

PERIOD = 2.0
OMEGA = 2 * np.pi / PERIOD


def decay(t: np.ndarray, amplitude: float = 0.5, loss: float = 0.05, phase: float = 0.0) -> np.ndarray:
    """Linear oscillator whose rate of energy loss is `loss`, with damped angular frequency OMEGA."""
    return amplitude * np.exp(-loss * t / 2) * np.cos(OMEGA * t + phase)


@settings(deadline=None, max_examples=40)
@given(st.floats(0.0, 2 * np.pi), st.floats(0.02, 0.2), st.floats(1.6, 2.4), st.floats(0.0, 3.0))
def test_a_linear_decay_has_one_frequency_and_one_damping(phase: float, loss: float, guess: float, start: float):
    t = np.arange(0.0, 25.0, 0.01)
    found = backbone(t, decay(t, loss=loss, phase=phase), guess, start)
    # One swing a half period; the ends cost two and a half periods at most.
    assert (25.0 - start) / (PERIOD / 2) - 5 <= found.frequency.size <= (25.0 - start) / (PERIOD / 2)
    np.testing.assert_allclose(found.frequency, 1 / PERIOD, rtol=2e-3)
    np.testing.assert_allclose(found.damping, loss, rtol=0.05)


def test_the_amplitude_is_the_envelope() -> None:
    t = np.arange(0.0, 25.0, 0.01)
    found = backbone(t, decay(t), PERIOD, 0.0)
    # The maximum at the very start is half an arc; the second swing after the next extreme is the first that has two
    # neighbours, and its middle is one and a quarter periods after the start.
    first = np.exp(-0.05 * 1.25 * PERIOD / 2) * 0.5
    assert found.amplitude[0] == pytest.approx(first, rel=0.01)
    ratio = found.amplitude[1:] / found.amplitude[:-1]
    np.testing.assert_allclose(ratio, np.exp(-0.05 * PERIOD / 4), rtol=1e-3)


def test_the_offset_of_the_rest_position_cancels() -> None:
    t = np.arange(0.0, 25.0, 0.01)
    centred, off = (backbone(t, decay(t) + shift, PERIOD, 0.0) for shift in (0.0, 0.08))
    np.testing.assert_allclose(off.frequency, centred.frequency, rtol=2e-3)
    np.testing.assert_allclose(off.amplitude, centred.amplitude, rtol=2e-3)
    np.testing.assert_allclose(off.damping, centred.damping, rtol=0.02)


def test_the_frequency_of_a_hard_spring_follows_the_elliptic_integral() -> None:
    alpha, beta, loss = 9.0, 2.0, 0.05
    t = np.arange(0.0, 40.0, 0.01)
    path = solve_ivp(
        lambda _, z: (z[1], -loss * z[1] - alpha * z[0] - beta * z[0] ** 3), (0, 40), (1.0, 0.0), t_eval=t, rtol=1e-10
    )
    found = backbone(t, path.y[0], 2 * np.pi / 3, 0.0)
    stiff = alpha + beta * found.amplitude**2
    exact = np.sqrt(stiff) / (4 * ellipk(beta * found.amplitude**2 / (2 * stiff)))
    assert found.amplitude[0] > 0.9
    assert found.amplitude[-1] < 0.45
    np.testing.assert_allclose(found.frequency, exact, rtol=2e-3)


def test_dry_friction_damps_small_swings_more() -> None:
    # A swing loses the same height each time: 4 f / alpha a period.
    t = np.arange(0.0, 20.0, 0.005)
    fall = 0.02
    steps = np.floor(2 * t / PERIOD)
    swing = (0.5 - fall * (steps + 0.5) / 2) * np.cos(OMEGA * t) + fall / 4 * (-1) ** steps
    found = backbone(t, swing, PERIOD, 0.0)
    np.testing.assert_allclose(found.damping * found.amplitude, 2 * fall / PERIOD, rtol=0.05)
    assert (np.diff(found.damping) > 0).all()


def test_noise_and_gaps_are_borne() -> None:
    t = np.arange(0.0, 25.0, 0.01)
    d = decay(t) + 3e-4 * np.random.default_rng(0).standard_normal(t.size)
    d[700:760] = np.nan
    found = backbone(t, d, PERIOD, 0.5)
    assert found.frequency.size >= 20
    assert np.median(found.frequency) == pytest.approx(1 / PERIOD, rel=1e-3)
    assert np.median(found.damping) == pytest.approx(0.05, rel=0.05)


@pytest.mark.parametrize(("end", "start"), [(3.0, 0.0), (25.0, 22.0), (25.0, np.inf)])
def test_too_short_a_decay_says_nothing(end: float, start: float) -> None:
    t = np.arange(0.0, end, 0.01)
    found = backbone(t, decay(t), PERIOD, start)
    assert found.amplitude.size == found.frequency.size == found.damping.size == 0


def test_a_motion_without_turning_says_nothing() -> None:
    t = np.arange(0.0, 25.0, 0.01)
    assert backbone(t, np.exp(-t), PERIOD, 0.0).frequency.size == 0
