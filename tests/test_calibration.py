"""A posterior that is known in closed form, calibration that would notice wrong intervals, and the tables of both."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from folded import folded_t
from scipy import stats

from benchmarks.calibration import manoeuvres, ranks
from benchmarks.calibration.pooled import Pooled, pooled
from benchmarks.calibration.replicate import (
    NOISE,
    RANKED,
    Study,
    density_of,
    drawn_from,
    drawn_truth,
    fitted,
    placed,
    simulated,
)
from discovery.declarations.priors import Flat, HalfStudent, LogNormal, Normal
from discovery.equations.model import Model
from discovery.estimation.importance import importance_sample
from discovery.estimation.natural_units import NaturalUnits
from discovery.posterior.likelihood import LogPosterior, log_posterior
from discovery.posterior.noise import noise_of
from discovery.posterior.noise.model import Logistic, instruments
from discovery.recordings.experiment import Experiment
from discovery.recordings.recording import Recording
from discovery.rigs.rig import Rig

XI, ALPHA, DRIVE = 0.3, 9.0, 2.1
READING = 0.05
TIME = np.linspace(0.0, 6.0, 61)
UNITS = NaturalUnits(time=1 / 3, coordinate=0.2, length=1.0)
GAIN = (1.5, 0.1)
PRIOR_MEAN = np.array([GAIN[0], 0.0, 0.0])
PRIOR_SD = np.array([GAIN[1], UNITS.coordinate, UNITS.coordinate / UNITS.time])


class Sine:
    """The input sin(DRIVE t) and its derivatives."""

    kinks = np.empty(0)

    def evaluate(self, t, side="right"):
        phase = DRIVE * np.asarray(t, float)
        return np.array([np.sin(phase), DRIVE * np.cos(phase), -(DRIVE**2) * np.sin(phase)])


def linear_study(noise="gaussian"):
    """With damping and stiffness known, readings are linear in the gain and the initial state."""
    effects = ("viscous_damping", "linear_stiffness")
    nothing, force = np.zeros((TIME.size, 1)), Sine().evaluate(TIME)[0]
    recording = Recording("r", TIME, force, nothing, ("output",), ("V",), np.array([READING]), "r", "")
    experiment = Experiment(recording, Sine(), Rig("oscillator", "oscillator", declared=effects))
    model = Model("oscillator", effects, {"xi": XI, "alpha": ALPHA})
    return Study("linear", "linear", model, experiment, {"g": GAIN}, UNITS, 0.02, noise)


def design():
    """Responses of q'' + xi q' + alpha q = g u to unit gain, deflection and rate, in closed form, shape (n, 3)."""
    omega = np.sqrt(ALPHA - XI**2 / 4)
    decay = np.exp(-XI * TIME / 2)
    rate = decay * np.sin(omega * TIME) / omega
    deflection = decay * np.cos(omega * TIME) + XI / 2 * rate
    transfer = 1 / (ALPHA - DRIVE**2 + 1j * XI * DRIVE)
    steady = (transfer * np.exp(1j * DRIVE * TIME)).imag
    forced = steady - transfer.imag * deflection - DRIVE * transfer.real * rate
    return np.column_stack([forced, deflection, rate])


def conjugate(readings):
    """Mean and covariance of (gain, deflection, rate) given readings (n,), and the density of the log noise factor.

    Gaussian prior and noise: closed form for each noise factor, whose own density is summed over a grid.
    """
    x = design()
    grid = np.linspace(-1.0, 1.0, 401)
    evidence, means, covariances = [], [], []
    for factor in np.exp(grid):
        whole = x @ np.diag(PRIOR_SD**2) @ x.T + (factor * READING) ** 2 * np.eye(TIME.size)
        evidence.append(stats.multivariate_normal.logpdf(readings, x @ PRIOR_MEAN, whole))
        covariance = np.linalg.inv(x.T @ x / (factor * READING) ** 2 + np.diag(PRIOR_SD**-2))
        means.append(covariance @ (x.T @ readings / (factor * READING) ** 2 + PRIOR_MEAN / PRIOR_SD**2))
        covariances.append(covariance)
    log_weight = np.array(evidence) + stats.norm.logpdf(grid, NOISE.mean, NOISE.sd)
    weight = np.exp(log_weight - log_weight.max())
    weight /= weight.sum()
    mean = weight @ np.array(means)
    about = np.array(means) - mean
    covariance = np.einsum("k,kij->ij", weight, np.array(covariances)) + (about.T * weight) @ about
    return mean, covariance, (weight @ grid, np.sqrt(weight @ grid**2 - (weight @ grid) ** 2))


