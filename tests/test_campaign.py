"""Campaigns: the same outcomes on any number of workers, none lost with another, resumed, collected; the command."""

from __future__ import annotations

import json
import os
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner

from discovery.campaign import campaign, collect, rows, watched
from discovery.cli import campaigns
from discovery.errors import ComputationError, InputError
from discovery.spread import SCHEDULER, case_seed, spread

DATASETS = Path(__file__).parents[1] / "datasets"


@pytest.fixture(autouse=True)
def _no_scheduler(monkeypatch):
    monkeypatch.delenv(SCHEDULER, raising=False)


@pytest.fixture(scope="module")
def cluster():
    """The address of a scheduler with two workers, which does not try again what takes a worker down."""
    import dask
    from distributed import LocalCluster

    with (
        dask.config.set({"distributed.scheduler.allowed-failures": 0}),
        LocalCluster(2, threads_per_worker=1, dashboard_address=":0") as local,
    ):
        yield local.scheduler_address


def drawn(case, seed):
    return {"case": case, "value": np.random.default_rng(seed).standard_normal()}


def troubled(case, seed):
    """Raise, die, hang or return what no file can hold, as the case says."""
    if case == "raise":
        raise ArithmeticError("no such luck")
    if case == "die":
        os._exit(3)
    if case == "slow":
        for _ in range(3000):
            time.sleep(0.01)
    if case == "odd":
        return {"value": {1, 2}}
    return drawn(case, seed)


CASES = [(f"case_{i}", i) for i in range(12)]


def values(outcomes):
    return {o.name: o.result["value"] for o in outcomes}


def test_outcomes_do_not_depend_on_workers_order_or_company(cluster):
    alone = values(spread(drawn, CASES, seed=3, workers=1))
    assert values(spread(drawn, CASES[::-1], seed=3, scheduler=cluster)) == alone
    assert values(spread(drawn, CASES[4:6], seed=3, workers=1)) == {k: alone[k] for k in ("case_4", "case_5")}
    assert not set(values(spread(drawn, CASES, seed=4, workers=1)).values()) & set(alone.values())
    assert len(set(alone.values())) == len(CASES)


def test_seeds_of_cases_are_independent_streams():
    draws = np.array([np.random.default_rng(case_seed(0, str(i))).standard_normal(400) for i in range(30)])
    correlation = np.corrcoef(draws)[np.triu_indices(30, 1)]
    assert np.abs(correlation).max() < 5 / np.sqrt(400)


def test_what_raises_dies_or_hangs_takes_no_other_with_it(cluster):
    cases = [("raises", "raise"), ("dies", "die"), ("hangs", "slow"), ("odd", "odd"), *CASES]
    outcomes = {o.name: o for o in spread(troubled, cases, scheduler=cluster, limit=1.5)}
    assert set(outcomes) == {name for name, _ in cases}
    assert values(outcomes[name] for name, _ in CASES) == values(spread(drawn, CASES, workers=1))
    assert outcomes["raises"].error == "ArithmeticError: no such luck"
    assert "in troubled" in outcomes["raises"].trace
    assert outcomes["dies"].error.startswith("WorkerDied")
    assert outcomes["hangs"].error == "TooLong: the case took longer than its limit of 1.5 s"
    assert 1.5 <= outcomes["hangs"].seconds < 10
    assert outcomes["odd"].error.startswith("TypeError")
    assert all(outcomes[name].result is None for name, _ in cases[:4])


def test_this_process_keeps_limits_and_errors_too():
    first, second, third = spread(troubled, [("a", "slow"), ("b", "raise"), ("c", 1)], workers=1, limit=0.1)
    assert first.error.startswith("TooLong")
    assert second.error.startswith("ArithmeticError")
    assert third.result["case"] == 1


