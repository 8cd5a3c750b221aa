"""Noise models against dense covariances and distributions of scipy, and their parameters from simulated errors."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from driven_oscillator import (
    ALPHA,
    EFFECTS,
    GAIN,
    NOISE,
    START,
    TIME,
    XI,
    clean,
    experiment,
    exponential_covariance,
    linear_model,
    oscillating_covariance,
    responses,
)
from noise_contract import check_noise
from scipy import integrate, optimize, signal, special, stats

from discovery.equations.model import Model
from discovery.estimation.fit import fit
from discovery.foundation.errors import InputError
from discovery.posterior.likelihood import NOISE_PRIOR, LogPosterior, log_posterior
from discovery.posterior.marginal_likelihood import log_evidence
from discovery.posterior.noise import GAUSSIAN, NOISE_MODELS, applicable, is_independent, noise_of, words_of
from discovery.posterior.noise.filters import exponential, oscillating
from discovery.posterior.noise.model import Logistic, instruments
from discovery.posterior.noise.quantised import rounded
from discovery.posterior.noise.student_t import scattered
from discovery.posterior.whitening import settled


@pytest.fixture
def irregular():
    """Irregular times, gaps and residuals of two channels and 37 sets: no whole block of lanes."""
    rng = np.random.default_rng(0)
    time = np.cumsum(rng.uniform(0.05, 0.4, 40))
    return time, rng.random((40, 2)) > 0.2, rng.standard_normal((40, 2, 37)), rng


def dense(covariance, seen, residual):
    """Log density of the readings that are there, rows in the order of samples, then channels."""
    here = seen.ravel()
    return stats.multivariate_normal(np.zeros(here.sum()), covariance[np.ix_(here, here)]).logpdf(
        residual.ravel()[here]
    )


def test_exponential_filter_is_the_dense_normal(irregular):
    time, seen, residual, rng = irregular
    share, tau = rng.uniform(0.01, 0.999, 37), np.exp(rng.uniform(-3, 3, 37))
    square, log_variance, innovation = exponential(time, seen, residual, share, tau, True)
    found = -0.5 * (square + log_variance + seen.sum() * math.log(2 * math.pi))
    for k in range(37):
        one = exponential_covariance(time, share[k], tau[k])
        # Independent channels.
        covariance = np.kron(one, np.eye(2))
        assert found[k] == pytest.approx(dense(covariance, seen, residual[..., k]), rel=1e-10, abs=1e-9)
    assert np.sum(innovation**2, axis=(0, 1)) == pytest.approx(square)
    assert not innovation[~seen].any()


@pytest.mark.parametrize(("omega", "xi"), [(3.0, 0.0), (3.0, 0.2), (1.0, 2.0 + 1e-7), (1.0, 5.0), (0.1, 60.0)])
def test_oscillating_filter_is_the_dense_normal(irregular, omega, xi):
    time, seen, residual, rng = irregular
    slope, share = rng.standard_normal((40, 2)), rng.uniform(0.01, 0.99, 37)
    rows = np.full(37, omega), np.full(37, xi)
    square, log_variance, innovation = oscillating(time, seen, residual, share, *rows, slope, True)
    found = -0.5 * (square + log_variance + seen.sum() * math.log(2 * math.pi))
    same = np.kron(oscillating_covariance(time, omega, xi), np.ones((2, 2))) * np.outer(slope, slope)
    for k in range(37):
        covariance = share[k] * same + (1 - share[k]) * np.eye(80)
        assert found[k] == pytest.approx(dense(covariance, seen, residual[..., k]), rel=1e-9, abs=1e-9)
    assert np.sum(innovation**2, axis=(0, 1)) == pytest.approx(square)


def test_sets_do_not_disturb_each_other(irregular):
    time, seen, residual, _ = irregular
    spoiled = residual.copy()
    spoiled[..., 5] = np.inf
    share, tau = np.full(37, 0.5), np.full(37, 1.0)
    good, bad = (exponential(time, seen, r, share, tau, False)[0] for r in (residual, spoiled))
    assert np.array_equal(np.delete(good, 5), np.delete(bad, 5))
    assert not np.isfinite(bad[5])


def test_heavy_tails_are_those_of_scipy(irregular):
    *_, residual, rng = irregular
    factor = rng.uniform(0.01, 5.0, 37)
    assert scattered(1e4 * residual, factor) == pytest.approx(np.log1p(factor * (1e4 * residual) ** 2).sum((0, 1)))


@pytest.mark.parametrize("half", [1e-6, 5e-5, 2e-4, 0.1, 2.0, 50.0])
def test_cells_are_those_of_scipy_far_into_the_tails(half):
    u = np.array([0.0, 0.3, 4.0, 12.0, 29.0, 31.0, 49.9, 80.0, 400.0])
    for sd in (1.0, 0.3):
        found = rounded(np.ones((1, 1), bool), u.reshape(1, 1, -1), np.array([half]), np.full(u.size, sd))
        near, far = special.log_ndtr(-(u - half) / sd), special.log_ndtr(-(u + half) / sd)
        # Where the difference cancels, the density at the middle is the better reference.
        fine = stats.norm.logpdf(u / sd) + math.log(2 * half / sd) + (u**2 / sd**2 - 1) * (half / sd) ** 2 / 6
        expected = fine if half < 1e-5 else near + np.log1p(-np.exp(far - near))
        assert found.shape == u.shape
        for value, reference, mirrored in zip(found, expected, -u, strict=True):
            assert value == pytest.approx(reference, rel=1e-7, abs=1e-7)
            other = rounded(np.ones((1, 1), bool), np.full((1, 1, 1), mirrored), np.array([half]), np.array([sd]))
            assert other[0] == value


def white(seed):
    return NOISE * np.random.default_rng(seed).standard_normal(TIME.size)


@pytest.fixture(scope="module")
def gapped():
    """A fit of readings with a gap and a held-out end."""
    errors = white(1)
    errors[50:80] = np.nan
    return fit(linear_model(), [dataclasses.replace(experiment(errors), fitted_samples=300)])


def left_of(fitted, x):
    """Errors at the linear parameters of a sampled vector, those that count."""
    recording = fitted.problem.bench.experiments[0].recording
    errors = recording.output[:, 0] - responses(recording.time) @ x
    seen = np.isfinite(errors) & (np.arange(errors.size) < (fitted.problem.bench.experiments[0].fitted_samples or 1e9))
    return errors[seen], recording.time[seen]


def expected_likelihood(noise, errors, time, values):
    zero = np.zeros(errors.size)
    if noise == GAUSSIAN:
        return stats.norm.logpdf(errors, 0, values["sigma"]).sum()
    if noise == "student_t":
        return stats.t(values["nu"], 0, values["sigma"]).logpdf(errors).sum()
    if noise == "correlated":
        one = exponential_covariance(time, values["share"], values["tau_n"])
    else:
        # The readings of an oscillator are its coordinate: a slope of one at every time.
        one = values["share"] * oscillating_covariance(time, math.sqrt(ALPHA), XI)
        one += (1 - values["share"]) * np.eye(time.size)
    return stats.multivariate_normal(zero, values["sigma"] ** 2 * one).logpdf(errors)


@pytest.mark.parametrize("noise", [GAUSSIAN, "student_t", "correlated", "input"])
def test_log_posterior_is_prior_times_likelihood(gapped, noise):
    target = log_posterior(gapped, noise)
    z = np.random.default_rng(3).standard_normal((3, target.dimension))
    vectors, named = target.vectors(z), [dict(zip(target.names, row, strict=True)) for row in target.values(z)]
    likelihood = [
        expected_likelihood(noise, *left_of(gapped, vector[:3]), values)
        for vector, values in zip(vectors, named, strict=True)
    ]
    assert target.log_likelihood(vectors) == pytest.approx(likelihood, abs=2e-3)
    natural = gapped.problem.units
    prior = stats.t(3, scale=10 * natural.scale(gapped.model.parameters["g"])).logpdf(vectors[:, 0])
    prior += stats.norm.logpdf(vectors[:, 1], 0, natural.coordinate)
    prior += stats.norm.logpdf(vectors[:, 2], 0, natural.coordinate / natural.time)
    prior += NOISE_PRIOR.log_density(vectors[:, 3])
    for i, name in enumerate(target.names[4:], start=4):
        if name == "share":
            prior += stats.logistic.logpdf(vectors[:, i])
        elif name == "nu":
            prior += stats.norm.logpdf(vectors[:, i], math.log(10), 1)
        else:
            prior += stats.norm.logpdf(vectors[:, i], *time_constant_prior(left_of(gapped, vectors[0, :3])[1]))
    assert target(z) - likelihood == pytest.approx(prior, abs=2e-3)


def time_constant_prior(time):
    short, long = math.log(np.median(np.diff(time))), math.log(time[-1] - time[0])
    return 0.5 * (short + long), 0.25 * (long - short)


def test_names_units_and_start_of_every_model(gapped):
    expected = {
        GAUSSIAN: {"sigma": "V"},
        "student_t": {"sigma": "V", "nu": "1"},
        "correlated": {"sigma": "V", "share": "1", "tau_n": "s"},
        "input": {"sigma": "V", "share": "1"},
    }
    for noise, units in expected.items():
        target = log_posterior(gapped, noise)
        assert target.noise == noise
        assert target.names[3:] == tuple(units)
        assert target.units[3:] == tuple(units.values())
        assert set(target.noise_reference) == set(units)
        middle = dict(zip(target.names, target.values(np.zeros(target.dimension)), strict=True))
        assert {n: v for n, (v, _) in target.noise_reference.items()} == pytest.approx({n: middle[n] for n in units})
        # It starts at its mode, and the whitened density is about a standard normal one there.
        ends = 0.5 * np.concatenate([np.zeros((1, target.dimension)), np.eye(target.dimension)])
        assert target(ends)[1:] - target(ends)[0] == pytest.approx(-0.125, abs=0.12)


def test_gaussian_start_is_that_of_the_fit(gapped):
    target = log_posterior(gapped)
    assert np.array_equal(target.centre[:3], gapped.minimum.x)
    assert target.models == ()
    value, sd = target.noise_reference["sigma"]
    assert value == NOISE * math.exp(target.centre[3])
    assert sd == pytest.approx(value / math.sqrt(2 * 270), rel=1e-2)


def test_several_instruments_have_their_own_noise():
    """The oscillator knows one channel only, so the likelihood is told of a second."""
    one, two = experiment(white(1)), experiment(3 * white(2), name="other")
    fitted = fit(linear_model(), [one, two])
    renamed = dataclasses.replace(two, recording=dataclasses.replace(two.recording, channels=("tip_deflection",)))
    parts = instruments([one, renamed])
    models = noise_of("correlated", fitted.problem, parts)
    vector = np.array([*fitted.minimum.x, 0.1, 1.1, -1.0, 0.3, 1.0, -0.4])
    target = LogPosterior(fitted.problem, parts, vector, np.eye(vector.size), models)
    assert target.names[5:] == (
        "sigma[output]",
        "sigma[tip_deflection]",
        "share[output]",
        "tau_n[output]",
        "share[tip_deflection]",
        "tau_n[tip_deflection]",
    )
    expected = sum(
        stats.multivariate_normal(
            np.zeros(TIME.size),
            (NOISE * math.exp(log_factor)) ** 2 * exponential_covariance(TIME, special.expit(odds), math.exp(log_tau)),
        ).logpdf(e.recording.output[:, 0] - responses() @ [fitted.minimum.x[0], *start])
        for e, start, log_factor, odds, log_tau in (
            (one, vector[1:3], 0.1, -1.0, 0.3),
            (two, vector[3:5], 1.1, 1.0, -0.4),
        )
    )
    assert target.log_likelihood(vector[None])[0] == pytest.approx(expected, abs=5e-3)


def test_what_does_not_apply_is_refused(gapped):
    parts = instruments(gapped.problem.bench.experiments)
    assert {*NOISE_MODELS} - {*applicable(gapped.problem, parts)} == {"quantised"}
    assert applicable(gapped.problem, parts)[0] == GAUSSIAN
    with pytest.raises(InputError, match="readings in steps"):
        log_posterior(gapped, "quantised")
    with pytest.raises(InputError, match="Did you mean 'correlated'"):
        log_posterior(gapped, "corelated")
    still = fit(linear_model(), [experiment(white(1), driven=False)])
    assert "input" not in applicable(still.problem, instruments(still.problem.bench.experiments))


def recovered(noise, errors, time=TIME):
    """Start values of the noise, and their distance from what is true in standard deviations."""
    return log_posterior(fit(linear_model(), [experiment(errors, time)]), noise).noise_reference


def within(reference, sds=3.5, **truth):
    for name, value in truth.items():
        found, sd = reference[name]
        assert abs(found - value) < sds * sd, (name, found, sd, value)
        assert sd < value


def test_outliers_are_recovered():
    errors = NOISE * np.random.default_rng(4).standard_t(3.0, TIME.size)
    within(recovered("student_t", errors), sigma=NOISE, nu=3.0)


def test_correlation_is_recovered_from_irregular_samples():
    rng = np.random.default_rng(5)
    time = np.sort(rng.uniform(0, 60, 900))
    time[0] = 0.0
    covariance = exponential_covariance(time, 0.6, 0.8)
    errors = 2 * NOISE * np.linalg.cholesky(covariance) @ rng.standard_normal(time.size)
    errors[200:230] = np.nan
    within(recovered("correlated", errors, time), sigma=2 * NOISE, share=0.6, tau_n=0.8)


def test_input_noise_is_recovered_from_a_noisy_input():
    """The oscillator itself, driven by held white noise after it has settled, integrated by scipy."""
    rng = np.random.default_rng(6)
    fine = np.arange(0.0, 124.0, 0.02)
    force = rng.standard_normal(fine.size)
    system = signal.StateSpace([[0, 1], [-ALPHA, -XI]], [[0], [1]], [[1, 0]], [[0]])
    _, passed, _ = signal.lsim(system, force, fine)
    # A spectrum of dt on both sides, through |alpha - w^2 + i xi w|^-2, has the variance dt / (2 xi alpha).
    size = math.sqrt(0.02 / (2 * XI * ALPHA))
    coloured = np.interp(TIME, fine - 100.0, passed) * 1.5 * NOISE / size
    within(recovered("input", coloured + white(7)), sigma=NOISE * math.hypot(1.5, 1.0), share=1.5**2 / (1.5**2 + 1))


def test_noise_before_rounding_is_recovered():
    """Rounding to steps twice as large as the noise."""
    step = 2 * NOISE
    readings = step * np.round((clean() + white(8)) / step)
    reference = recovered("quantised", readings - clean())
    within(reference, sigma=NOISE)
    assert recovered(GAUSSIAN, readings - clean())["sigma"][0] > NOISE + 2 * reference["sigma"][1]


def test_whitened_jacobian_is_that_of_generalised_least_squares():
    errors = white(9)
    fitted = fit(linear_model(), [experiment(errors)])
    (model,) = noise_of("correlated", fitted.problem, instruments(fitted.problem.bench.experiments))
    noise = np.array([0.3, 1.0, -0.5])
    columns = model.whitened(0, responses()[:, None] / NOISE, fitted.minimum.x, noise)[:, 0]
    covariance = exponential_covariance(TIME, special.expit(1.0), math.exp(-0.5)) * (NOISE * math.exp(0.3)) ** 2
    assert columns.T @ columns == pytest.approx(responses().T @ np.linalg.solve(covariance, responses()), rel=1e-9)


def test_uniform_share_is_a_density():
    mass, _ = integrate.quad(lambda x: float(np.exp(Logistic().log_density(x))), -40, 40)
    assert mass == pytest.approx(1.0)
    variance, _ = integrate.quad(lambda x: x * x * float(np.exp(Logistic().log_density(x))), -60, 60)
    assert Logistic().width == pytest.approx(math.sqrt(variance))


@pytest.mark.slow
def test_white_intervals_are_too_narrow_on_correlated_errors_and_honest_ones_are_not():
    """Coverage of the gain by 90 % intervals over sixty recordings with errors that are mostly correlated."""
    rng = np.random.default_rng(10)
    time = TIME[:201]
    root = np.linalg.cholesky(exponential_covariance(time, 0.8, 0.8))
    hits, widths = {GAUSSIAN: 0, "correlated": 0}, {GAUSSIAN: [], "correlated": []}
    replicates = 60
    for _ in range(replicates):
        fitted = fit(linear_model(), [experiment(NOISE * root @ rng.standard_normal(time.size), time)])
        for noise in hits:
            low, _, high = log_evidence(log_posterior(fitted, noise), rng, 1000).intervals()["g"]
            hits[noise] += low <= GAIN <= high
            widths[noise].append(high - low)
    assert hits[GAUSSIAN] < stats.binom(replicates, 0.9).ppf(1e-4), hits
    assert hits["correlated"] >= stats.binom(replicates, 0.9).ppf(0.005), hits
    # Not by being as wide as can be: the true standard deviation of generalised least squares is their measure.
    design, covariance = responses(time), NOISE**2 * root @ root.T
    sd = math.sqrt(np.linalg.inv(design.T @ np.linalg.solve(covariance, design))[0, 0])
    assert np.median(widths["correlated"]) == pytest.approx(2 * 1.645 * sd, rel=0.3)
    assert np.median(widths[GAUSSIAN]) < 0.7 * np.median(widths["correlated"])


def test_start_is_what_made_the_readings(gapped):
    target = log_posterior(gapped, "correlated")
    sd = np.linalg.norm(target.factor[:3], axis=1)
    assert np.abs(target.centre[:3] - [GAIN, *START]) / sd == pytest.approx(0, abs=3.5)


@pytest.mark.parametrize("noise", NOISE_MODELS)
def test_a_noise_model_keeps_its_contract(noise):
    check_noise(noise)


def mode_by_scipy(errors):
    """The most probable (gain, deflection, rate) and noise of Student's t, from the truth, priors left out."""
    readings = clean() + errors

    def cost(v):
        return -stats.t(np.exp(v[4]), 0, NOISE * np.exp(v[3])).logpdf(readings - responses() @ v[:3]).sum()

    start = [GAIN, *START, 0.0, 0.0]
    return optimize.minimize(cost, start, method="Nelder-Mead", options={"maxiter": 4000, "xatol": 1e-5}).x


