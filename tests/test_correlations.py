"""Correlations and autocorrelations against known ones, and what is said of pairs of parameters."""

from __future__ import annotations

from itertools import combinations
from types import SimpleNamespace

import numpy as np
import pytest

from discovery.declarations.registry import catalogue
from discovery.equations.model import Model
from discovery.posterior.correlations import autocorrelation, correlations, shared

ARM = Model("constant_radius", ("viscous_damping", "linear_stiffness", "cubic_stiffness", "coulomb_friction"))


def _posterior(draws: np.ndarray, names: tuple[str, ...], **others):
    return SimpleNamespace(
        names=names,
        draws=draws,
        model=ARM,
        flat=lambda: {n: draws[..., i].ravel() for i, n in enumerate(names)},
        **others,
    )


def test_the_strongest_pair_comes_first_with_its_meaning() -> None:
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
    assert pairs[0]["meaning"] == shared(ARM, "alpha", "beta")
    assert {tuple(p["pair"]) for p in pairs[1:]} == {("alpha", "sigma"), ("beta", "sigma")}
    assert all("noise should not depend on the motion" in p["meaning"] for p in pairs[1:])


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


@pytest.mark.parametrize(
    ("base", "effects", "pair", "words"),
    [
        ("constant_radius", ("linear_stiffness", "cubic_stiffness"), ("beta", "alpha"), "alpha is the stiffness at sm"),
        ("constant_radius", ("linear_stiffness", "stiffness_drift"), ("alpha", "r"), "mostly their sum is seen"),
        ("constant_radius", ("viscous_damping", "coulomb_friction"), ("xi", "f_c"), "they share"),
        ("constant_radius", ("radius_law", "position_scale"), ("gamma", "s"), "where the instrument sees the tip"),
        ("constant_radius", ("viscous_damping", "hysteresis"), ("h_b", "xi"), "an inner state loses energy too"),
        ("constant_radius", ("hysteresis",), ("h_b", "w_h"), "both belong to hysteresis"),
        ("constant_radius", ("linear_stiffness", "sensor_delay"), ("tau", "alpha"), "what the instrument adds"),
        ("constant_radius", ("input_gain", "angle_offset"), ("k_h", "theta_0"), "the same frame"),
        ("constant_radius", ("linear_stiffness", "tip_rotary_inertia"), ("alpha", "J"), "stiffness over inertia"),
        ("elastica", ("linear_stiffness",), ("mu", "alpha"), "stiffness over inertia"),
        ("oscillator", ("linear_stiffness",), ("g", "alpha"), "drive over stiffness"),
        ("oscillator", ("viscous_damping",), ("xi", "g"), "drive over loss"),
    ],
)
def test_what_two_parameters_share(base: str, effects: tuple[str, ...], pair: tuple[str, str], words: str) -> None:
    model = Model(base, effects)
    assert words in shared(model, *pair)
    assert shared(model, *pair) == shared(model, *pair[::-1])


def test_something_is_said_of_every_pair_of_effects() -> None:
    effects = [e for e in catalogue().values() if "flexible_arm" in e.systems and e.parameters()]
    for a, b in combinations(effects, 2):
        model = Model("constant_radius", (a.id(), b.id()))
        names = a.parameters()[0].name, b.parameters()[0].name
        assert len(shared(model, *names)) > 20
