"""Independence chains: bent and straight densities whose moments are known, and those that they must refuse."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy import stats

from discovery.estimation.importance import importance_sample, pooled, weighed
from discovery.estimation.proposal import Bend, Proposal
from discovery.posterior.checkpoint import Remembered
from discovery.posterior.ensembles import TEMPERED, grow, start_ensembles
from discovery.posterior.independence import LARGEST_K, Chains, independence_chains

FloatArray = np.ndarray
LogDensity = Callable[[FloatArray], FloatArray]


def chains(log_density: LogDensity, dimension: int, seed: int, effective: float = 4000) -> Chains | None:
    """What comes of a density after the first steps of walkers, as in a posterior."""
    seeds = np.random.SeedSequence(seed).spawn(9)
    group = start_ensembles(log_density, dimension, walkers=64, seeds=seeds[:4])
    assert list(grow(group, TEMPERED)) == [TEMPERED]
    seen = np.concatenate([e.chain for e in group]).reshape(-1, dimension)
    return independence_chains(
        log_density,
        np.eye(dimension),
        (seen, np.concatenate([e.log_prob for e in group]).ravel()),
        seeds=seeds[4:],
        values=lambda z: z,
        wanted=(effective, 1.01),
        tell=lambda *_: None,
    )


def banana(z: FloatArray) -> FloatArray:
    """The first is normal, and the second is normal around a parabola of the first."""
    return -0.5 * (z[:, 0] ** 2 + ((z[:, 1] - 1.5 * (z[:, 0] ** 2 - 1)) / 0.3) ** 2 + (z[:, 2:] ** 2).sum(axis=1))


def funnel(z: FloatArray) -> FloatArray:
    """The first sets the width of the others by orders of magnitude."""
    width = np.exp(1.5 * z[:, 0])
    return -0.5 * (z[:, 0] ** 2 + (z[:, 1:] ** 2).sum(axis=1) / width**2) - (z.shape[1] - 1) * np.log(width)


def peaks(z: FloatArray, apart: float) -> FloatArray:
    """Two thirds around the origin, and a third somewhere else."""
    away = np.zeros(z.shape[1])
    away[0] = apart
    return np.logaddexp(np.log(2) - 0.5 * (z**2).sum(axis=1), -0.5 * ((z - away) ** 2).sum(axis=1))


def test_a_normal_density_has_its_quantiles() -> None:
    found = chains(lambda z: -0.5 * (z**2).sum(axis=1), 5, 1)
    assert found is not None
    assert found.pareto_k < LARGEST_K
    assert found.accepted > 0.6
    assert found.found.meets(4000, 1.01)
    thin = int(2 * found.found.tau.max() + 1)
    for column in found.points[:, ::thin].reshape(-1, 5).T:
        assert stats.kstest(column, "norm").pvalue > 1e-4
    assert found.log_density == pytest.approx(-0.5 * (found.points**2).sum(axis=2), abs=1e-9)


def test_a_banana_is_bent_and_has_its_moments() -> None:
    found = chains(banana, 4, 1)
    assert found is not None
    x, y = found.points[..., 0], found.points[..., 1]
    rest = (y - 1.5 * (x**2 - 1)) / 0.3
    error = 4.5 / np.sqrt(found.found.ess.min())
    for values in (x, rest):
        assert values.mean() == pytest.approx(0, abs=error)
        assert values.var() == pytest.approx(1, abs=2 * error)


def test_the_bend_makes_evidence_of_a_banana_reliable() -> None:
    exact = 2 * np.log(2 * np.pi) + np.log(0.3)
    straight, bent = (
        importance_sample(banana, 4, np.random.default_rng(3), 2000, frame=frame) for frame in (None, np.eye(4))
    )
    assert bent.reliable
    assert bent.log_integral == pytest.approx(exact, abs=4 * bent.error)
    assert bent.effective > 2 * straight.effective


def stopped(z: FloatArray) -> FloatArray:
    """The second is where a body slides to rest: a signed square of the first, told a thousand times as well."""
    return -0.5 * (z[:, 0] ** 2 + ((z[:, 1] + 4e-3 * z[:, 0] * np.abs(z[:, 0])) / 4e-4) ** 2 + (z[:, 2:] ** 2).sum(1))


def test_the_way_to_a_stop_is_a_bend() -> None:
    found = chains(lambda z: stopped(z * [1, 5e-3, 1, 1]), 4, 1)
    assert found is not None
    x, way = found.points[..., 0], found.points[..., 1] * 5e-3
    rest = (way + 4e-3 * x * np.abs(x)) / 4e-4
    error = 4.5 / np.sqrt(found.found.ess.min())
    for values in (x, rest):
        assert values.mean() == pytest.approx(0, abs=error)
        assert values.var() == pytest.approx(1, abs=2 * error)


@pytest.mark.parametrize("wide", [30.0, 300.0])
def test_a_width_that_the_density_refutes_is_narrowed(wide: float) -> None:
    factor = np.array([[wide, 0, 0, 0], [0.1 * wide, 5e-3, 0, 0], [0, 0, 1, 0], [0.3 * wide, 0, 0, 1]])
    found = chains(lambda z: stopped(z @ factor.T), 4, 1)
    assert found is not None
    assert (found.points @ factor.T).reshape(-1, 4).std(axis=0)[[0, 2]] == pytest.approx(1, abs=0.1)


@pytest.mark.parametrize("scale", [1.0, 1e4, 1e20])
def test_flattened_weights_count_as_asked(scale: float) -> None:
    drawn = weighed(lambda z: -0.5 * scale * (z**2).sum(axis=1), Proposal.standard(5), np.random.default_rng(1), 1000)
    weights = drawn.flattened(100.0)
    assert weights.sum() == pytest.approx(1)
    if scale == 1e4:
        assert 1 / np.sum(weights**2) == pytest.approx(100, rel=1e-6)
        assert np.array_equal(np.argsort(weights)[-20:], np.argsort(drawn.log_weights)[-20:])
    elif scale == 1.0:
        assert weights is drawn.weights


def test_rounds_together_have_the_integral_of_each() -> None:
    def density(z: FloatArray) -> FloatArray:
        return -2.0 * (z**2).sum(axis=1)

    rng, first = np.random.default_rng(1), Proposal.standard(3)
    rounds = [(first, weighed(density, first, rng, 400))]
    second = first.adapted(rounds[0][1].points, rounds[0][1].weights)
    rounds.append((second, weighed(density, second, rng, 400)))
    every = pooled(rounds)
    assert every.log_integral == pytest.approx(1.5 * np.log(np.pi / 2), abs=4 * every.error)
    assert every.effective > max(drawn.effective for _, drawn in rounds)


def test_a_bend_is_undone_and_keeps_volumes() -> None:
    rng = np.random.default_rng(2)
    x = rng.normal(size=(4000, 3))
    points = np.column_stack([x[:, 0], 5 * x[:, 1] + x[:, 0] ** 2, x[:, 2]]) @ np.diag([1e-3, 1.0, 40.0])
    weights = np.full(4000, 1 / 4000)
    bend = Bend.of(points, weights)
    assert [i for i, *_ in bend.shifts] == [1]
    assert bend.bent(bend.straight(points)) == pytest.approx(points, rel=1e-12, abs=1e-12)
    proposal = Proposal.standard(3, np.eye(3)).adapted(points, weights)
    drawn, log_density = proposal.draw(rng, 500)
    assert proposal.log_density(drawn) == pytest.approx(log_density, abs=1e-9)
    # Of draws from q the mean of p / q is one.
    wide, log_wide = proposal.draw(rng, 40_000)
    inside = stats.multivariate_normal(points.mean(axis=0), np.cov(points, rowvar=False) / 4).logpdf(wide)
    assert np.mean(np.exp(inside - log_wide)) == pytest.approx(1, abs=0.05)


@pytest.mark.parametrize("seed", [1, 2])
def test_a_funnel_is_refused(seed: int) -> None:
    assert chains(funnel, 5, seed) is None


@pytest.mark.parametrize(("dimension", "apart"), [(2, 8.0), (4, 8.0), (6, 10.0)])
def test_a_second_peak_is_refused_or_has_its_weight(dimension: int, apart: float) -> None:
    found = chains(lambda z: peaks(z, apart), dimension, 3)
    if found is not None:
        share = (found.points[..., 0] > apart / 2).astype(float)
        assert share.mean() == pytest.approx(1 / 3, abs=0.05)


def test_walkers_tell_of_a_peak_that_no_draw_reaches() -> None:
    """Without what they saw, the chains would be those of the one peak."""
    away = np.array([14.0, 0.0, 0.0, 0.0])
    seeds = np.random.SeedSequence(1).spawn(5)

    def found(seen: FloatArray) -> Chains | None:
        return independence_chains(
            lambda z: peaks(z, 14.0),
            np.eye(4),
            (seen, peaks(seen, 14.0)),
            seeds=seeds,
            values=lambda z: z,
            wanted=(1000, 1.01),
            tell=lambda *_: None,
        )

    alone = found(np.zeros((1, 4)))
    assert alone is not None
    assert alone.points[..., 0].max() < 7
    assert found(away[None]) is None


@pytest.mark.parametrize("dimension", [6, 8])
def test_walkers_tell_of_a_peak_that_is_broad_and_low(dimension: int) -> None:
    """Half of the mass lies where the density is lower than at nearly all draws around the other peak."""
    away = np.zeros(dimension)
    away[0] = 100.0

    def density(z: FloatArray) -> FloatArray:
        low = -0.5 * (((z - away) / 5.0) ** 2).sum(axis=1) - dimension * np.log(5.0)
        return np.logaddexp(-0.5 * (z**2).sum(axis=1), low)

    rng = np.random.default_rng(0)
    seen = np.concatenate([rng.normal(size=(500, dimension)), away + 5.0 * rng.normal(size=(500, dimension))])
    seeds = np.random.SeedSequence(1).spawn(5)
    found = independence_chains(
        density, np.eye(dimension), (seen, density(seen)), seeds=seeds, values=lambda z: z, wanted=(1000, 1.01),
        tell=lambda *_: None,
    )  # fmt: skip
    assert found is None


def test_what_is_remembered_is_not_asked_again() -> None:
    asked: list[int] = []

    def density(z: FloatArray) -> FloatArray:
        asked.append(len(z))
        return -0.5 * (z**2).sum(axis=1)

    points = np.random.default_rng(1).normal(size=(1300, 2))
    first = Remembered(density, keep=lambda: None)
    whole = first(points)
    assert asked == [512, 512, 276]
    again = Remembered(density, keep=lambda: None)
    again.values = first.values[:1024]
    assert np.array_equal(again(points), whole)
    assert asked == [512, 512, 276, 276]
    # Another run asks for other points from somewhere on.
    other = Remembered(density, keep=lambda: None)
    other.values = first.values.copy()
    mixed = np.concatenate([points[:512], points[:300] + 1])
    assert np.array_equal(other(mixed), -0.5 * (mixed**2).sum(axis=1))
    assert len(other.values) == 812