def test_cases_are_taken_as_workers_become_free():
    taken = []

    def endless():
        for i in range(10**9):
            taken.append(i)
            yield f"case_{i}", i

    stream = spread(drawn, endless(), workers=2)
    for _ in range(5):
        next(stream)
    stream.close()
    assert len(taken) <= 5 + 2


def test_no_scheduler_at_an_address_is_told(monkeypatch):
    monkeypatch.setenv(SCHEDULER, "127.0.0.1:1")
    monkeypatch.setattr("discovery.spread._PATIENCE", 0.2)
    with pytest.raises(InputError, match=r"No Dask scheduler answers at '127\.0\.0\.1:1'"):
        list(spread(drawn, CASES))


def where(case, _seed):
    return {"process": os.getpid()}


def test_workers_of_a_scheduler_are_used(cluster, monkeypatch):
    monkeypatch.setenv(SCHEDULER, cluster)
    found = {o.result["process"] for o in spread(where, CASES, workers=1)}
    assert os.getpid() not in found


def test_no_workers_are_refused():
    with pytest.raises(InputError, match="0 workers"):
        next(spread(drawn, CASES, workers=0))


# --- on disk


def interrupted(case, seed):
    if case == 7:
        raise KeyboardInterrupt
    return drawn(case, seed)


def test_an_interrupted_campaign_goes_on_where_it_was(tmp_path):
    with pytest.raises(KeyboardInterrupt):
        list(campaign(interrupted, CASES, tmp_path, seed=3, workers=1))
    assert len(list((tmp_path / "cases").iterdir())) == 7
    rest = list(campaign(drawn, CASES, tmp_path, seed=3, workers=1))
    assert [o.name for o in rest] == [name for name, _ in CASES[7:]]
    whole = {row["name"]: row["value"] for row in rows(tmp_path)}
    assert whole == values(spread(drawn, CASES, seed=3, workers=1))
    assert list(campaign(drawn, CASES, tmp_path, seed=3, workers=1)) == []


def test_a_failed_case_is_kept_with_its_error_and_tried_again(tmp_path):
    cases = [("good", 1), ("bad", "raise")]
    list(campaign(troubled, cases, tmp_path, workers=1))
    kept = json.loads((tmp_path / "cases" / "bad.json").read_text())
    assert kept["error"] == "ArithmeticError: no such luck"
    assert "Traceback" in kept["trace"]
    (again,) = campaign(drawn, cases, tmp_path, workers=1)
    assert again.name == "bad"
    assert all(row["error"] == "" for row in rows(tmp_path))


def test_a_folder_of_another_seed_or_other_settings_is_refused(tmp_path):
    list(campaign(drawn, CASES[:1], tmp_path, settings={"noise": 0.1}, seed=3, workers=1))
    for seed, noise in ((4, 0.1), (3, 0.2)):
        with pytest.raises(InputError, match="another seed or other settings"):
            list(campaign(drawn, CASES, tmp_path, settings={"noise": noise}, seed=seed, workers=1))


def test_outcomes_are_collected_in_one_table(tmp_path, monkeypatch):
    def work(case, seed):
        return {"parameters": {"alpha": 8.0 + case}, "list": [case] * case} if case % 2 else {"alone": case}

    monkeypatch.setattr("discovery.campaign._ROWS", 5)
    list(campaign(work, CASES, tmp_path, workers=1))
    table = pd.read_parquet(collect(tmp_path))
    assert list(table["name"]) == sorted(name for name, _ in CASES)
    assert list(table.columns[:3]) == ["name", "seconds", "error"]
    row = table.set_index("name").loc["case_3"]
    assert row["parameters"] == {"alpha": 11.0}
    assert list(row["list"]) == [3, 3, 3]
    assert np.isnan(row["alone"])
    assert table["alone"].notna().sum() == 6


def test_a_folder_without_outcomes_is_refused(tmp_path):
    with pytest.raises(InputError, match="no outcomes"):
        collect(tmp_path)


