"""Pooled parameters: calibrated over simulated specimens, beside a sampler, and the limits that are known."""

from __future__ import annotations

import emcee
import numpy as np
import pytest
from scipy.stats import binomtest, norm

from discovery.foundation.errors import InputError
from discovery.posterior.pooled import Pooled, Quantity, pool

#: Rubin's eight schools: effects and their standard errors.
SCHOOLS = [28.0, 8.0, -3.0, 7.0, -1.0, 1.0, 18.0, 12.0], [15.0, 10.0, 16.0, 11.0, 9.0, 11.0, 10.0, 18.0]


def simulated(rng: np.random.Generator, n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, float, float]:
    """Return estimates, their sds, the true values, and the mean and spread that they are drawn from."""
    sds = np.exp(rng.normal(0.0, 0.7, n))
    scale, u = np.sqrt(1.0 / np.mean(1.0 / sds**2)), rng.random()
    spread = scale * u / (1.0 - u)
    true = rng.normal(3.0, spread, n)
    return rng.normal(true, sds), sds, true, 3.0, spread


def holds(quantity: Quantity, value: float) -> tuple[bool, bool]:
    return quantity.low < value < quantity.high, value < quantity.median


@pytest.mark.slow
@pytest.mark.parametrize("n", [2, 5, 12])
def test_intervals_hold_the_truth_as_often_as_they_say(n: int) -> None:
    rng = np.random.default_rng(n)
    found = []
    for _ in range(300):
        values, sds, true, mean, spread = simulated(rng, n)
        pooled = pool(values, sds)
        following = rng.normal(mean, spread)
        pairs = ((pooled.mean, mean), (pooled.spread, spread), (pooled.following, following),
                 (pooled.specimens[0], true[0]))  # fmt: skip
        found.append([holds(*pair) for pair in pairs])
    inside, below = np.moveaxis(np.array(found), -1, 0)
    for hits, share in ((inside, 0.95), (below, 0.5)):
        for count in hits.sum(axis=0):
            assert binomtest(int(count), len(found), share).pvalue > 1e-4


def test_it_agrees_with_a_sampler() -> None:
    y, sigma = map(np.array, SCHOOLS)
    scale = np.sqrt(1.0 / np.mean(1.0 / sigma**2))

    # The values in units of the spread, so that the sampler moves where it is small.
    def log_density(x: np.ndarray) -> np.ndarray:
        tau, apart = np.exp(x[:, 1]), x[:, 2:]
        likelihood = norm.logpdf(y, x[:, :1] + tau[:, None] * apart, sigma).sum(axis=1)
        return np.log(scale) - 2.0 * np.log(scale + tau) + x[:, 1] + norm.logpdf(apart).sum(axis=1) + likelihood

    sampler = emcee.EnsembleSampler(40, 10, log_density, vectorize=True)
    rng = np.random.default_rng(0)
    sampler.random_state = np.random.RandomState(1).get_state()
    start = np.column_stack([rng.normal(8.0, 3.0, 40), rng.normal(1.0, 1.0, 40), rng.normal(0.0, 1.0, (40, 8))])
    sampler.run_mcmc(start, 2000)
    draws = sampler.get_chain(discard=500, flat=True)
    tau = np.exp(draws[:, 1])
    pooled = pool(y, sigma)
    for found, sample in (
        (pooled.mean, draws[:, 0]),
        (pooled.spread, tau),
        (pooled.specimens[0], draws[:, 0] + tau * draws[:, 2]),
    ):
        expected = np.quantile(sample, [0.025, 0.5, 0.975])
        assert np.allclose([found.low, found.median, found.high], expected, atol=0.12 * np.ptp(expected))


def test_specimens_far_apart_stand_for_themselves() -> None:
    pooled = pool([1.0, 2.0, 3.0, 4.0], [1e-4] * 4)
    assert max(pooled.shrinkage) < 1e-6
    assert pooled.specimens[0].median == pytest.approx(1.0, abs=1e-6)
    assert 0.5 < pooled.spread.median < 3.0


def test_specimens_that_are_alike_become_one() -> None:
    rng = np.random.default_rng(1)
    pooled = pool(rng.normal(5.0, 1.0, 400), np.ones(400))
    assert min(pooled.shrinkage) > 0.9
    assert pooled.mean.median == pytest.approx(5.0, abs=0.2)
    assert pooled.mean.high - pooled.mean.low < 4.5 / np.sqrt(400)
    assert pooled.spread.high < 0.5


def test_nothing_depends_on_the_unit() -> None:
    values, sds = np.array(SCHOOLS)
    one, other = pool(values, sds), pool(1e-9 * values + 7e-6, 1e-9 * sds)
    assert isinstance(other, Pooled)
    assert other.shrinkage == pytest.approx(one.shrinkage, rel=1e-6)
    assert other.mean.high == pytest.approx(7e-6 + 1e-9 * one.mean.high, rel=1e-9)
    assert other.spread.median == pytest.approx(1e-9 * one.spread.median, rel=1e-6)


def test_a_worse_estimate_is_moved_further() -> None:
    pooled = pool([0.0, 0.0, 2.0, 2.0], [0.3, 0.3, 0.3, 3.0])
    assert pooled.shrinkage[3] > 5 * pooled.shrinkage[2]
    assert abs(pooled.specimens[3].median - pooled.mean.median) < abs(2.0 - pooled.mean.median)


@pytest.mark.parametrize(("values", "sds"), [([1.0], [1.0]), ([1.0, 2.0], [1.0, 0.0]), ([1.0, np.nan], [1.0, 1.0]),
                                             ([1.0, 2.0], [1.0])])  # fmt: skip
def test_what_cannot_be_pooled_is_refused(values: list[float], sds: list[float]) -> None:
    with pytest.raises(InputError):
        pool(values, sds)
