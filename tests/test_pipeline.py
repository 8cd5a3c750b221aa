from __future__ import annotations

import hashlib
import json
import shutil
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from scipy.integrate import solve_ivp

from discovery.estimation.predict import predict
from discovery.foundation.errors import ComputationError
from discovery.foundation.progress import Progress, Tell
from discovery.recordings.dataset import Dataset, load_dataset
from discovery.report import build_report
from discovery.results.provenance import plain
from discovery.runs import regression_stage, stages
from discovery.runs.answer import Answer
from discovery.runs.description import describe
from discovery.runs.loop_files import save_prediction, write_loop
from discovery.runs.pipeline import add_posterior, answer, run
from discovery.runs.processes import TimeIsUp

#: The words and files of pages are what is tested here.
pytestmark = pytest.mark.usefixtures("few_draws", "undrawn")

ARM = Path(__file__).parents[1] / "datasets" / "arm"
SEED = 3
ANSWER = {"amplitude.nc", "laws.nc", "loop.json", "results.json", "trajectories.nc"}
FILES = {"amplitude.nc", "laws.nc", "loop.json", "posterior.nc", "predictive.nc", "results.json", "trajectories.nc"}


def silent(message: str) -> None:
    """Hear progress and say nothing."""


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Ten seconds of the twin at 25 Hz, with the noise-free tip beside the hold-out."""
    folder = tmp_path_factory.mktemp("inputs")
    pieces = {
        "train_large": ("train", 1001),
        "holdout_inside": ("hold", 801),
        "holdout_inside_clean": ("hold_clean", 801),
    }
    for source, (name, rows) in pieces.items():
        pd.read_csv(ARM / f"{source}.csv").iloc[:rows:4].to_csv(folder / f"{name}.csv", index=False)
    return folder


@pytest.fixture(scope="module")
def dataset(inputs: Path) -> Dataset:
    return load_dataset(ARM / "rig.toml", [inputs / "train.csv"], [inputs / "hold.csv"])


@pytest.fixture(scope="module")
def begun(dataset: Dataset, tmp_path_factory: pytest.TempPathFactory) -> Answer:
    """A run whose loop is done, in a folder that was not there."""
    folder, told = tmp_path_factory.mktemp("runs") / "new" / "folder", ["discovery", "run", "rig.toml"]
    return answer(dataset, folder, seed=SEED, progress=silent, command=told, note="A simulated arm.")


@pytest.fixture(scope="module")
def out(begun: Answer, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of the same run when all is done; the circuit below is run in one go."""
    folder = tmp_path_factory.mktemp("whole")
    add_posterior(copied(begun, folder), progress=silent)
    return folder


@pytest.fixture(scope="module")
def fits(dataset: Dataset) -> stages.Fits:
    return stages.estimate(dataset, progress=silent)


@pytest.fixture(scope="module")
def results(out: Path) -> dict[str, Any]:
    return json.loads((out / "results.json").read_text(encoding="utf-8"))


def numbers(results: dict[str, Any]) -> dict[str, Any]:
    """Return results without what differs from run to run by right."""
    return {k: v for k, v in results.items() if k != "provenance"}


# What is written.


def test_every_file_is_there_and_nothing_else(out: Path) -> None:
    assert {p.name for p in out.iterdir()} == FILES


def test_the_results_hold_every_stage(results: dict[str, Any]) -> None:
    assert set(results) >= {
        *("provenance", "data_note", "rig", "recordings", "discovery", "radius", "fits", "fit_errors", "posterior"),
        *("elastica", "loop", "clean"),
    }
    assert results["data_note"] == "A simulated arm."
    assert [(r["name"], r["role"], r["samples"]) for r in results["recordings"]] == [
        ("train", "train", 251),
        ("hold", "holdout", 201),
    ]
    assert results["recordings"][0]["rate_hz"] == pytest.approx(25.0)
    assert set(results["fits"]) == {"linear", "constant_radius", "declared"}
    assert results["posterior"]["subject"] == "declared"


