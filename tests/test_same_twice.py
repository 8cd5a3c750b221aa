"""Two parameters that do the same: what rounding leaves of their difference is no evidence."""

from __future__ import annotations

import numpy as np
import pytest

from discovery.estimation.laplace import Prior, mode_of


def evidence(*columns: np.ndarray, residual: np.ndarray) -> float:
    """Return the log evidence of a linear problem with unit noise, its parameters believed within one [nats]."""
    p = len(columns)
    x = np.column_stack([*columns, residual])
    free = np.full(p, np.inf)
    log_density = -0.5 * p * float(np.log(2 * np.pi))
    prior = Prior(np.zeros(p), np.eye(p), np.eye(p), log_density, -free, free, np.zeros(p, bool))
    return mode_of(x.T @ x, 0.0, len(x), prior).log_evidence


@pytest.mark.parametrize("size", [1e2, 1e6, 1e9, 1e12])
def test_a_column_that_is_there_twice_gains_no_more_than_its_wider_prior(size: float) -> None:
    rng = np.random.default_rng(1)
    shape = np.linspace(0.1, 1.0, 200)
    column, residual = size * shape, rng.standard_normal(200) + 3.0 * shape
    once, twice = (evidence(*[column] * k, residual=residual) for k in (1, 2))
    # Their sum is believed within the root of two. Of what is told far better than it is believed, rounding is left.
    assert twice - once == pytest.approx(-0.5 * np.log(2.0), abs=1e-3 if size < 1e5 else 20.0)
