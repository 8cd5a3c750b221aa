"""The posterior against problems whose answer is known in closed form, and its refusals, seeds and files."""

from __future__ import annotations

import dataclasses
import signal
import subprocess
import sys
from pathlib import Path

import driven_oscillator
import h5py
import numpy as np
import pytest
import xarray as xr
from driven_oscillator import ALPHA, EFFECTS, GAIN, NOISE, START, XI, Sine, linear_model
from scipy import stats

from discovery.equations.model import Model
from discovery.estimation.fit import fit
from discovery.foundation.errors import ComputationError, InputError, NotConverged, NotIdentifiable
from discovery.posterior import ensembles, sampling
from discovery.posterior.checkpoint import Remembered
from discovery.posterior.draws import Posterior
from discovery.posterior.likelihood import NOISE_PRIOR, log_posterior
from discovery.posterior.noise.model import instruments
from discovery.posterior.predictive import predictive
from discovery.posterior.sampling import METHODS, sample
from discovery.recordings.experiment import Experiment
from discovery.recordings.recording import Recording
from discovery.rigs.rig import Rig

TIME = np.linspace(0.0, 12.0, 151)


def responses(xi=XI, alpha=ALPHA):
    """Responses at the times of these recordings."""
    return driven_oscillator.responses(TIME, xi, alpha)


def experiment(rng, noise=NOISE, stated=NOISE, name="sine", xi=XI, alpha=ALPHA):
    clean = responses(xi, alpha) @ [GAIN, *START]
    output = (clean + noise * rng.standard_normal(TIME.size))[:, None]
    recording = Recording(
        name, TIME, Sine().evaluate(TIME)[0], output, ("output",), ("V",), np.array([stated]), name, "made here"
    )
    return Experiment(recording, Sine(), Rig("oscillator", "oscillator", declared=EFFECTS))


@pytest.fixture(scope="module")
def linear():
    return fit(linear_model(), [experiment(np.random.default_rng(5))])


@pytest.fixture(scope="module", params=METHODS)
def drawn(request, linear):
    return sample(linear, seed=11, method=request.param)


@pytest.fixture(scope="module")
def walked(linear):
    return sample(linear, seed=11, method="emcee")


def analytic(linear, stated=NOISE):
    """Location, scale matrix and degrees of freedom of the Student t of (gain, deflection, rate), and s.

    For flat priors and a noise that is log-uniform: W. Press et al., or any book on linear regression.
    """
    design = responses()
    output = linear.problem.bench.experiments[0].recording.output[:, 0]
    best, *_ = np.linalg.lstsq(design, output, rcond=None)
    dof = TIME.size - 3
    s2 = np.sum((output - design @ best) ** 2) / dof
    return best, s2 * np.linalg.inv(design.T @ design), dof, np.sqrt(s2)


def test_linear_problem_has_the_analytic_posterior(linear, drawn):
    best, scale, dof, s = analytic(linear)
    assert drawn.names == ("g", "delta_0_init[sine]", "rate_0_init[sine]", "sigma")
    values = drawn.draws.reshape(-1, 4)
    sd = np.sqrt(np.diag(scale) * dof / (dof - 2))
    error = 1 / np.sqrt(min(drawn.ess.values()))
    # The declared priors are broad, but not flat: their pull on the mean is far below the sampling error.
    assert np.abs(values[:, :3].mean(axis=0) - best) / sd == pytest.approx(0, abs=5 * error)
    covariance = np.cov(values[:, :3], rowvar=False) / np.outer(sd, sd)
    assert covariance == pytest.approx(scale * dof / (dof - 2) / np.outer(sd, sd), abs=8 * error)
    # sigma^2 is dof s^2 over a chi-square of dof degrees of freedom.
    expected = s * np.sqrt(dof / stats.chi2(dof).ppf([0.95, 0.5, 0.05]))
    width = expected[2] - expected[0]
    assert np.abs(np.quantile(values[:, 3], [0.05, 0.5, 0.95]) - expected) / width == pytest.approx(0, abs=3 * error)


def test_draws_follow_the_analytic_marginal(linear, drawn):
    best, scale, dof, _ = analytic(linear)
    thin = int(2 * max(drawn.tau.values()) + 1)
    gain = drawn.draws[:, ::thin, :, 0].ravel()
    marginal = stats.t(dof, best[0], np.sqrt(scale[0, 0]))
    # Thinned to two autocorrelation times the draws are nearly independent; a wrong sampler fails by far.
    assert stats.kstest(gain, marginal.cdf).pvalue > 1e-4


