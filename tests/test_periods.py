"""The period of an input, and the stretches in which it comes again."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from discovery.signals.periods import find_periods


@settings(max_examples=25, deadline=None)
@given(
    period=st.integers(150, 700),
    count=st.integers(1, 4),
    extra=st.floats(0.7, 2.5),
    odd=st.booleans(),
    pause=st.sampled_from([0, 150]),
    scale=st.sampled_from([1e-6, 1.0, 1e6]),
    seed=st.integers(0, 2**32 - 1),
)
def test_any_period_is_found(
    period: int, count: int, extra: float, odd: bool, pause: int, scale: float, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    period += odd * (period % 2)  # half a period of odd lines is a whole number of samples
    length = period + int(extra * period)
    lines = np.arange(1, period // 3, 1 + odd)
    parts = []
    for _ in range(count):
        spectrum = np.zeros(period // 2 + 1, complex)
        spectrum[lines] = np.exp(2j * np.pi * rng.random(lines.size))
        one = np.fft.irfft(spectrum, period) * period / np.sqrt(2.0 * lines.size)
        parts += [np.tile(one, -(-length // period))[:length], np.zeros(pause)]
    u = np.concatenate(parts)
    found = find_periods(scale * (u + 1e-3 * rng.standard_normal(u.size)))
    assert found is not None
    assert found.period == period
    assert len(found.stretches) == count
    for i, (start, stop) in enumerate(found.stretches):
        assert i * (length + pause) <= start
        assert stop <= i * (length + pause) + length + 1
        assert stop - start >= period


@pytest.mark.parametrize(
    "signal",
    [
        lambda t, rng: rng.standard_normal(t.size),
        lambda t, rng: np.sin(0.5 * t**2),
        lambda t, rng: np.where(t > 5.0, 1.0, 0.0),
        lambda t, rng: np.minimum(t, 5.0) + 1e-5 * rng.standard_normal(t.size),
    ],
    ids=["white", "chirp", "step", "ramp"],
)
def test_what_does_not_repeat_has_no_period(signal) -> None:
    t = np.arange(8000) / 200.0
    u = signal(t, np.random.default_rng(14))
    found = find_periods(u - u.mean())
    # An aliased sweep resembles itself for a while, and less than an overview asks for.
    assert found is None or sum(stop - start for start, stop in found.stretches) < 0.8 * t.size


@pytest.mark.parametrize("tail", [10.0, 20.0, 30.0])
def test_the_slow_tail_of_a_step_repeats_nothing(tail: float) -> None:
    since = np.arange(700) / 500 - 0.1
    step = np.where(since < 0.0, 0.0, 200 * np.exp(-since / 0.05) * np.cos(4 * np.pi * since))
    step += np.where(since > 0.3, tail * np.exp((0.3 - since) / 2), 0.0)
    found = find_periods(step - step.mean())
    assert found is None or max(stop for _, stop in found.stretches) < 350
