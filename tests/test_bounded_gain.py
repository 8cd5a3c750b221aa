from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

from discovery.screening.bounded_gain import bounded_gains


def gains(parts: np.ndarray, target: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return gains, solutions and bases of stacks of vectors (t, k, n)."""
    gain, solution, transform = bounded_gains(parts @ parts.transpose(0, 2, 1), parts @ target, lower, upper)
    return gain, solution, transform @ parts


def by_the_book(part: np.ndarray, target: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> float:
    """The fall of the sum of squares that a dense solver finds on the whole vectors."""
    solution = lsq_linear(part.T, -target, (lower, upper), method="bvls", tol=1e-14)
    return float(target @ target) - 2 * solution.cost


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 4), st.floats(0.02, 3.0))
def test_gains_are_those_of_a_dense_solver_within_bounds(seed: int, k: int, width: float) -> None:
    rng = np.random.default_rng(seed)
    # Vectors of very different sizes, some bounds active and some not, some of one sign.
    parts = rng.standard_normal((5, k, 30)) * 10.0 ** rng.uniform(-6, 6, (5, k, 1))
    target = rng.standard_normal(30)
    size = 1 / np.linalg.norm(parts, axis=2)
    lower, upper = -width * size * (rng.random((5, k)) < 0.5), width * size
    gain, solution, basis = gains(parts, target, lower, upper)
    for i in range(5):
        assert gain[i] == pytest.approx(by_the_book(parts[i], target, lower[i], upper[i]), rel=1e-8, abs=1e-8)
        left = target + solution[i] @ parts[i]
        assert gain[i] == pytest.approx(target @ target - left @ left, rel=1e-8, abs=1e-8)
        assert basis[i] @ basis[i].T == pytest.approx(np.eye(k), abs=1e-5)
        # The basis spans the vectors.
        own = np.asarray(basis[i], float)
        assert np.linalg.norm(parts[i] - parts[i] @ own.T @ own, axis=1) * size[i] == pytest.approx(0, abs=1e-5)
    assert ((solution >= lower * (1 + 1e-12)) & (solution <= upper * (1 + 1e-12))).all()


@pytest.mark.parametrize("angle", [1e-2, 1e-3, 1e-4])
def test_nearly_parallel_vectors_lose_no_digits(angle: float) -> None:
    rng = np.random.default_rng(1)
    q = np.linalg.qr(rng.standard_normal((40, 2)))[0].T
    parts = np.array([[q[0], q[0] + angle * q[1]]])
    target = 3 * q[0] - 2 * q[1]
    free = np.full((1, 2), np.inf)
    gain, _, basis = gains(parts, target, -free, free)
    # Both directions are there, so all of it can go.
    assert gain[0] == pytest.approx(13.0, rel=1e-6)
    assert np.linalg.svd(basis[0] @ q.T, compute_uv=False) == pytest.approx([1.0, 1.0], abs=1e-5)


def test_a_vector_of_zeros_and_a_repeated_one_gain_nothing_more() -> None:
    rng = np.random.default_rng(2)
    a, target = rng.standard_normal((2, 20))
    alone = (a @ target) ** 2 / (a @ a)
    parts = np.array([[a, a], [a, np.zeros(20)], [np.zeros(20), np.zeros(20)]])
    bound = np.full((3, 2), 100.0)
    gain, _, basis = gains(parts, target, -bound, bound)
    assert gain == pytest.approx([alone, alone, 0.0], abs=1e-10)
    # What is not spanned has no direction.
    assert np.linalg.norm(basis, axis=2).max(axis=1) == pytest.approx([1.0, 1.0, 0.0])
    assert np.sum(basis**2, axis=(1, 2)) == pytest.approx([1.0, 1.0, 0.0])


def test_a_vector_of_rounding_has_a_basis_that_single_precision_holds() -> None:
    rng = np.random.default_rng(3)
    a, b, target = rng.standard_normal((3, 20))
    parts = np.array([[a, 1e-45 * b]])
    bound = np.full((1, 2), 100.0)
    gain, _, _ = gains(parts, target, -bound, bound)
    assert gain == pytest.approx([(a @ target) ** 2 / (a @ a)], abs=1e-10)
    transform = bounded_gains(parts @ parts.transpose(0, 2, 1), parts @ target, -bound, bound)[2]
    assert np.abs(transform).max() < np.finfo(np.float32).max
