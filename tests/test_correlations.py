"""Correlations and autocorrelations against known ones."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from discovery.posterior.correlations import autocorrelation, correlations


def _posterior(draws: np.ndarray, names: tuple[str, ...], **others):
    return SimpleNamespace(
        names=names,
        draws=draws,
        flat=lambda: {n: draws[..., i].ravel() for i, n in enumerate(names)},
        **others,
    )


def test_the_strongest_pair_comes_first() -> None:
    covariance = np.array([[1.0, -0.9, 0.0, 0.4], [-0.9, 1.0, 0.0, -0.4], [0.0, 0.0, 1.0, 0.0], [0.4, -0.4, 0.0, 1.0]])
    factor = np.linalg.cholesky(covariance)
    draws = np.random.default_rng(1).standard_normal((4, 500, 16, 4)) @ factor.T
    names = ("alpha", "beta", "delta_0_init[a]", "sigma")
    found = correlations(_posterior(draws * [1e3, 1.0, 1.0, 1e-3], names))
    assert found.names == ("alpha", "beta", "sigma")
    assert found.matrix == pytest.approx(covariance[np.ix_([0, 1, 3], [0, 1, 3])], abs=0.02)
    pairs = found.summary()["pairs"]
    assert pairs[0]["pair"] == ["alpha", "beta"]
    assert pairs[0]["correlation"] == pytest.approx(-0.9, abs=0.02)
    assert {tuple(p["pair"]) for p in pairs[1:]} == {("alpha", "sigma"), ("beta", "sigma")}


def test_chains_of_first_order_forget_exponentially() -> None:
    rng, phi = np.random.default_rng(2), 0.7
    draws = np.empty((3, 600, 64, 1))
    draws[:, 0] = rng.standard_normal((3, 64, 1))
    for k in range(1, 600):
        draws[:, k] = phi * draws[:, k - 1] + np.sqrt(1 - phi**2) * rng.standard_normal((3, 64, 1))
    tau = (1 + phi) / (1 - phi)
    found = autocorrelation(_posterior(5.0 + 0.1 * draws, ("xi",), tau={"xi": 3 * tau}, provenance={"thin": 3}))
    k = np.arange(found.lags.size)
    assert np.array_equal(found.lags, 3.0 * k)
    assert found.lags[-1] >= 6 * 3 * tau
    assert found.functions["xi"].shape == (3, k.size)
    assert np.abs(found.functions["xi"] - phi**k).max() < 0.05
