"""Scalar products within groups of vectors are those of numpy in double precision."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from discovery.screening.bounded_gain import grams


@given(st.integers(1, 6), st.integers(1, 40), st.integers(1, 5), st.integers(1, 4), st.integers(0, 2**32 - 1))
def test_products_are_those_of_every_group(vectors: int, n: int, groups: int, k: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    own = rng.standard_normal((vectors, n)).astype(np.float32)
    target = rng.standard_normal(n)
    rows = rng.integers(vectors, size=(groups, k))
    gram, push = grams(own, rows, target)
    parts = own.astype(float)[rows]
    assert gram == pytest.approx(parts @ parts.transpose(0, 2, 1), rel=1e-12, abs=1e-12 * n)
    assert push == pytest.approx(parts @ target, rel=1e-12, abs=1e-12 * n)


def test_sums_are_double_precision() -> None:
    # In single precision the small number would be lost beside the large one.
    vector = np.array([[1e4, 1.0, -1e4]], dtype=np.float32)
    gram, push = grams(vector, np.array([[0]]), np.array([1e4, 1e-3, 1e4]))
    assert gram[0, 0, 0] == 2e8 + 1
    assert push[0, 0] == pytest.approx(1e-3, rel=1e-4)
