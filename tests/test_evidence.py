"""Evidence against quadrature and bridge sampling, its diagnostics, and what it chooses."""

from __future__ import annotations

import dataclasses
import json
import math
from pathlib import Path

import numpy as np
import pytest
from driven_oscillator import (
    ALPHA,
    EFFECTS,
    NOISE,
    TIME,
    XI,
    clean,
    experiment,
    exponential_covariance,
    linear_model,
    oscillating_covariance,
    responses,
)
from folded import folded_t
from scipy import special, stats

from discovery.declarations.priors import Flat, HalfStudent, LogNormal, Normal, Student
from discovery.equations.model import Model
from discovery.estimation.declared import declared_model
from discovery.estimation.fit import fit
from discovery.estimation.importance import LARGEST_K, importance_sample
from discovery.foundation.errors import ComputationError, InputError
from discovery.posterior.likelihood import NOISE_PRIOR, log_posterior
from discovery.posterior.marginal_likelihood import _log_mass, log_evidence, log_prior_mass
from discovery.posterior.model_comparison import choose_noise, compare_models
from discovery.posterior.sampling import sample
from discovery.recordings.dataset import load_dataset
from discovery.screening.refits import Refit

ARM = Path(__file__).parents[1] / "datasets" / "arm"


def banana(bend):
    """x is normal, y normal around a parabola in x: the integral is one, whatever the bend."""

    def log_density(z):
        x, y = 1.5 * z[:, 0] + 0.4, 0.8 * z[:, 1]
        return stats.norm.logpdf(x) + stats.norm.logpdf(y - bend * (x**2 - 1), scale=0.6) + math.log(1.5 * 0.8)

    return log_density


def test_integral_of_a_banana():
    drawn = importance_sample(banana(0.15), 2, np.random.default_rng(1))
    assert drawn.pareto_k < LARGEST_K
    assert drawn.error < 0.02
    assert abs(drawn.log_integral) < 4 * drawn.error
    x = 1.5 * drawn.points[:, 0] + 0.4
    assert np.sum(drawn.weights * x) == pytest.approx(0, abs=0.07)
    assert np.sum(drawn.weights * x**2) == pytest.approx(1, abs=0.1)
    assert drawn.weights.sum() == pytest.approx(1)
    assert 1000 < drawn.effective < 4000


def test_a_shape_that_the_draws_do_not_have_is_told():
    """Neal's funnel: the scale of five coordinates depends on the sixth."""

    def funnel(z):
        narrow = stats.norm.logpdf(z[:, 1:], scale=np.exp(1.5 * z[:, :1])).sum(axis=1)
        return stats.norm.logpdf(z[:, 0]) + narrow

    for density in (funnel, lambda z: stats.cauchy.logpdf(z).sum(axis=1)):
        assert not any(importance_sample(density, 6, np.random.default_rng(seed)).reliable for seed in range(3))
    # Too narrow or too wide by far is no such shape.
    for scale in (0.1, 20.0):
        drawn = importance_sample(
            lambda z, s=scale: stats.norm.logpdf(z, scale=s).sum(axis=1), 4, np.random.default_rng(3)
        )
        assert drawn.reliable
        assert abs(drawn.log_integral) < 4 * drawn.error
    with pytest.raises(ComputationError, match="finite density"):
        importance_sample(lambda z: np.full(len(z), -np.inf), 2, np.random.default_rng(2))


def test_what_no_draw_hits_is_given_up():
    asked = []

    def needle(z):
        asked.append(len(z))
        return stats.norm.logpdf(z, scale=0.05).sum(axis=1)

    drawn = importance_sample(needle, 8, np.random.default_rng(4), draws=384, pilot=256, rounds=2, repairs=3)
    assert asked == [256, 256]
    assert not drawn.reliable


def test_standard_error_is_what_repetition_shows():
    def gamma(z):
        x = 3.0 + z[:, 0]
        return np.where(x > 0, stats.gamma(3.0).logpdf(np.maximum(x, 1e-300)), -np.inf)

    runs = [importance_sample(gamma, 1, np.random.default_rng(seed), 500) for seed in range(100)]
    scores = np.array([run.log_integral / run.error for run in runs])
    assert abs(scores.mean()) < 0.35
    assert scores.std() == pytest.approx(1.0, abs=0.3)


@pytest.fixture(scope="module")
def linear():
    errors = NOISE * np.random.default_rng(1).standard_normal(TIME.size)
    return fit(linear_model(), [experiment(errors)])