def test_log_probability_is_prior_times_likelihood(linear, drawn):
    values = drawn.draws[1, 3]
    output = linear.problem.bench.experiments[0].recording.output[:, 0]
    predicted = responses() @ values[:, :3].T
    likelihood = stats.norm.logpdf(output[:, None], predicted, values[:, 3]).sum(axis=0)
    assert drawn.log_likelihood[1, 3] == pytest.approx(likelihood, abs=1e-3)
    natural = linear.problem.units
    gain_unit = natural.scale(linear.model.parameters["g"])
    prior = stats.t(3, scale=10 * gain_unit).logpdf(values[:, 0])
    prior += stats.norm.logpdf(values[:, 1], 0, natural.coordinate)
    prior += stats.norm.logpdf(values[:, 2], 0, natural.coordinate / natural.time)
    prior += NOISE_PRIOR.log_density(np.log(values[:, 3] / NOISE))
    assert (drawn.log_probability - drawn.log_likelihood)[1, 3] == pytest.approx(prior, abs=1e-8)


def test_convergence_is_what_was_asked_for(drawn):
    assert all(r <= 1.01 for r in drawn.r_hat.values())
    assert all(n >= 4000 for n in drawn.ess.values())
    kept = drawn.provenance["steps"] - drawn.provenance["burn_in"]
    assert all(kept >= 50 * tau for tau in drawn.tau.values())
    # The posterior is nearly Gaussian and the proposal informed by the fit.
    assert drawn.acceptance["independence"] > 0.7


def test_stated_noise_that_is_too_small_is_reported():
    truthful = fit(linear_model(), [experiment(np.random.default_rng(5), stated=NOISE)])
    timid = fit(linear_model(), [experiment(np.random.default_rng(5), stated=NOISE / 4)])
    first, second = (sample(f, seed=1) for f in (truthful, timid))
    assert "not clearly larger than the noise that is stated or estimated" in first.status
    assert "times the stated noise" in second.status
    # The readings are the same, so what is said of the noise and of the parameters must be, too.
    for name in first.names:
        a, b = first.flat()[name], second.flat()[name]
        assert b.mean() == pytest.approx(a.mean(), abs=0.1 * a.std())
        assert b.std() == pytest.approx(a.std(), rel=0.1)


def test_what_was_sampled_is_said(tmp_path):
    """Readings that are noisier than stated, under noise that is independent and noise that is not."""
    timid = fit(linear_model(), [experiment(np.random.default_rng(5), stated=NOISE / 4)])
    heavy = sample(timid, seed=1, noise="student_t", min_effective=1000, r_hat_max=1.1)
    heavy.to_netcdf(tmp_path / "posterior.nc")
    back = Posterior.from_netcdf(tmp_path / "posterior.nc")
    assert (back.status, back.interval, back.meanings) == (heavy.status, heavy.interval, heavy.meanings)
    assert {row["interval"] for row in heavy.summary()} == {heavy.interval}
    assert {row["name"]: row["meaning"] for row in heavy.summary() if "meaning" in row} == {
        "sigma": "noise, scale of Student t",
        "nu": "degrees of freedom: few for many outliers",
    }
    said = [
        (found.interval, found.status)
        for noise in ("gaussian", "student_t", "correlated")
        for found in [dataclasses.replace(heavy, provenance={**heavy.provenance, "noise": noise})]
    ]
    words = ("independent and Gaussian", "independent, with outliers (Student t)", "white and exponentially correlated")
    for (interval, status), taken_as in zip(said, words, strict=True):
        assert interval.endswith(taken_as)
        assert "times the stated noise" in status
        assert f"taken as noise that is {taken_as}, so" in status
    assert ["naive" in status for _, status in said] == [True, True, False]


def test_same_seed_same_draws_and_other_seed_other_draws(linear, drawn):
    np.random.seed(0)  # noqa: NPY002 - the global generator must not matter
    method = "emcee" if drawn.provenance["method"] == "emcee" else "quickest"
    again = sample(linear, seed=11, method=method)
    other = sample(linear, seed=12, method=method)
    assert np.array_equal(again.draws, drawn.draws)
    assert not np.isin(other.draws[..., 0], drawn.draws[..., 0]).any()