def test_the_rate_is_that_of_the_whole_recording_where_times_are_rounded(dataset: Dataset) -> None:
    first = dataset.train[0]
    rounded = replace(first.recording, time=np.round(np.arange(first.recording.time.size) / 30, 3))
    said = describe(replace(dataset, train=(replace(first, recording=rounded),)))["recordings"][0]
    assert said["rate_hz"] == pytest.approx(30.0, rel=1e-4)


def test_the_loop_is_written_once_and_read_the_same_twice(out: Path, results: dict[str, Any]) -> None:
    assert json.loads((out / "loop.json").read_text(encoding="utf-8")) == results["loop"]


def test_the_provenance_says_where_everything_came_from(inputs: Path, results: dict[str, Any]) -> None:
    found = results["provenance"]
    assert found["seed"] == SEED
    assert found["command"] == "discovery run rig.toml"
    assert found["rig_sha256"] == hashlib.sha256((ARM / "rig.toml").read_bytes()).hexdigest()
    assert [(d["name"], d["role"], d["sha256"]) for d in found["data"]] == [
        (name, role, hashlib.sha256((inputs / f"{name}.csv").read_bytes()).hexdigest())
        for name, role in (("train", "train"), ("hold", "holdout"))
    ]


# The numbers are those of the stages.


def test_fits_and_discovery_are_those_of_the_stages(
    dataset: Dataset, fits: stages.Fits, results: dict[str, Any]
) -> None:
    found = regression_stage.discover(dataset, seed=SEED, progress=silent)
    expected = json.loads(json.dumps(plain({**fits.summary(), **found.summary()})))
    assert {k: results[k] for k in expected} == expected


def test_the_loop_and_the_trajectories_are_those_of_the_stage(
    dataset: Dataset, begun: Answer, out: Path, results: dict[str, Any]
) -> None:
    loop = begun.loop
    assert results["loop"] == json.loads(json.dumps(plain(loop.summary())))
    for i, e in enumerate((*dataset.train, *dataset.holdout)):
        with xr.open_dataset(out / "trajectories.nc", group=e.recording.name, engine="h5netcdf") as group:
            np.testing.assert_array_equal(group["measured"], e.recording.output)
            np.testing.assert_array_equal(group["time"], e.recording.time)
            np.testing.assert_array_equal(group["before"], loop.predictions["before"][i])
            np.testing.assert_array_equal(group["after"], loop.predictions["after"][i])
            assert group.attrs["role"] == ("train", "holdout")[i]
            assert int(group["fitted"].sum()) == (251, 0)[i]
            # The reported error is that of the drawn curve.
            distance = np.hypot(*(group["after"].values - group["measured"].values).T)
            key = ("train", "holdout")[i]
            assert results["loop"]["errors"]["after"][key]["mean"] == pytest.approx(distance.mean())


def test_the_posterior_is_that_of_the_file_and_covers_the_fit(out: Path, results: dict[str, Any]) -> None:
    from discovery.posterior.draws import Posterior

    saved = Posterior.from_netcdf(out / "posterior.nc")
    rows = {row["name"]: row for row in results["posterior"]["rows"]}
    for name, draws in saved.flat().items():
        assert rows[name]["mean"] == pytest.approx(float(np.mean(draws)), rel=1e-6, abs=1e-9)
    declared = results["fits"]["declared"]["parameters"]
    for name in ("alpha", "gamma"):
        assert abs(rows[name]["mean"] - declared[name]["value"]) < rows[name]["sd"]