@pytest.mark.parametrize("nu", [0.5, pytest.param(0.76, marks=pytest.mark.slow)])
def test_start_bears_outliers_that_least_squares_does_not(nu):
    """Of such errors neither the variance nor the mean exists: the largest of these is ten thousands of scales."""
    errors = NOISE * np.random.default_rng(107).standard_t(nu, TIME.size)
    fitted = fit(linear_model(), [experiment(errors)])
    target = log_posterior(fitted, "student_t")
    away = np.linalg.solve(target.factor, mode_by_scipy(errors) - target.centre)
    assert np.abs(away) == pytest.approx(0, abs=0.35)
    # Least squares itself is many standard deviations off.
    sd = np.linalg.norm(target.factor[:3], axis=1)
    assert np.abs((fitted.minimum.x - target.centre[:3]) / sd).max() > 10
    assert log_evidence(target, np.random.default_rng(1), 1000).reliable


@pytest.mark.parametrize("seed", [7, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1001, 1005))])
def test_start_returns_from_another_frequency(seed):
    """With damping and stiffness free, outliers send least squares to a stiffness of twenty times the true one."""
    errors = NOISE * np.random.default_rng(seed).standard_t(0.76, TIME.size)
    fitted = fit(Model("oscillator", EFFECTS), [experiment(errors)])
    target = log_posterior(fitted, "student_t")
    sd = np.linalg.norm(target.factor, axis=1)
    truth = {"g": GAIN, "xi": XI, "alpha": ALPHA, "sigma": 0.0, "nu": math.log(0.76)}
    for i, name in enumerate(target.names):
        if name in truth:
            assert abs(target.centre[i] - truth[name]) < 4 * sd[i], name
    assert abs(fitted.values["alpha"] - ALPHA) > 5.0
    assert log_evidence(target, np.random.default_rng(1), 1000).reliable