def test_ensembles_are_independent(drawn):
    first = [set(chain[..., 0].ravel().tolist()) for chain in drawn.draws]
    assert all(not a & b for i, a in enumerate(first) for b in first[:i])
    # The averages of ensembles over their walkers move on their own.
    mean = drawn.draws.mean(axis=2)[..., 0]
    correlation = np.corrcoef(mean)[np.triu_indices(len(mean), 1)]
    steps = mean.shape[1] / max(drawn.tau.values())
    assert np.abs(correlation).max() < 5 / np.sqrt(steps)


def test_interrupted_run_continues_to_the_same_draws(linear, walked, tmp_path, monkeypatch):
    path = tmp_path / "chain.h5"
    advance, calls = ensembles.Ensemble.advance, []

    def interrupted(self, steps):
        calls.append(steps)
        # In the second block, while other ensembles are at work.
        if len(calls) == 7:
            raise KeyboardInterrupt
        advance(self, steps)

    with monkeypatch.context() as patch:
        patch.setattr(ensembles.Ensemble, "advance", interrupted)
        with pytest.raises(KeyboardInterrupt):
            sample(linear, seed=11, method="emcee", backend_path=path)
    assert path.exists()
    resumed = sample(linear, seed=11, method="emcee", backend_path=path)
    assert np.array_equal(resumed.draws, walked.draws)
    assert np.array_equal(resumed.log_probability, walked.log_probability)
    assert resumed.acceptance == walked.acceptance
    assert [p.name for p in tmp_path.iterdir()] == ["chain.h5"]


def test_where_proposals_are_refuted_walkers_go_on(linear, walked, tmp_path, monkeypatch):
    monkeypatch.setattr(sampling, "independence_chains", lambda *_, **__: None)
    found = sample(linear, seed=11, backend_path=tmp_path / "chain.h5")
    assert found.provenance == walked.provenance
    assert np.array_equal(found.draws, walked.draws)


def test_interrupted_proposals_go_on_to_the_same_draws(linear, tmp_path, monkeypatch):
    path, blocks = tmp_path / "chain.h5", []
    whole = sample(linear, seed=11)

    class Interrupted(Remembered):
        def __call__(self, points):
            blocks.append(len(points))
            if len(blocks) == 3:
                raise KeyboardInterrupt
            return super().__call__(points)

    with monkeypatch.context() as patch:
        patch.setattr("discovery.posterior.checkpoint._KEPT_AFTER", 0.0)
        patch.setattr(sampling, "Remembered", Interrupted)
        with pytest.raises(KeyboardInterrupt):
            sample(linear, seed=11, backend_path=path)
    with h5py.File(path) as file:
        assert len(file["densities"]) >= 1024
    resumed = sample(linear, seed=11, backend_path=path)
    assert np.array_equal(resumed.draws, whole.draws)
    assert np.array_equal(resumed.log_probability, whole.log_probability)
    # And another number of draws, from the same file.
    more, alone = (sample(linear, seed=11, min_effective=6000, backend_path=p) for p in (path, None))
    assert np.array_equal(more.draws, alone.draws)


@pytest.mark.slow
def test_both_ways_give_one_posterior_where_the_motion_is_not_linear():
    """Damping and stiffness from a noisy recording."""
    noisy = experiment(np.random.default_rng(3), noise=8 * NOISE, stated=8 * NOISE)
    fitted = fit(Model("oscillator", EFFECTS), [noisy])
    quick, walked = (sample(fitted, seed=2, method=method) for method in METHODS)
    assert [p.provenance["method"] for p in (quick, walked)] == ["independence", "emcee"]
    for name in quick.names:
        a, b = quick.flat()[name], walked.flat()[name]
        few = min(quick.ess_tail[name], walked.ess_tail[name])
        apart = np.quantile(a, [0.05, 0.5, 0.95]) - np.quantile(b, [0.05, 0.5, 0.95])
        assert np.abs(apart).max() < 10 * b.std() / np.sqrt(few)


_KILLED = """
import os, signal, sys, threading
import numpy as np
sys.path.insert(0, {folder!r})
from test_posterior import experiment, fit, linear_model, sample

def kill_in_the_next_block(progress):
    threading.Timer(0.02, os.kill, (os.getpid(), signal.SIGKILL)).start()

fitted = fit(linear_model(), [experiment(np.random.default_rng(5))])
settings = {{"walkers": 96, "min_effective": 1e9, "method": "emcee"}}
sample(fitted, seed=11, **settings, progress=kill_in_the_next_block, backend_path={path!r})
"""


