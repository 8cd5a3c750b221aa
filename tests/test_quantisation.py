"""The part of rounding that lasts over readings, and what it takes from the model error."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from discovery.recordings.reading_noise import lasting_rounding, quantum

STEP, TIME = 0.5, np.arange(4000) * 0.01
ROUNDING = STEP / np.sqrt(12.0)


def rounded(speed: float) -> np.ndarray:
    return STEP * np.round(4000 * speed * np.sin(TIME / 20.0) / STEP)


@given(speed=st.floats(0.002, 20.0))
def test_it_is_what_neighbouring_errors_share(speed: float) -> None:
    true, read = 4000 * speed * np.sin(TIME / 20.0), rounded(speed)
    error = read - true
    shared = np.mean(error[1:] * error[:-1]) / np.mean(error**2)
    found = lasting_rounding(read, float(ROUNDING)) / ROUNDING
    assert 0.0 <= found <= 1.0
    # Errors that hardly share anything count for little, those that last for almost all.
    assert found**2 == pytest.approx(max(shared, 0.0), abs=0.25)


def test_noise_of_several_steps_makes_rounding_random_and_no_step_none() -> None:
    slow = rounded(0.004)
    assert lasting_rounding(slow, float(ROUNDING)) > 0.9 * ROUNDING
    assert lasting_rounding(slow, 3 * float(ROUNDING)) == 0.0
    assert lasting_rounding(np.random.default_rng(0).standard_normal(500), 1.0) == 0.0


def test_the_step_of_two_readings_is_their_difference() -> None:
    assert quantum(np.array([0.7, 0.7, np.nan, 1.2, 0.7])) == pytest.approx(0.5)
    assert quantum(np.array([0.7, 0.7, np.nan])) == 0.0