def test_settling_is_silent_where_both_steps_leave_the_support():
    """Nothing is known along the first axis, and nothing is said about it; the second one finds its mode."""

    def density(centre, factor):
        def at(z):
            first, second = (centre + z @ factor.T).T
            return np.where(np.abs(first) < 0.1, -0.5 * (second - 2.0) ** 2, -np.inf)

        return at

    centre, factor = settled(density, np.zeros(2), np.eye(2))
    assert centre == pytest.approx([0.0, 2.0], abs=0.1)
    assert factor == pytest.approx(np.eye(2))
    # The centre itself outside: it stays, as does its width.
    centre, factor = settled(density, np.array([5.0, 0.0]), np.eye(2))
    assert np.array_equal(centre, [5.0, 0.0])
    assert np.array_equal(factor, np.eye(2))


def test_words_say_what_errors_are_taken_as(gapped):
    assert words_of(GAUSSIAN) == "independent and Gaussian"
    known = {GAUSSIAN: True, "student_t": True, "correlated": False, "input": False, "quantised": True}
    assert {name: is_independent(name) for name in known} == known
    with pytest.raises(InputError, match="Did you mean 'student_t'"):
        words_of("studentt")
    for noise in applicable(gapped.problem, instruments(gapped.problem.bench.experiments)):
        target = log_posterior(gapped, noise)
        assert list(target.meanings) == list(target.names[3:])
        assert all(target.meanings.values())