@pytest.mark.slow
def test_killed_process_continues_to_the_same_draws(linear, tmp_path):
    path = tmp_path / "chain.h5"
    code = _KILLED.format(folder=str(Path(__file__).parent), path=str(path))
    killed = subprocess.run([sys.executable, "-c", code], check=False, capture_output=True, text=True)
    assert killed.returncode == -signal.SIGKILL, killed.stderr
    settings = {"seed": 11, "walkers": 96, "min_effective": 30_000, "method": "emcee"}
    resumed = sample(linear, **settings, backend_path=path)
    whole = sample(linear, **settings)
    assert resumed.provenance["steps"] > 120
    assert np.array_equal(resumed.draws, whole.draws)
    assert np.array_equal(resumed.log_probability, whole.log_probability)


def test_checkpoint_of_another_run_is_refused(linear, tmp_path):
    path = tmp_path / "chain.h5"
    with pytest.raises(NotConverged):
        sample(linear, seed=1, max_steps=250, walkers=64, min_effective=1e9, method="emcee", backend_path=path)
    with pytest.raises(InputError, match="another model, recording or seed"):
        sample(linear, seed=2, backend_path=path)
    path.write_text("no checkpoint")
    with pytest.raises(InputError, match="not a checkpoint"):
        sample(linear, seed=1, backend_path=path)


def test_refusal_carries_the_numbers_and_progress_is_told(linear):
    seen = []
    settings = {"max_steps": 250, "walkers": 64, "min_effective": 1e6, "method": "emcee"}
    with pytest.raises(NotConverged, match="250 steps") as caught:
        sample(linear, seed=1, **settings, progress=seen.append)
    for numbers in (caught.value.tau, caught.value.ess, caught.value.r_hat):
        assert set(numbers) == {"g", "delta_0_init[sine]", "rate_0_init[sine]", "sigma"}
        assert all(np.isfinite(list(numbers.values())))
    assert "effective samples g" in str(caught.value)
    assert [p.partition(" after ")[2].partition(" steps")[0] for p in seen] == ["120", "160", "250"]
    assert all(0 < p.seconds_left < np.inf for p in seen)
    assert seen[-1].done == min(caught.value.ess.values())


@pytest.mark.parametrize(("keyword", "value"), [("ensembles", 3), ("max_steps", 100)])
def test_settings_that_can_tell_nothing_are_refused(linear, keyword, value):
    with pytest.raises(InputError, match="at least"):
        sample(linear, seed=1, **{keyword: value})


def test_degenerate_walkers_are_refused(linear):
    rng = np.random.default_rng(1)
    coords = rng.standard_normal((16, 3))
    ensembles.check_walkers(coords)
    coords[:, 2] = coords[:, 0] - 2 * coords[:, 1]
    with pytest.raises(ComputationError, match="condition number"):
        ensembles.check_walkers(coords)
    coords[:, 2] = 1.0
    with pytest.raises(ComputationError, match="subspace"):
        ensembles.check_walkers(coords)
    with pytest.raises(ComputationError, match="at least 8"):
        sample(linear, seed=1, walkers=7)


def test_a_density_without_support_is_refused():
    seeds = np.random.SeedSequence(1).spawn(4)
    with pytest.raises(ComputationError, match="finite posterior density"):
        ensembles.start_ensembles(lambda z: np.full(len(z), -np.inf), 2, walkers=8, seeds=seeds)


def test_undetermined_parameters_are_refused(linear):
    loose = dataclasses.replace(linear, null_directions=({"g": 0.6, "rate_0_init[sine]": 0.8},))
    with pytest.raises(NotIdentifiable) as caught:
        sample(loose, seed=1)
    assert caught.value.directions[0]["g"] == 0.6


def test_starts_that_hang_together_are_held_by_their_priors(linear):
    starts = dataclasses.replace(linear, null_directions=({"delta_0_init[sine]": 0.6, "rate_0_init[sine]": -0.8},))
    assert log_posterior(starts).names == log_posterior(linear).names


def test_netcdf_keeps_everything(drawn, linear, tmp_path):
    path = tmp_path / "posterior.nc"
    experiments = linear.problem.bench.experiments
    bands = predictive(drawn, experiments, 50, seed=np.random.default_rng(1))
    drawn.to_netcdf(path, experiments)
    back = Posterior.from_netcdf(path)
    for field in dataclasses.fields(Posterior):
        a, b = getattr(drawn, field.name), getattr(back, field.name)
        if field.name == "prior":
            assert a.keys() == b.keys()
            assert all(np.array_equal(a[name], b[name]) for name in a)
        else:
            assert np.array_equal(a, b) if isinstance(a, np.ndarray) else a == b, field.name
    assert back.summary() == drawn.summary()
    assert [p.name for p in tmp_path.iterdir()] == ["posterior.nc"]
    again = predictive(back, experiments, 50, seed=np.random.default_rng(1))
    assert np.array_equal(bands[0].reading, again[0].reading)