def drawn_posterior(problem, rng, draws=4000):
    target = log_posterior(fitted(problem))
    return target, importance_sample(density_of(target), target.dimension, rng, draws)


def test_the_posterior_of_a_linear_model_is_the_conjugate_one():
    rng = np.random.default_rng(3)
    _, problem = simulated(linear_study(), rng)
    target, drawn = drawn_posterior(problem, rng, 8000)
    mean, covariance, (log_factor, spread) = conjugate(problem.bench.experiments[0].recording.output[:, 0])
    vectors = target.vectors(drawn.points)
    found = drawn.weights @ vectors
    about = vectors - found
    sd = np.sqrt(np.diag(covariance))
    assert target.names == ("g", "delta_0_init[r]", "rate_0_init[r]", "sigma")
    # The sampling error of a mean of some 6000 draws is 0.013 sd.
    assert (found[:3] - mean) / sd == pytest.approx(0, abs=0.06)
    shape = (about.T * drawn.weights) @ about
    assert shape[:3, :3] / np.outer(sd, sd) == pytest.approx(covariance / np.outer(sd, sd), abs=0.08)
    assert found[3] == pytest.approx(log_factor, abs=0.06 * spread)
    assert np.sqrt(shape[3, 3]) == pytest.approx(spread, rel=0.05)
    # The prior must have had a say, or the test would not see it.
    flat = np.linalg.inv(design().T @ design()) * (READING * np.exp(log_factor)) ** 2
    assert sd[0] < 0.95 * np.sqrt(flat[0, 0])


def ranked(count=60, narrowed=1.0):
    """Where truths lie in the posteriors of simulated data, with all draws pulled towards their mean."""
    study, rows = linear_study(), []
    for i in range(count):
        rng = np.random.default_rng([11, i])
        truth, problem = simulated(study, rng)
        target, drawn = drawn_posterior(problem, rng, 1000)
        centre = drawn.weights @ drawn.points
        drawn = replace(drawn, points=centre + narrowed * (drawn.points - centre))
        rows.append({**placed(target, drawn, truth, rng), "effective": drawn.effective})
    return rows


def calibrated(rows):
    """Whether the truths are inside 90 % intervals as often as they should be, within 3.3 standard deviations."""
    pits = np.array([[p for name, p in row["pit"].items() if name != "log_likelihood"] for row in rows])
    share = ranks.covered(pits, 0.9).mean()
    # The quantities of one replication are correlated: replications count, not quantities.
    spread = ranks.covered(pits, 0.9).mean(axis=1).std(ddof=1) / np.sqrt(len(rows))
    return abs(share - 0.9) < 3.3 * max(spread, np.sqrt(0.9 * 0.1 / pits.size))


def test_truths_from_the_prior_rank_uniformly():
    rows = ranked()
    assert calibrated(rows)
    found = ranks.summary(rows, RANKED)
    assert found["replications"] == 60
    assert found["unreliable"] == 0
    assert min(q["histogram"]["p"] for q in found["quantities"].values()) > 1e-3
    assert set(found["quantities"]) == {"g", "delta_0_init", "rate_0_init", "sigma", "log_likelihood"}


@pytest.mark.slow
def test_intervals_that_are_30_percent_too_narrow_are_noticed():
    assert not calibrated(ranked(narrowed=0.7))


def test_the_rank_of_the_likelihood_notices_what_marginals_do_not():
    # As if the data had been counted not at all: draws from the prior, whose marginals rank truths uniformly.
    study, rows = linear_study(), []
    for i in range(60):
        rng = np.random.default_rng([12, i])
        truth, problem = simulated(study, rng)
        target, drawn = drawn_posterior(problem, rng, 200)
        prior = np.array([drawn_truth(target, rng) for _ in range(100)])
        z = np.linalg.solve(target.factor, (prior - target.centre).T).T
        rows.append(
            {**placed(target, replace(drawn, points=z, weights=np.full(100, 0.01)), truth, rng), "effective": 1}
        )
    assert calibrated(rows)
    assert ranks.summary(rows, RANKED)["quantities"]["log_likelihood"]["histogram"]["p"] < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("noise", ["student_t", "correlated"])