def integrated(fitted):
    """Log evidence of the linear problem: in closed form but for the noise, over which quadrature goes.

    It is that of a Gaussian prior of the gain, which Student's t replaces: both are flat on the scale of the posterior.
    """
    units, gain = fitted.problem.units, fitted.minimum.x[0]
    assert fitted.problem.free == ("g",)
    spread = [
        10 * units.scale(fitted.model.parameters["g"]),
        units.coordinate,
        units.coordinate / units.time,
    ]
    design, output = responses() * spread, fitted.problem.bench.experiments[0].recording.output[:, 0]
    # Along its axes the covariance is that of the responses plus that of the noise.
    spreads, axes = np.linalg.eigh(design @ design.T)
    along = axes.T @ output

    def log_density(log_factor):
        sd = np.sqrt(np.maximum(spreads, 0.0) + (NOISE * math.exp(log_factor)) ** 2)
        return stats.norm(0.0, sd).logpdf(along).sum() + float(NOISE_PRIOR.log_density(log_factor))

    grid = np.linspace(-0.4, 0.4, 161)
    values = np.array([log_density(v) for v in grid])
    tail = stats.t(3, scale=spread[0]).logpdf(gain) - stats.norm(0.0, spread[0]).logpdf(gain)
    return special.logsumexp(values) + math.log(grid[1] - grid[0]) + tail


def test_evidence_is_that_of_quadrature(linear):
    evidence = log_evidence(log_posterior(linear), np.random.default_rng(3))
    assert evidence.reliable
    assert evidence.drawn.error < 0.01
    # The solver's own error is worth some thousandths.
    assert evidence.log_evidence == pytest.approx(integrated(linear), abs=4 * evidence.drawn.error + 0.01)


@pytest.mark.slow
def test_evidence_of_the_papers_model_is_that_of_bridge_sampling():
    """Draws of the walkers and of a Gaussian, joined by the bridge of Meng and Wong, Statistica Sinica 6 (1996)."""
    recordings = load_dataset(ARM / "rig.toml", [ARM / "train_paper.csv"]).train
    fitted = fit(declared_model(recordings[0]), recordings)
    target = log_posterior(fitted)
    evidence = log_evidence(target, np.random.default_rng(4))
    posterior = sample(fitted, seed=5)
    values = posterior.draws.reshape(-1, target.dimension)
    noise = len(target.problem.names)
    values[:, noise] = np.log(values[:, noise] / target.instruments[0].noise)
    rng = np.random.default_rng(6)
    order = rng.permutation(len(values))[:4000]
    log_p, points = posterior.log_probability.ravel()[order], values[order]
    # One half of the draws shapes the Gaussian, the other one counts.
    proposal = stats.multivariate_normal(points[:2000].mean(axis=0), np.cov(points[:2000], rowvar=False))
    drawn = proposal.rvs(2000, random_state=rng)
    own = target(np.linalg.solve(target.factor, (drawn - target.centre).T).T) - proposal.logpdf(drawn)
    walked = log_p[2000:] - proposal.logpdf(points[2000:])
    estimate = float(np.median(walked))
    for _ in range(50):
        above = special.logsumexp(own - np.logaddexp(own, estimate))
        below = special.logsumexp(-np.logaddexp(walked, estimate))
        estimate = above - below
    assert evidence.reliable
    expected = estimate - log_prior_mass(target)
    assert evidence.log_evidence == pytest.approx(expected, abs=4 * evidence.drawn.error + 0.1)


@pytest.mark.parametrize("mean", [0.0, 0.1, 12.26])
def test_a_narrow_prior_counts_wherever_it_lies(mean):
    prior = Normal(mean, 0.08)
    assert _log_mass(prior, -math.inf, math.inf) == pytest.approx(0, abs=1e-9)
    assert _log_mass(prior, 0.0, 100.0) == pytest.approx(math.log(stats.norm.sf(0.0, mean, 0.08)), abs=1e-9)


def test_priors_count_within_their_bounds_only(linear):
    assert log_prior_mass(log_posterior(linear)) == pytest.approx(0, abs=1e-6)
    free = fit(Model("oscillator", EFFECTS), list(linear.problem.bench.experiments))
    target = log_posterior(free)
    laws = {
        Normal: lambda p: stats.norm(p.mean, p.sd),
        Student: lambda p: stats.t(3, scale=p.scale),
        HalfStudent: lambda p: folded_t(p.scale),
        LogNormal: lambda p: stats.lognorm(p.log_sd, scale=p.median),
    }
    low, high = free.problem.bounds
    expected = sum(
        math.log(np.diff(laws[type(prior)](prior).cdf([a, b]))[0])
        for prior, a, b in zip(target.problem.priors, low, high, strict=True)
    )
    assert log_prior_mass(target) == pytest.approx(expected, abs=1e-6)
    improper = dataclasses.replace(target)
    improper.problem.__dict__["priors"] = (Flat(), *target.problem.priors[1:])
    improper.problem.__dict__["bounds"] = (np.full(5, -np.inf), np.full(5, np.inf))
    with pytest.raises(InputError, match="flat without bounds"):
        log_evidence(improper, np.random.default_rng(1))