def test_netcdf_is_inference_data(drawn, linear, tmp_path):
    path = tmp_path / "posterior.nc"
    experiments = linear.problem.bench.experiments
    drawn.to_netcdf(path, experiments)
    groups = {"posterior", "sample_stats", "prior", "posterior_predictive", "observed_data"}
    with xr.open_datatree(path, engine="h5netcdf") as tree:
        assert set(tree.children) == groups
        gain = tree["posterior"]["g"]
        assert gain.dims == ("chain", "draw")
        assert gain.sizes["chain"] == len(drawn.draws)
        assert gain.attrs["units"] == "V s^-2"
        assert '"seed": 11' in tree["posterior"].attrs["provenance"]
        ensemble, step, walker = 1, 3, drawn.draws.shape[2] - 1
        one = gain.sel(chain=ensemble).where((gain.walker == walker) & (gain.step == step), drop=True)
        assert float(one[0]) == drawn.draws[ensemble, step, walker, 0]
        rate = tree["posterior"]["rate_0_init"]
        assert rate.dims == ("chain", "draw", "recording")
        assert rate.recording.values.tolist() == ["sine"]
        assert tree["sample_stats"]["log_likelihood"].shape == gain.shape == tree["sample_stats"]["lp"].shape
        (recording,) = (e.recording for e in experiments)
        assert np.array_equal(tree["observed_data"]["sine"], recording.output[:, 0])
        assert np.array_equal(tree["observed_data"]["time_sine"], recording.time)
        low, high = np.quantile(tree["posterior_predictive"]["sine"], [0.05, 0.95], axis=(0, 1))
        assert np.mean((recording.output[:, 0] > low) & (recording.output[:, 0] < high)) == pytest.approx(0.9, abs=0.1)


def test_prior_draws_follow_the_declared_priors(linear, drawn):
    assert drawn.prior.keys() == set(drawn.names)
    gain_unit = linear.problem.units.scale(linear.model.parameters["g"])
    assert stats.kstest(drawn.prior["g"], stats.t(3, scale=10 * gain_unit).cdf).pvalue > 1e-3
    assert stats.kstest(np.log(drawn.prior["sigma"] / NOISE), stats.norm(0, NOISE_PRIOR.sd).cdf).pvalue > 1e-3


def test_another_file_is_no_posterior(tmp_path):
    path = tmp_path / "x.nc"
    path.write_text("text")
    with pytest.raises(InputError, match="not a posterior"):
        Posterior.from_netcdf(path)


def test_summary_states_its_intervals(drawn):
    row = drawn.summary()[0]
    assert row["name"] == "g"
    assert row["mcse"] == pytest.approx(row["sd"] / np.sqrt(row["ess"]))
    assert 0.2 < row["ess_tail"] / row["ess"] < 2
    assert row["interval"].startswith("equal-tailed 90 %")
    assert np.quantile(drawn.flat()["g"], [0.05, 0.95]).tolist() == [row["q05"], row["q95"]]
    assert abs(row["mean"] - row["fit_value"]) < 0.2 * row["fit_sd"]
    assert drawn.summary()[-1]["unit"] == "V"


def test_bands_are_those_of_the_linear_problem(linear, drawn):
    best, scale, dof, s = analytic(linear)
    (band,) = predictive(drawn, linear.problem.bench.experiments, 2000, seed=np.random.default_rng(3))
    design = responses()
    spread = np.sqrt(np.einsum("ni,ij,nj->n", design, scale, design))
    width = 2 * stats.t(dof).ppf(0.95)
    assert band.motion[1, :, 0] == pytest.approx(design @ best, abs=0.2 * spread.max())
    assert band.motion[2, :, 0] - band.motion[0, :, 0] == pytest.approx(width * spread, rel=0.2, abs=1e-6)
    total = np.sqrt(spread**2 + s**2)
    assert band.reading[2, :, 0] - band.reading[0, :, 0] == pytest.approx(width * total, rel=0.2)


