"""Where samples are missing: by the length of a step, unless a clock is read in whole units of about a step."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from discovery.foundation.sampling import gaps


@given(step=st.floats(1.1, 3.0), begin=st.floats(0.0, 1.0), scale=st.sampled_from([1e-3, 1.0, 7.0]))
def test_a_clock_that_is_rounded_misses_nothing(step: float, begin: float, scale: float) -> None:
    assert not gaps(scale * np.round(begin + step * np.arange(500))).any()


@pytest.mark.parametrize("step", [1.1, 1.4])
def test_a_pause_of_such_a_clock_is_a_gap(step: float) -> None:
    time = np.round(step * np.arange(400))
    time[200:] += 5.0
    assert np.flatnonzero(gaps(time)).tolist() == [199]


@pytest.mark.parametrize("step", [2.2, 2.4, 3.4])
def test_a_sample_that_a_rounded_clock_lost_is_a_gap(step: float) -> None:
    kept = np.setdiff1d(np.arange(2000), np.arange(50, 2000, 100))
    assert gaps(np.round(step * kept)).sum() == 20


@pytest.mark.parametrize("every", [4, 5, 10])
def test_samples_lost_in_turn_are_gaps_where_no_clock_is_rounded(every: int) -> None:
    time = np.arange(2000) + 0.01 * np.random.default_rng(1).standard_normal(2000)
    time = time[np.arange(2000) % every != 1]
    assert np.array_equal(gaps(time), np.diff(time) > 1.5)


@pytest.mark.parametrize("lost", [0.01, 0.05, 0.2, 0.4])
def test_samples_lost_by_chance_are_gaps(lost: float) -> None:
    time = np.flatnonzero(np.random.default_rng(3).random(2000) > lost).astype(float)
    assert np.array_equal(gaps(time), np.diff(time) > 1.5)
