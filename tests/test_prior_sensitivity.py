"""Priors within their bounds against scipy's laws, and reweighted posteriors against conjugate ones."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from discovery.declarations.priors import Flat, HalfStudent, LogNormal, LogUniform, Normal, Student
from discovery.posterior.priors import MarginalPrior, prior_effects

EVERYWHERE = (-math.inf, math.inf)


@pytest.mark.parametrize(
    ("prior", "unit", "bounds", "sd"),
    [
        (Normal(0.4, 2.0), 3.0, EVERYWHERE, 6.0),
        (Normal(0.0, 1.0), 2.0, (0.0, math.inf), 2.0 * stats.halfnorm.std()),
        (Normal(1.0, 2.0), 1.0, (0.0, 1.5), stats.truncnorm(-0.5, 0.25, 1.0, 2.0).std()),
        (HalfStudent(0.3), 10.0, (0.0, math.inf), 3.0 * math.sqrt(3.0 - 12.0 / math.pi**2)),
        (Student(0.3), 10.0, EVERYWHERE, 3.0 * math.sqrt(3.0)),
        (LogNormal(2.0, 0.7), 5.0, (1e-3, math.inf), stats.lognorm(0.7, scale=10.0).std()),
        (LogUniform(2.0, 100.0), 3.0, (0.06, 600.0), 6.0 * stats.loguniform.std(0.01, 100.0)),
        (LogUniform(2.0, 100.0), 3.0, (-600.0, -0.06), 6.0 * stats.loguniform.std(0.01, 100.0)),
        (Flat(), 1.0, (-1.0, 5.0), 6.0 / math.sqrt(12.0)),
        (Flat(), 1.0, EVERYWHERE, math.inf),
    ],
)
def test_the_width_of_a_prior_within_its_bounds(prior, unit, bounds, sd) -> None:
    assert MarginalPrior(prior.scaled(unit), bounds).sd == pytest.approx(sd, rel=1e-4)


def test_nothing_is_believed_beyond_the_bounds() -> None:
    prior = MarginalPrior(Normal(0.0, 1.0), (0.0, 1.0))
    assert np.array_equal(np.isfinite(prior.log_density([-0.1, 0.0, 1.0, 1.1])), [False, True, True, False])


@pytest.mark.parametrize("prior", [Normal(0.5, 1.0), HalfStudent(0.7), LogNormal(0.8, 0.4)])
def test_a_wider_prior_keeps_its_centre(prior) -> None:
    before, after = prior.summary(), prior.widened(2.0).summary()
    assert before.pop("law") == after.pop("law")
    for key, value in before.items():
        assert after[key] == pytest.approx(value * (1.0 if key in ("mean", "median") else 2.0))


def _conjugate(prior_sd: float, reading: float, noise: float) -> tuple[float, float]:
    precision = prior_sd**-2 + noise**-2
    return reading / noise**2 / precision, precision**-0.5


@settings(max_examples=15, deadline=None)
@given(st.floats(-1.5, 1.5), st.floats(0.1, 0.8), st.integers(0, 1000))
def test_reweighted_draws_are_those_of_the_other_prior(reading: float, noise: float, seed: int) -> None:
    mean, sd = _conjugate(1.0, reading, noise)
    draws = {"a": np.random.default_rng(seed).normal(mean, sd, 200_000)}
    (row,) = prior_effects(draws, {"a": MarginalPrior(Normal(0.0, 1.0), EVERYWHERE)})
    assert row.contraction == pytest.approx(1 - sd**2, abs=0.01)
    for factor in (0.5, 2.0):
        other_mean, other_sd = _conjugate(factor, reading, noise)
        assert row.shift[factor] == pytest.approx((other_mean - mean) / sd, abs=0.03)
        assert row.sd_ratio[factor] == pytest.approx(other_sd / sd, abs=0.02)


def test_only_a_prior_that_matters_is_reported() -> None:
    rng = np.random.default_rng(4)
    priors = {
        "loose": MarginalPrior(Normal(0.0, 100.0), EVERYWHERE),
        "tight": MarginalPrior(Normal(0.0, 1.0), EVERYWHERE),
        "flat": MarginalPrior(Flat(), EVERYWHERE),
    }
    mean, sd = _conjugate(1.0, 2.0, 1.0)
    draws = {name: rng.normal(mean, sd, 50_000) for name in priors}
    rows = {row.name: row for row in prior_effects(draws, priors)}
    assert [rows[n].sensitive for n in priors] == [False, True, False]
    assert rows["flat"].contraction == 1.0


def test_too_few_draws_that_count_are_no_answer() -> None:
    draws = {"a": np.random.default_rng(5).normal(8.0, 1.0, 5000)}
    (row,) = prior_effects(draws, {"a": MarginalPrior(Normal(0.0, 1.0), EVERYWHERE)})
    assert row.effective[0.5] * row.draws < 100
    assert row.sensitive