def test_band_of_a_new_recording_starts_as_told(drawn):
    new = experiment(np.random.default_rng(8), name="new")
    rest, told = (
        predictive(drawn, [new], 50, seed=np.random.default_rng(1), initial=initial)[0]
        for initial in (None, {"new": (0.25, 0.0)})
    )
    assert rest.motion[:, 0, 0].tolist() == [0, 0, 0]
    assert told.motion[:, 0, 0] == pytest.approx([0.25] * 3)


def test_two_instruments_have_a_noise_each():
    one, two = experiment(np.random.default_rng(1)), experiment(np.random.default_rng(2), name="other", noise=3 * NOISE)
    both = [one, dataclasses.replace(two, recording=dataclasses.replace(two.recording, channels=("tip_deflection",)))]
    parts = instruments(both)
    assert [p.name for p in parts] == ["sigma[output]", "sigma[tip_deflection]"]
    # The oscillator knows one channel only, so the fit sees one instrument and the likelihood is told of two.
    fitted = fit(linear_model(), [one, two])
    target = log_posterior(fitted)
    assert target.names[-1] == "sigma"
    target = dataclasses.replace(target, instruments=parts)
    x, sigmas = fitted.minimum.x, np.array([0.5, 4.0])
    vector = np.concatenate([x, np.log(sigmas)])
    expected = sum(
        stats.norm.logpdf(e.recording.output[:, 0], responses() @ [x[0], *start], NOISE * factor).sum()
        for e, start, factor in zip([one, two], [x[1:3], x[3:5]], sigmas, strict=True)
    )
    assert target.log_likelihood(vector[None]) == pytest.approx([expected], abs=1e-3)


def test_gaps_and_held_out_samples_do_not_count():
    whole = experiment(np.random.default_rng(1))
    output = whole.recording.output.copy()
    output[20:30] = np.nan
    gap = dataclasses.replace(whole, recording=dataclasses.replace(whole.recording, output=output), fitted_samples=100)
    (part,) = instruments([gap])
    assert part.n == 90
    target = log_posterior(fit(linear_model(), [gap]))
    x = target.centre.copy()
    used = np.r_[0:20, 30:100]
    expected = stats.norm.logpdf(output[used, 0], responses()[used] @ x[:3], NOISE * np.exp(x[3])).sum()
    assert target.log_likelihood(x[None]) == pytest.approx([expected], abs=1e-3)


def test_several_recordings_partly_held_out_count_as_their_fitted_parts():
    parts = [experiment(np.random.default_rng(i), name=f"run {i}") for i in range(2)]
    held_out = [dataclasses.replace(e, fitted_samples=n) for e, n in zip(parts, (100, 60), strict=True)]
    cut = [e.first(n) for e, n in zip(parts, (100, 60), strict=True)]
    targets = [log_posterior(fit(linear_model(), each)) for each in (held_out, cut)]
    np.testing.assert_allclose(targets[0].centre, targets[1].centre, rtol=1e-6)
    np.testing.assert_allclose(targets[0].factor, targets[1].factor, rtol=1e-4, atol=1e-9)


def test_a_parameter_at_its_bound_has_a_one_sided_posterior():
    """Undamped data: the damping is at zero, and its posterior is the part of a Gaussian that is not negative."""
    fitted = fit(Model("oscillator", EFFECTS), [experiment(np.random.default_rng(7), xi=-0.004)])
    assert "xi" in fitted.reasons
    posterior = sample(fitted, seed=1)
    xi = posterior.flat()["xi"]
    assert xi.min() >= 0
    assert posterior.r_hat["xi"] <= 1.01
    assert stats.skew(xi) > 0.5
    assert posterior.summary()[posterior.names.index("xi")]["fit_sd"] is None


@pytest.mark.slow
def test_intervals_cover_as_often_as_they_say():
    """Twenty recordings with damping and stiffness unknown: the 90 % intervals hold the truth in about 18 of them."""
    model = Model("oscillator", EFFECTS)
    hits = dict.fromkeys(("xi", "alpha", "g", "sigma"), 0)
    truth = {"xi": XI, "alpha": ALPHA, "g": GAIN, "sigma": NOISE}
    for seed in range(20):
        posterior = sample(fit(model, [experiment(np.random.default_rng(100 + seed))]), seed=seed)
        for row in posterior.summary():
            if row["name"] in hits:
                hits[row["name"]] += row["q05"] <= truth[row["name"]] <= row["q95"]
    low = stats.binom(20, 0.9).ppf(0.001)
    assert all(count >= low for count in hits.values()), hits
    # Not too wide either: of all together, some must miss.
    assert sum(hits.values()) < 80, hits