def test_what_is_watched_is_shown_and_passed_on(capsys):
    outcomes = list(watched(spread(troubled, [*CASES, ("bad", "raise")], workers=1), 13, "studies"))
    assert len(outcomes) == 13
    shown = capsys.readouterr().err
    assert "studies" in shown
    assert "13/13" in shown
    assert "1 failed" in shown


# --- the command


def place(folder, *names):
    """Put a rig file and empty recordings in a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in names:
        (folder / name).write_text("")


def test_cases_are_rig_files_with_the_recordings_beside_them(tmp_path):
    place(tmp_path / "a", "rig.toml", "train_1.csv", "train_2.csv", "holdout.csv", "holdout_clean.csv", "notes.csv")
    place(tmp_path / "b" / "c", "rig.toml", "rig_closed.toml")
    found = dict(campaigns.found_cases(tmp_path, tmp_path / "out", seed=5))
    assert set(found) == {"a", "b_c", "b_c_rig_closed"}
    rig, train, holdout, out, seed = found["a"]
    assert (rig, out, seed) == (tmp_path / "a" / "rig.toml", tmp_path / "out" / "a", 5)
    assert [p.name for p in train] == ["train_1.csv", "train_2.csv"]
    assert [p.name for p in holdout] == ["holdout.csv"]
    assert found["b_c"][1:3] == ((), ())
    each = dict(campaigns.found_cases(tmp_path / "a" / "rig.toml", tmp_path, each=True))
    assert {name: [p.name for p in case[1]] for name, case in each.items()} == {
        "rig_train_1": ["train_1.csv"],
        "rig_train_2": ["train_2.csv"],
    }
    with pytest.raises(InputError, match="no rig file"):
        campaigns.found_cases(tmp_path / "nothing", tmp_path)


def test_the_command_runs_every_case_and_tells_what_failed(tmp_path, monkeypatch):
    for name in ("good", "bad"):
        place(tmp_path / "rigs" / name, "rig.toml")

    def close(case, _seed):
        if case[3].name == "bad":
            raise InputError("there is nothing to fit")
        return {"verdict": "explained", "effects": "sensor_delay"}

    monkeypatch.setattr(campaigns, "close", close)
    (command,) = campaigns.COMMANDS
    out = tmp_path / "out"
    arguments = [str(tmp_path / "rigs"), "--out", str(out), "--workers", "1", "--quiet"]
    result = CliRunner().invoke(command, arguments)
    assert isinstance(result.exception, ComputationError)
    assert "1 of 2 cases failed" in str(result.exception)
    assert "good: explained: sensor_delay" in result.output
    assert "bad: InputError: there is nothing to fit" in result.output
    table = pd.read_parquet(out / "results.parquet").set_index("name")
    assert table.loc["good", "verdict"] == "explained"


def test_one_case_writes_its_loop(tmp_path, monkeypatch):
    from discovery import pipeline, stages

    seen = {}
    content = {
        "verdict": "nothing_missing",
        "effects": [],
        "errors": {"unit": "m", **{w: {r: {"rms": 1e-3} for r in ("train", "holdout")} for w in ("before", "after")}},
    }
    monkeypatch.setattr(stages, "loop", lambda dataset, **options: seen.update(dataset=dataset, **options))
    monkeypatch.setattr(stages, "unexplained", lambda *_, **__: None)
    monkeypatch.setattr(pipeline, "write_loop", lambda out, result, **_: content)
    arm = DATASETS / "arm"
    case = (arm / "rig.toml", (arm / "train_paper.csv",), (arm / "holdout_inside.csv",), tmp_path, 7)
    found = campaigns.close(case, case_seed(0, "arm"))
    assert found["verdict"] == "nothing_missing"
    assert found["holdout_rms_after"] == 1e-3
    assert seen["seed"] == 7
    assert [e.recording.name for e in seen["dataset"].holdout] == ["holdout_inside"]