def test_simulated_noise_has_the_density_that_the_posterior_takes_it_to_have(noise):
    # At the truth, the mean slope of a log density in each of its parameters is zero.
    study, slopes = linear_study(noise), []
    for i in range(300):
        rng = np.random.default_rng([13, i])
        truth, problem = simulated(study, rng)
        parts = instruments(problem.bench.experiments)
        d = truth.size
        target = LogPosterior(problem, parts, np.zeros(d), np.eye(d), noise_of(noise, problem, parts))
        steps = 1e-3 * np.eye(truth.size)[len(problem.names) :]
        up, down = (target.log_likelihood(truth + sign * steps) for sign in (1, -1))
        slopes.append((up - down) / 2e-3)
    z = np.mean(slopes, axis=0) / np.std(slopes, axis=0, ddof=1) * np.sqrt(300)
    assert np.abs(z).max() < 4


@pytest.mark.parametrize(
    ("prior", "law"),
    [
        (Normal(1.0, 2.0), stats.norm(1.0, 2.0)),
        (HalfStudent(0.5), folded_t(0.5)),
        (LogNormal(0.1, 0.7), stats.lognorm(0.7, scale=0.1)),
        (Logistic(), stats.logistic()),
    ],
)
def test_truths_follow_the_declared_prior_within_its_bounds(prior, law):
    rng = np.random.default_rng(0)
    low, high = law.ppf([0.1, 0.8])
    values = np.array([drawn_from(prior, low, high, rng) for _ in range(2000)])
    assert stats.kstest(values, lambda v: (law.cdf(v) - 0.1) / 0.7).pvalue > 1e-3
    # And it is the very density that the posterior multiplies with.
    middle = law.ppf([0.3, 0.5])
    assert np.diff(prior.log_density(middle)) == pytest.approx(np.diff(law.logpdf(middle)))


def test_an_improper_prior_is_refused():
    with pytest.raises(TypeError, match="no density"):
        drawn_from(Flat(), 0.0, 1.0, np.random.default_rng(0))


def test_coverage_and_its_interval():
    pit = (np.arange(1000) + 0.5) / 1000
    found = ranks.coverage(pit)
    assert found["0.9"]["share"] == pytest.approx(0.9, abs=0.001)
    assert found["0.9"]["low"] < 0.9 < found["0.9"]["high"]
    assert ranks.coverage(0.5 + 0.7 * (pit - 0.5))["0.9"]["low"] > 0.92
    assert ranks.proportion(8, 10) == pytest.approx((0.8, 0.4439, 0.9748), abs=1e-4)
    bowl = ranks.histogram(np.r_[np.zeros(200, int), np.arange(100), np.full(200, 99)], 99)
    assert bowl["p"] < 1e-9
    assert bowl["outside"] == 20


# --- random manoeuvres of the twin


def test_pooled_recordings_give_the_estimate_of_one_long_fit():
    rng = np.random.default_rng(2)
    moves = [manoeuvres.Move(0.8, 1.0, 0.2), manoeuvres.Move(-1.1, 1.2, 0.15)]
    experiments = [manoeuvres.recorded(move, rng) for move in moves]
    alone = [manoeuvres.fitted("paper", e) for e in experiments]
    common = pooled([f.problem for f in alone], [f.minimum.x for f in alone])
    whole = manoeuvres.fit(alone[0].model, experiments, bench=None, start=alone[0].values)
    sd = np.sqrt(np.diag(common.naive))
    assert (common.x - whole.minimum.x[:4]) / sd == pytest.approx(0, abs=0.02)
    # Over two recordings: not at the minimum of either, but their scores cancel.
    assert np.abs(common.scores.sum(axis=0)) == pytest.approx(0, abs=1e-3 * np.abs(common.scores).max())
    jacobian = whole.minimum.jacobian
    information = jacobian.T @ jacobian
    assert np.linalg.inv(information)[:4, :4] * common.variance == pytest.approx(common.naive, rel=0.01)


def test_intervals_from_how_recordings_differ_have_their_size_for_independent_ones():
    # A mean of six numbers of unequal weight: the jackknife is the usual standard error.
    rng = np.random.default_rng(0)
    y = rng.standard_normal(6)
    mean = y.mean()
    found = Pooled(np.array([mean]), np.array([[6.0]]), np.ones((6, 1, 1)), (mean - y)[:, None], 1.0)
    assert found.clustered[0, 0] == pytest.approx(y.var(ddof=1) / 6)


def test_first_principles_are_those_of_the_rig():
    found = manoeuvres.first_principles("paper")
    arm = manoeuvres.ARM
    mass = arm.tip_mass + 33 / 140 * arm.beam_mass
    assert found["alpha"] == pytest.approx(3 * arm.flexural_rigidity / (mass * arm.length**3), rel=1e-6)
    assert found["gamma"] == pytest.approx(1 / np.sqrt(5), rel=1e-3)
    assert manoeuvres.first_principles("exact")["mu"] == pytest.approx(arm.beam_mass / arm.tip_mass)
