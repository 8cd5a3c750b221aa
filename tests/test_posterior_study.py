"""The study of a posterior whose truth is known: what is stored, and how many readings its bands hold."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest
from scipy import stats
from test_posterior import EFFECTS, NOISE, START, experiment

from discovery.equations.model import Model
from discovery.estimation.fit import fit
from discovery.foundation.errors import SimulationFailure
from discovery.posterior.predictive import Band, fitted_starts, predictive
from discovery.posterior.sampling import sample
from discovery.posterior.study import study_posterior


@pytest.fixture(scope="module")
def sampled():
    train = experiment(np.random.default_rng(21), name="train")
    fitted = fit(Model("oscillator", EFFECTS), [train])
    return train, fitted, sample(fitted, seed=2, min_effective=1500)


@pytest.fixture(scope="module")
def held():
    rng = np.random.default_rng(22)
    return [experiment(rng, name="like"), experiment(rng, noise=2 * NOISE, name="louder")]


@pytest.fixture(scope="module")
def study(sampled, held):
    _, fitted, posterior = sampled
    return study_posterior(posterior, fitted, held, rng=np.random.default_rng(3), draws=300)


def test_the_summary_is_plain_json(study) -> None:
    summary = json.loads(json.dumps(study.summary(), allow_nan=False))
    assert set(summary) == {"priors", "profiles", "correlations", "autocorrelation", "coverage"}
    assert [p["name"] for p in summary["priors"]] == [p["name"] for p in summary["profiles"]] == ["g", "xi", "alpha"]
    assert not any(p["sensitive"] for p in summary["priors"])
    for p in summary["profiles"]:
        assert max(p["prior_density"]) == 1.0
        assert len(p["prior_density"]) == len(p["prior_values"])


def test_profile_and_posterior_agree_where_the_data_decide(sampled, study) -> None:
    rows = {r["name"]: r for r in sampled[2].summary()}
    for p in study.profiles:
        r = rows[p.name]
        assert p.interval == pytest.approx((r["q05"], r["q95"]), abs=0.2 * r["sd"])


def test_bands_hold_nine_readings_in_ten_and_fewer_of_a_louder_instrument(study) -> None:
    share = {c.recording: c.share for c in study.coverage}
    assert {c.recording: c.part for c in study.coverage} == {
        "train": "fitted",
        "like": "held out",
        "louder": "held out",
    }
    # Three standard deviations of 151 readings.
    assert share["train"] == pytest.approx(0.9, abs=0.075)
    assert share["like"] == pytest.approx(0.9, abs=0.075)
    assert share["louder"] == pytest.approx(2 * stats.norm.cdf(1.645 / 2) - 1, abs=0.12)
    assert [c.width for c in study.coverage] == pytest.approx([2 * 1.645 * NOISE] * 3, rel=0.15)


def test_a_recording_whose_end_was_held_out_has_two_parts(sampled) -> None:
    train, fitted, posterior = sampled
    part = dataclasses.replace(train, fitted_samples=100)
    bench = type(fitted.problem.bench)("oscillator", fitted.problem.bench.effects, [part], fitted.problem.bench.step)
    problem = dataclasses.replace(fitted.problem, bench=bench)
    found = study_posterior(posterior, dataclasses.replace(fitted, problem=problem), rng=np.random.default_rng(3))
    assert [(c.part, c.readings) for c in found.coverage] == [("fitted", 100), ("held out", 51)]


def test_a_recording_in_which_the_motion_blows_up_has_no_band(sampled, held, monkeypatch) -> None:
    def blowing(posterior, experiments, *rest, **more):  # type: ignore[no-untyped-def]
        if any(e.recording.name == "louder" for e in experiments):
            raise SimulationFailure({}, 1.0, "the motion is not finite any more.")
        return predictive(posterior, experiments, *rest, **more)

    monkeypatch.setattr("discovery.posterior.study.predictive", blowing)
    _, fitted, posterior = sampled
    found = study_posterior(posterior, fitted, held, rng=np.random.default_rng(3))
    assert [band.name for band in found.bands] == ["train", "like"]
    assert {c.recording for c in found.coverage} == {"train", "like"}
    # What was fitted must not.
    monkeypatch.setattr("discovery.posterior.study.predictive", lambda *_, **__: blowing(posterior, held))
    with pytest.raises(SimulationFailure):
        study_posterior(posterior, fitted, rng=np.random.default_rng(3))


def test_starts_of_what_was_not_fitted_are_found(sampled, held) -> None:
    starts = fitted_starts(sampled[2], held[:1])
    assert starts["like"] == pytest.approx(START, abs=0.06)
    assert fitted_starts(sampled[2], []) == {}


def test_curves_come_by_recording(study) -> None:
    curves = study.curves()
    assert list(curves) == ["train", "like", "louder"]
    group = curves["train"]
    assert (group["reading_q05"] < group["motion_q05"]).all()
    assert (group["motion_q05"] <= group["motion_q95"]).all()
    assert group.attrs["units"] == ["V"]


def test_coverage_leaves_gaps_out() -> None:
    quantiles = np.array([-1.0, 0.0, 1.0])[:, None, None] * np.ones((3, 4, 2))
    band = Band("a", np.arange(4.0), ("x", "y"), ("m", "m"), quantiles, quantiles)
    measured = np.array([[0.5, 0.0], [np.nan, 2.0], [-3.0, 0.0], [1.0, np.nan]])
    assert band.coverage(measured) == pytest.approx([2 / 3, 2 / 3])


def test_outliers_widen_the_band_of_a_reading(sampled) -> None:
    train, _, posterior = sampled
    heavy = dataclasses.replace(
        posterior,
        names=(*posterior.names, "nu"),
        draws=np.concatenate([posterior.draws, np.full((*posterior.draws.shape[:3], 1), 3.0)], axis=-1),
        provenance={**posterior.provenance, "noise": "student_t"},
    )
    widths = []
    for chosen in (posterior, heavy):
        (band,) = predictive(chosen, [train], n=1500, seed=np.random.default_rng(1))
        widths.append(float((band.reading[2] - band.reading[0]).mean()))
    assert widths[1] / widths[0] == pytest.approx(stats.t.ppf(0.95, 3) / stats.norm.ppf(0.95), rel=0.05)