def test_the_elasticas_prediction_is_compared_with_the_posterior(out: Path, results: dict[str, Any]) -> None:
    assert {row["parameter"] for row in results["elastica"]["comparison"]} >= {"alpha", "beta/alpha", "gamma"}
    with xr.open_dataset(out / "laws.nc", group="laws", engine="h5netcdf") as laws:
        assert float(laws["delta"][-1]) > results["elastica"]["delta_max"]
        # Every law begins like the linear one, at the full length.
        for name in ("elastica_torque", "posterior_spring_q50"):
            slope = float(laws[name][1] / laws["delta"][1])
            assert slope == pytest.approx(1.0, abs=0.01)
        assert float(laws["elastica_radius"][0]) == pytest.approx(1.0)
    with xr.open_dataset(out / "laws.nc", group="measured", engine="h5netcdf") as measured:
        assert float(measured["rho"].max()) < 1.01


def test_frequency_against_amplitude_of_data_and_models(out: Path) -> None:
    groups = {}
    for name in ("measured", "linear", "before", "after"):
        with xr.open_dataset(out / "amplitude.nc", group=name, engine="h5netcdf") as group:
            groups[name] = group["frequency"].values, group["amplitude"].values
    # The large swings of a hard spring are up to two per cent faster than small ones at 2.845 rad/s.
    assert 1.0 < np.median(groups["measured"][0]) / (2.845 / (2 * np.pi)) < 1.02
    assert np.abs(groups["after"][0] - groups["measured"][0]).max() < 2e-3
    assert np.ptp(groups["linear"][0]) < 1e-3


def test_distances_to_the_noise_free_tip_are_given_where_it_is_known(inputs: Path, out: Path, results: dict[str, Any]):
    clean = pd.read_csv(inputs / "hold_clean.csv")[["tip_x_m", "tip_y_m"]].to_numpy()
    with xr.open_dataset(out / "trajectories.nc", group="hold", engine="h5netcdf") as group:
        np.testing.assert_array_equal(group["clean"], clean)
        for label in ("linear", "before", "after"):
            distance = np.hypot(*(group[label].values - clean).T)
            assert results["clean"]["hold"][label]["mean"] == pytest.approx(distance.mean())
            assert results["clean"]["hold"][label]["peak"] == pytest.approx(distance.max())
    found = {k: v["mean"] for k, v in results["clean"]["hold"].items()}
    assert found["after"] < 0.3e-3 < found["before"] < found["linear"]


# Again, and interrupted.


def test_the_seeds_of_the_stages_differ() -> None:
    seeds = {stages.stage_seed(seed, stage) for seed in (1, 2) for stage in ("discover", "posterior", "elastica")}
    assert len(seeds) == 6
    assert stages.stage_seed(1, "posterior") == stages.stage_seed(1, "posterior")


class Interruption(Exception):
    """What stops a run at a chosen message."""


def interrupt_at(text: str):
    def tell(message: str) -> None:
        if message.startswith(text):
            raise Interruption

    return tell


def sound(folder: Path) -> set[str]:
    """Check that every file of an interrupted run is whole, and return their names."""
    for path in folder.iterdir():
        assert not path.name.startswith(".")
        if path.suffix == ".json":
            json.loads(path.read_text(encoding="utf-8"))
        else:
            assert path.stat().st_size > 0
    return {p.name for p in folder.iterdir()}


@pytest.mark.parametrize(
    ("message", "left"),
    [
        ("searching the library", set()),
        ("refitting the declared model", set()),
        pytest.param("checking against the elastica", set(), marks=pytest.mark.slow),
        pytest.param("profile likelihoods", {*ANSWER, "posterior_chains.h5"}, marks=pytest.mark.slow),
    ],
)
def test_an_interrupted_run_leaves_whole_files_only(
    message: str, left: set[str], dataset: Dataset, tmp_path: Path
) -> None:
    with pytest.raises(Interruption):
        run(dataset, tmp_path, seed=SEED, progress=interrupt_at(message))
    assert sound(tmp_path) == left