def test_same_seed_same_evidence(linear):
    first, again, other = (choose_noise(linear, seed=seed, models=["student_t"], draws=1000) for seed in (1, 1, 2))
    assert first.summary() == again.summary()
    assert first.chosen.log_evidence != other.chosen.log_evidence


def of_kind(kind):
    """Errors of one kind, mostly of it."""
    rng = np.random.default_rng(7)
    white = rng.standard_normal(TIME.size)
    if kind == "gaussian":
        return NOISE * white
    if kind == "student_t":
        return NOISE * rng.standard_t(2.0, TIME.size)
    if kind == "correlated":
        return NOISE * np.linalg.cholesky(exponential_covariance(TIME, 0.7, 0.3)) @ white
    if kind == "input":
        covariance = 0.8 * oscillating_covariance(TIME, math.sqrt(ALPHA), XI) + 0.2 * np.eye(TIME.size)
        return NOISE * np.linalg.cholesky(covariance) @ white
    step = 3 * NOISE
    return step * np.round((clean() + NOISE * white) / step) - clean()


@pytest.mark.parametrize("kind", ["gaussian", "student_t", "correlated", "input", "quantised"])
def test_evidence_chooses_the_noise_that_is_there(kind):
    choice = choose_noise(fit(linear_model(), [experiment(of_kind(kind))]), seed=1, draws=2000)
    assert choice.noise == kind
    table = json.loads(json.dumps(choice.summary()))
    assert table["chosen"] == kind == table["models"][0]["noise"]
    assert table["reliable"]
    assert table["models"][0]["behind"] == 0.0
    assert all(row["behind"] > 0 for row in table["models"][1:])
    assert {"gaussian", "student_t", "correlated", "input"} <= {row["noise"] for row in table["models"]}
    for row in table["models"]:
        assert {"log_evidence", "error", "pareto_k", "effective"} <= row.keys()
        low, middle, high = row["intervals"]["g"]
        assert low < middle < high
    if kind == "gaussian":
        assert table["widening"]["g"] == pytest.approx(1.0)
    if kind in ("correlated", "input"):
        assert table["widening"]["g"] > 1.2


def test_candidates_are_ranked_by_evidence_and_held_out_errors():
    """A law that is needed, one that is not, and one that lacks something."""
    fitted = {}
    data = experiment(NOISE * np.random.default_rng(8).standard_normal(TIME.size))
    for name, effects in (
        ("right", EFFECTS),
        ("more", (*EFFECTS, "cubic_stiffness")),
        ("less", ("linear_stiffness",)),
    ):
        fitted[name] = fit(Model("oscillator", effects), [data])
    comparison = compare_models(fitted, seed=1, held_out={"right": 1.0, "more": 1.1, "less": 40.0}, draws=1500)
    assert comparison.ranking == ("right", "more", "less")
    assert comparison.agreement == pytest.approx(1.0)
    table = json.loads(json.dumps(comparison.summary()))
    assert table["preferred"] == table["held_out_prefers"] == "right"
    # What a needless parameter costs is a few units, what a lacking one costs is hundreds.
    assert 1.0 < table["models"][1]["behind"] < 15.0
    assert table["models"][2]["behind"] > 100.0
    assert table["models"][0]["effects"] == list(EFFECTS)
    assert compare_models({"right": fitted["right"]}, seed=1, draws=500).summary()["held_out_prefers"] is None
    searched = Refit("", fitted["right"].problem, fitted["right"].minimum)
    both = [compare_models({"right": f}, seed=1, draws=500).summary() for f in (fitted["right"], searched)]
    assert both[0] == both[1]
    other = fit(Model("oscillator", EFFECTS), [dataclasses.replace(data, fitted_samples=200)])
    with pytest.raises(InputError, match="same readings"):
        compare_models({**fitted, "other": other}, seed=1)
    with pytest.raises(InputError, match="held-out error of less, more"):
        compare_models(fitted, seed=1, held_out={"right": 1.0})
