"""A posterior in ArviZ: chains, diagnostics, pictures and scores, on a problem with a known answer."""

from __future__ import annotations

import dataclasses

import driven_oscillator
import numpy as np
import pytest
from driven_oscillator import linear_model
from test_posterior import experiment

from discovery.estimation.fit import fit
from discovery.foundation.errors import InputError
from discovery.posterior.draws import Posterior
from discovery.posterior.inference_data import arranged, attributes, by_name, of_readings
from discovery.posterior.sampling import METHODS, sample
from discovery.recordings.experiment import Experiment

pytestmark = pytest.mark.filterwarnings("ignore::FutureWarning", "ignore::DeprecationWarning", "ignore::UserWarning")


@pytest.fixture(scope="module")
def recordings() -> list[Experiment]:
    rng = np.random.default_rng(5)
    first, second = (experiment(rng, name=name) for name in ("low swing", "high swing"))
    output = second.recording.output.copy()
    output[30:35] = np.nan
    return [first, dataclasses.replace(second, recording=dataclasses.replace(second.recording, output=output))]


@pytest.fixture(scope="module", params=METHODS)
def drawn(request: pytest.FixtureRequest, recordings: list[Experiment]) -> Posterior:
    return sample(fit(linear_model(), recordings), seed=11, method=request.param)


def test_names_become_dimensions_and_come_back() -> None:
    rng = np.random.default_rng(1)
    names = ("xi", "rate_0_init[a b]", "rate_0_init[c[1]]", "sigma[tip_x+tip_y]", "sigma[tip_angle]")
    values = {name: rng.normal(size=(4, 7, 3)) for name in names}
    said = {name: {"units": "s", "tau": float(i)} for i, name in enumerate(names)}
    dataset = arranged(values, said)
    assert set(dataset.data_vars) == {"xi", "rate_0_init", "sigma"}
    assert dataset["rate_0_init"].recording.values.tolist() == ["a b", "c[1]"]
    assert dataset["sigma"].instrument.values.tolist() == ["tip_x+tip_y", "tip_angle"]
    assert dataset.sizes["chain"] == 4
    for name, found in by_name(dataset).items():
        assert np.array_equal(found, values[name])
    assert {name: float(own["tau"]) for name, own in attributes(dataset).items()} == {
        name: float(i) for i, name in enumerate(names)
    }


def test_every_value_has_its_unit(drawn: Posterior, recordings: list[Experiment]) -> None:
    tree = drawn.to_arviz(recordings, draws=40)
    for group in ("observed_data", "posterior_predictive"):
        assert {told.attrs["units"] for told in tree[group].data_vars.values()} == {recordings[0].recording.units[0]}
    assert all("units" not in told.attrs for told in tree["log_likelihood"].data_vars.values())
    prior = tree["prior"].to_dataset()
    assert {name: prior[name].attrs["units"] for name in ("g", "sigma")} == {
        name: drawn.units[name] for name in ("g", "sigma")
    }


def test_channels_of_different_units_have_them_reading_by_reading() -> None:
    channel = {"a": ("angle", "x"), "b": ("x", "x")}
    values = {name: np.zeros(2) for name in channel}
    found = of_readings(values, values, channel, {"angle": "rad", "x": "m"})
    assert found["units_a"].values.tolist() == ["rad", "m"]
    assert "units" not in found["a"].attrs
    assert found["b"].attrs["units"] == "m"
    assert "units_b" not in found.coords


def test_the_log_likelihood_of_single_readings_adds_up(drawn: Posterior, recordings: list[Experiment]) -> None:
    tree = drawn.to_arviz(recordings, draws=40)
    scores = tree["log_likelihood"].to_dataset()
    low, high = map(driven_recorded, recordings)
    assert scores["readings"].shape == (len(drawn.draws), 40 // len(drawn.draws), low + high)
    assert scores.recording.values.tolist() == ["low swing"] * low + ["high swing"] * high
    assert np.array_equal(scores.time[:low], tree["observed_data"]["time_low_swing"])
    assert np.allclose(scores["readings"].sum(axis=-1), tree["sample_stats"]["log_likelihood"], atol=1e-3)


def driven_recorded(recording: Experiment) -> int:
    return int(np.isfinite(recording.recording.output).sum())


def test_correlated_errors_have_no_single_readings(drawn: Posterior, recordings: list[Experiment]) -> None:
    correlated = dataclasses.replace(drawn, provenance={**drawn.provenance, "noise": "correlated"})
    with pytest.raises(InputError, match="leave-one-out with it, means nothing"):
        correlated.to_arviz(recordings)
    assert "log_likelihood" not in correlated.to_arviz(recordings, draws=40, pointwise=False).children


def test_other_recordings_are_refused(drawn: Posterior) -> None:
    with pytest.raises(InputError, match="'other' was not fitted: the posterior is of low swing, high swing"):
        drawn.to_arviz([experiment(np.random.default_rng(1), name="other")])


def test_arviz_sees_ensembles_as_chains(drawn: Posterior, recordings: list[Experiment]) -> None:
    arviz = pytest.importorskip("arviz")
    whole = arviz.from_datatree(drawn.to_tree(recordings))
    table = arviz.summary(whole, round_to="none")
    mean_of = {"g": "g", "sigma": "sigma", "rate_0_init[high swing]": "rate_0_init[high swing]"}
    for row in drawn.summary():
        name = mean_of.get(row["name"])
        if name is None:
            continue
        assert float(table.loc[name, "mean"]) == pytest.approx(row["mean"])
        # Each walker's own autocorrelation against that of the pooled ensemble.
        assert float(table.loc[name, "ess_bulk"]) == pytest.approx(row["ess"], rel=0.4)
        assert float(table.loc[name, "r_hat"]) == pytest.approx(row["r_hat"], abs=0.01)


def test_arviz_draws_and_scores(drawn: Posterior, recordings: list[Experiment]) -> None:
    arviz = pytest.importorskip("arviz")
    import matplotlib.pyplot as plt

    plt.switch_backend("Agg")
    data = arviz.from_datatree(drawn.to_arviz(recordings))
    assert arviz.plot_pair(data, var_names=["g", "sigma"]) is not None
    assert arviz.plot_ppc(data, num_pp_samples=20) is not None
    plt.close("all")
    score = arviz.loo(data, pointwise=True)
    assert (score.pareto_k < 0.7).all()
    # For errors of known size the expected score of a reading is that of a normal density, less what is fitted.
    n, sd = sum(map(driven_recorded, recordings)), driven_oscillator.NOISE
    assert score.elpd_loo == pytest.approx(-n * (0.5 * np.log(2 * np.pi * sd**2) + 0.5), abs=4 * np.sqrt(n / 2))
    wrong = data.copy()
    wrong.log_likelihood["readings"] = wrong.log_likelihood["readings"] - 1.0
    ranked = arviz.compare({"right": data, "wrong": wrong})
    assert ranked.index[0] == "right"
    assert ranked.loc["wrong", "elpd_diff"] == pytest.approx(n, rel=1e-6)