@pytest.mark.slow
def test_sampling_goes_on_where_it_was_interrupted(dataset: Dataset, results: dict[str, Any], tmp_path: Path) -> None:
    """The same seed gives the same numbers, in one go or in two."""
    with pytest.raises(Interruption):
        run(dataset, tmp_path, seed=SEED, progress=interrupt_at("sampling the posterior: "))
    assert "posterior_chains.h5" in sound(tmp_path)
    again = run(dataset, tmp_path, seed=SEED, progress=silent)
    assert json.loads(json.dumps(plain(numbers(again)))) == {**numbers(results), "data_note": ""}
    assert {p.name for p in tmp_path.iterdir()} == FILES


def copied(begun: Answer, folder: Path) -> Answer:
    shutil.copytree(begun.out, folder, dirs_exist_ok=True)
    return replace(begun, out=folder)


def page_of(folder: Path) -> str:
    return build_report(folder).read_text(encoding="utf-8")


@pytest.mark.slow
def test_recordings_too_long_for_predictive_bands_are_no_trouble(
    begun: Answer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("discovery.posterior.study.LONGEST_BAND", 10)
    add_posterior(copied(begun, tmp_path), progress=silent)
    assert {p.name for p in tmp_path.iterdir()} == FILES - {"predictive.nc"}


def test_the_answer_is_there_before_sampling_begins(
    begun: Answer, results: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: Any, **__: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(stages, "sampled", interrupted)
    found = copied(begun, tmp_path)
    with pytest.raises(KeyboardInterrupt):
        add_posterior(found, progress=silent)
    assert {p.name for p in tmp_path.iterdir()} == ANSWER
    there = json.loads((tmp_path / "results.json").read_text(encoding="utf-8"))
    assert there["loop"] == results["loop"]
    assert there["posterior"] is None
    assert there["pending"]["because"] == "running"
    # The folder is whole, and its page says what is missing.
    assert "This was written before the posterior and what it predicts and the noise models" in page_of(tmp_path)


def test_time_that_is_up_ends_the_sampler_and_is_told(
    begun: Answer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def slow(*_: Any, progress: Tell, **__: Any) -> None:
        progress(Progress.counting("sampling the posterior", 1234.5, 4000.0, "effective samples"))
        time.sleep(60)

    monkeypatch.setattr(stages, "sampled", slow)
    found, began = copied(begun, tmp_path), time.monotonic()
    content = add_posterior(found, progress=silent, seconds=0.2)
    assert time.monotonic() - began < 30
    assert content["pending"]["because"] == "time"
    assert content["posterior"] is None
    page = page_of(tmp_path)
    assert "The time limit left out the posterior and what it predicts and the noise models" in page
    assert "1234 of 4000 effective samples were there." in page or "1235 of 4000" in page


def test_time_that_is_up_after_sampling_leaves_the_posterior(
    begun: Answer, results: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_more(*_: Any, **__: Any) -> None:
        raise TimeIsUp

    found = copied(begun, tmp_path)
    with monkeypatch.context() as patch:
        patch.setattr(stages, "compared", no_more)
        content = add_posterior(found, progress=silent)
    assert plain(content["posterior"]) == results["posterior"]
    assert content["pending"]["left_out"] == ["the noise models and the evidence of the models"]
    assert "The time limit left out the noise models and the evidence" in page_of(tmp_path)
    # With less time than before, what is there stays.
    again = replace(found)
    assert again.kept["posterior"]
    assert add_posterior(again, progress=silent, seconds=0)["posterior"] == results["posterior"]
    assert json.loads((tmp_path / "results.json").read_text(encoding="utf-8"))["posterior"] == results["posterior"]


def test_less_time_takes_nothing_from_a_whole_run(
    begun: Answer, out: Path, results: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_more(*_: Any, **__: Any) -> None:
        raise TimeIsUp

    shutil.copytree(out, tmp_path, dirs_exist_ok=True)
    monkeypatch.setattr(stages, "compared", no_more)
    found = replace(begun, out=tmp_path, content={**begun.content, "data_note": results["data_note"]})
    assert add_posterior(found, progress=silent)["evidence"] == results["evidence"]
    assert json.loads((tmp_path / "results.json").read_text(encoding="utf-8")) == results


def test_a_posterior_that_fails_leaves_the_answer(
    begun: Answer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def failing(*_: Any, **__: Any) -> None:
        raise ComputationError("The ensembles did not converge in 20000 steps.")

    monkeypatch.setattr(stages, "sampled", failing)
    with pytest.raises(ComputationError, match="did not converge"):
        add_posterior(copied(begun, tmp_path), progress=silent)
    assert "The ensembles did not converge in" in page_of(tmp_path)


def test_another_answer_is_not_kept(begun: Answer, tmp_path: Path) -> None:
    found = copied(begun, tmp_path)
    assert found.kept
    content = {**begun.content, "provenance": {**begun.content["provenance"], "seed": SEED + 1}}
    assert not replace(found, content=content).kept


def test_a_write_that_fails_leaves_the_old_file(dataset: Dataset, tmp_path: Path) -> None:
    (tmp_path / "loop.json").write_text("{}", encoding="utf-8")

    class Broken:
        def summary(self) -> dict[str, Any]:
            return {"effects": {1, 2}}

    with pytest.raises(TypeError):
        write_loop(tmp_path, Broken())  # type: ignore[arg-type]
    assert (tmp_path / "loop.json").read_text(encoding="utf-8") == "{}"
    assert [p.name for p in tmp_path.iterdir()] == ["loop.json"]


# Predictions.


def test_a_prediction_is_written_with_its_deviations(dataset: Dataset, fits: stages.Fits, tmp_path: Path) -> None:
    before, after = fits.models["linear"], fits.models["declared"]
    (wanted,) = dataset.holdout
    save_prediction(tmp_path / "prediction.csv", wanted, before, after)
    table = pd.read_csv(tmp_path / "prediction.csv")
    assert list(table)[:5] == ["time_s", "tip_x_before_m", "tip_y_before_m", "tip_x_after_m", "tip_y_after_m"]
    np.testing.assert_allclose(table["time_s"], wanted.recording.time)
    value, sd = predict(after, wanted)
    for k, axis in enumerate("xy"):
        np.testing.assert_allclose(table[f"tip_{axis}_after_m"], value[:, k], rtol=1e-8, atol=1e-9)
        np.testing.assert_allclose(table[f"tip_{axis}_after_sd_m"], sd[:, k], rtol=1e-7, atol=1e-9)
    save_prediction(tmp_path / "erring.csv", wanted, before, after, errors=(0.0, 2e-3))
    erring = pd.read_csv(tmp_path / "erring.csv")
    np.testing.assert_allclose(erring["tip_x_after_sd_m"], np.hypot(sd[:, 0], 2e-3), rtol=1e-7)
    np.testing.assert_allclose(erring["tip_x_before_sd_m"], table["tip_x_before_sd_m"])
    late = replace(wanted, rig=wanted.rig.counted_from(1000.0))
    save_prediction(tmp_path / "late.csv", late, before, after)
    np.testing.assert_allclose(pd.read_csv(tmp_path / "late.csv")["time_s"], wanted.recording.time + 1000.0)
    save_prediction(tmp_path / "moved.csv", wanted, before, after, (0.2, -0.1))
    moved = pd.read_csv(tmp_path / "moved.csv")
    angle = np.arctan2(moved["tip_y_after_m"][0], moved["tip_x_after_m"][0])
    assert angle - wanted.motor_angle[0] == pytest.approx(0.2, abs=1e-6)


def test_a_declared_model_that_blows_up_leaves_its_columns_empty(
    dataset: Dataset, fits: stages.Fits, tmp_path: Path
) -> None:
    after, cubic = fits.models["linear"], fits.models["declared"]
    (wanted,) = dataset.holdout
    x = cubic.minimum.x.copy()
    # So soft where it is far deflected that it pushes the tip away.
    x[cubic.problem.names.index("beta")] = cubic.problem.bounds[0][cubic.problem.names.index("beta")]
    before = replace(cubic, minimum=replace(cubic.minimum, x=x))
    why = save_prediction(tmp_path / "prediction.csv", wanted, before, after)
    assert "step" in why
    table = pd.read_csv(tmp_path / "prediction.csv")
    assert table.filter(like="_before").isna().all(axis=None)
    np.testing.assert_allclose(table["tip_x_after_m"], predict(after, wanted)[0][:, 0], rtol=1e-8, atol=1e-9)
    with pytest.raises(ComputationError, match="step"):
        save_prediction(tmp_path / "other.csv", wanted, after, before)
    assert not (tmp_path / "other.csv").exists()


# Another kind of system.


@pytest.fixture(scope="module")
def circuit(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Run the pipeline on a driven Duffing oscillator that is declared linear."""
    folder = tmp_path_factory.mktemp("circuit")
    (folder / "rig.toml").write_text("""
        name = "Duffing"
        kind = "oscillator"
        [columns]
        time = { name = "t", unit = "s" }
        input = { name = "u", unit = "V", interpolation = "spline" }
        output = { name = "y", unit = "V", noise = 0.002 }
        [model]
        effects = ["viscous_damping", "linear_stiffness"]
    """)
    rng = np.random.default_rng(0)
    t, phase, rate = 0.05 * np.arange(801), rng.uniform(0, 2 * np.pi, 9), np.linspace(0.8, 5, 9)

    def force(time):
        return np.sin(np.multiply.outer(time, rate) + phase).sum(axis=-1)

    def slope(time, z):
        return z[1], force(time) - 0.2 * z[1] - 9 * z[0] - 3 * z[0] ** 3

    path = solve_ivp(slope, (0, 40), (0, 0), t_eval=t, rtol=1e-9, atol=1e-9).y[0]
    noisy = path + 0.002 * rng.standard_normal(t.size)
    pd.DataFrame({"t": t, "u": force(t), "y": noisy}).to_csv(folder / "record.csv", index=False)
    data = load_dataset(folder / "rig.toml", [folder / "record.csv"])
    content = run(data, folder / "out", seed=1, progress=silent)
    return {"folder": folder / "out", **json.loads(json.dumps(plain(content)))}


@pytest.mark.slow
def test_an_oscillator_has_no_arms_pages(circuit: dict[str, Any]) -> None:
    assert {p.name for p in circuit["folder"].iterdir()} == FILES - {"laws.nc", "amplitude.nc"}
    assert circuit["elastica"] is None
    assert circuit["radius"] is None
    assert circuit["clean"] is None
    assert set(circuit["fits"]) == {"linear", "declared"}


@pytest.mark.slow
def test_an_oscillators_missing_spring_is_found_by_regression_and_by_the_loop(circuit: dict[str, Any]) -> None:
    assert circuit["loop"]["verdict"] == "explained"
    (effect,) = circuit["loop"]["effects"]
    assert effect["id"] == "cubic_stiffness"
    beta = effect["parameters"]["beta"]
    assert abs(beta["value"] - 3.0) < 4 * beta["sd"]
    assert "q^3" in circuit["discovery"]["equation"]["terms"]


@pytest.mark.slow
def test_an_oscillators_posterior_is_that_of_the_final_model(circuit: dict[str, Any]) -> None:
    assert circuit["posterior"]["subject"] == "after"
    rows = {row["name"]: row for row in circuit["posterior"]["rows"]}
    for name, value in {"g": 1.0, "xi": 0.2, "alpha": 9.0, "beta": 3.0}.items():
        assert abs(rows[name]["mean"] - value) < 4 * rows[name]["sd"]
