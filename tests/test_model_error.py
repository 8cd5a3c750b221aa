"""The likelihood of noise and model error: against dense algebra, for gaps and irregular times."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import cho_factor, cho_solve

from discovery.estimation.model_error import Channel, ModelError, innovations


def covariance(time: np.ndarray, error: ModelError) -> np.ndarray:
    lag = np.abs(np.subtract.outer(time, time)) / error.memory
    return np.eye(time.size) + error.size**2 * (1 + lag) * np.exp(-lag)


@settings(max_examples=60, deadline=None)
@given(
    gaps=st.lists(st.floats(1e-3, 3.0), min_size=2, max_size=40),
    size=st.floats(0.0, 50.0),
    memory=st.floats(0.02, 20.0),
    seed=st.integers(0, 2**31),
)
def test_innovations_have_the_dense_quadratic_form_and_determinant(gaps, size, memory, seed) -> None:
    time = np.cumsum(gaps)
    columns = np.random.default_rng(seed).normal(size=(time.size, 3))
    error = ModelError(size, memory)
    white, logarithms = innovations(time, columns, error)
    dense = covariance(time, error)
    assert white.T @ white == pytest.approx(columns.T @ cho_solve(cho_factor(dense), columns), rel=1e-8, abs=1e-8)
    assert logarithms == pytest.approx(np.linalg.slogdet(dense)[1], rel=1e-9, abs=1e-9)


def test_gains_that_have_settled_do_so_anew_behind_a_gap_and_at_another_rate() -> None:
    apart = np.r_[np.full(300, 0.1), 2.0, np.full(100, 0.1), np.full(200, 0.25), np.full(100, 0.1)]
    time, error = 7.0 + np.cumsum(apart), ModelError(4.0, 0.3)
    columns = np.random.default_rng(3).normal(size=(time.size, 2))
    white, logarithms = innovations(time, columns, error)
    dense = covariance(time, error)
    assert white.T @ white == pytest.approx(columns.T @ np.linalg.solve(dense, columns), rel=1e-10)
    assert logarithms == pytest.approx(np.linalg.slogdet(dense)[1], rel=1e-11)


def test_no_model_error_leaves_columns_as_they_are() -> None:
    columns = np.random.default_rng(1).normal(size=(50, 2))
    gram, logarithms = Channel(np.arange(50.0), columns).gram(ModelError(0.0, 1.0))
    assert np.array_equal(gram, columns.T @ columns)
    assert logarithms == 0.0


def test_a_gap_is_a_gap_and_no_zero() -> None:
    time = np.linspace(0, 10, 400)
    error = ModelError(3.0, 0.5)
    y = np.random.default_rng(2).normal(size=(400, 1))
    here = (time < 4) | (time > 6)
    white, logarithms = innovations(time[here], y[here], error)
    dense = covariance(time, error)[np.ix_(here, here)]
    assert float(white[:, 0] @ white[:, 0]) == pytest.approx(float(y[here, 0] @ np.linalg.solve(dense, y[here, 0])))
    assert logarithms == pytest.approx(np.linalg.slogdet(dense)[1])
