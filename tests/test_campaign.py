"""Campaigns: the same outcomes on any number of workers, none lost with another, resumed, collected; the command."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import synthetic_run
from campaign_work import CASES, drawn, troubled, where
from click.testing import CliRunner

from discovery.cli import campaign_cases, campaigns
from discovery.foundation.errors import ComputationError, InputError
from discovery.runs.campaign import campaign, collect, rows, unfinished, watched
from discovery.runs.spread import SCHEDULER, _is_safe, case_seed, spread

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
    monkeypatch.setattr("discovery.runs.spread._PATIENCE", 0.2)
    with pytest.raises(InputError, match=r"No Dask scheduler answers at '127\.0\.0\.1:1'"):
        list(spread(drawn, CASES))


@pytest.mark.slow
def test_a_cluster_whose_workers_are_gone_for_good_ends_the_campaign(monkeypatch):
    from distributed import LocalCluster

    monkeypatch.setattr("discovery.runs.spread._ABANDONED", 0.5)
    with LocalCluster(1, threads_per_worker=1, dashboard_address=":0") as local:
        threading.Timer(1.0, local.scale, [0]).start()
        with pytest.raises(ComputationError, match=r"no worker for .* What is done is kept: start workers"):
            list(spread(troubled, [("hangs", "slow")], scheduler=local.scheduler_address))


def test_workers_of_a_scheduler_are_used_and_its_dashboard_is_told(cluster, monkeypatch):
    monkeypatch.setenv(SCHEDULER, cluster)
    links = []
    found = {o.result["process"] for o in spread(where, CASES, workers=1, heard=links.append)}
    assert os.getpid() not in found
    (link,) = links
    assert re.fullmatch(r"http://127\.0\.0\.1:\d+/status", link)


def test_what_raises_dies_or_hangs_on_this_machine_takes_no_other_with_it():
    cases = [("raises", "raise"), ("dies", "die"), ("hangs", "slow"), ("odd", "odd"), ("unsent", lambda: 1), *CASES]
    outcomes = {o.name: o for o in spread(troubled, cases, workers=2, limit=1.5)}
    assert set(outcomes) == {name for name, _ in cases}
    assert values(outcomes[name] for name, _ in CASES) == values(spread(drawn, CASES, workers=1))
    assert outcomes["raises"].error == "ArithmeticError: no such luck"
    assert outcomes["dies"].error.startswith("WorkerDied")
    assert outcomes["hangs"].error == "TooLong: the case took longer than its limit of 1.5 s"
    assert "pickle" in outcomes["unsent"].error


@pytest.mark.skipif(not Path("/proc/net/tcp").exists(), reason="this system does not tell who listens")
def test_nothing_listens_on_any_port():
    code = """
import sys
import threading
from campaign_work import CASES, listening
from discovery.runs.spread import spread
if __name__ == "__main__":
    found = [o.result for o in spread(listening, CASES, workers=2)]
    assert 1 <= len({one["process"] for one in found}) <= 2
    print([one["ports"] for one in found])
"""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(Path(__file__).parent), *sys.path])}
    run = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    assert run.stdout.strip() == str([[]] * len(CASES))


@pytest.mark.parametrize("address", ["tcp://10.0.0.1:8786", "host:8786", "tcp://127.evil.org:1", "10.0.0.1"])
def test_a_scheduler_through_which_others_can_run_code_is_refused(address, monkeypatch):
    monkeypatch.setattr("discovery.runs.spread._PATIENCE", 0.2)
    with pytest.raises(InputError, match=r"neither encrypted nor authenticated.*tls://.*--insecure"):
        list(spread(drawn, CASES, scheduler=address))


@pytest.mark.parametrize("address", ["tls://10.0.0.1:8786", "tcp://127.0.0.1:1", "tcp://localhost:1", "tcp://[::1]:1"])
def test_what_nobody_else_can_use_needs_no_word(address):
    assert _is_safe(address)


def test_a_scheduler_may_be_accepted_all_the_same(monkeypatch):
    monkeypatch.setattr("discovery.runs.spread._PATIENCE", 0.2)
    monkeypatch.setattr("discovery.runs.spread._is_safe", lambda _: False)
    with pytest.raises(InputError, match="No Dask scheduler answers"):
        list(spread(drawn, CASES, scheduler="127.0.0.1:1", insecure=True))


@pytest.mark.parametrize("signalled", ["stream", "parent"])
def test_processes_end_with_what_started_them(signalled, tmp_path):
    code = f"""
import sys, time
from pathlib import Path
from campaign_work import sleeping
from discovery.runs.spread import spread
if __name__ == "__main__":
    stream = spread(sleeping, [("quick", 0), ("a", {str(tmp_path)!r}), ("b", {str(tmp_path)!r})], workers=2)
    next(stream)
    while len([*Path({str(tmp_path)!r}).glob("*")]) < 2:
        time.sleep(0.01)
    print("ready", flush=True)
    if {signalled == "parent"}:
        time.sleep(600)
    stream.close()
"""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(Path(__file__).parent), *sys.path])}
    with subprocess.Popen([sys.executable, "-c", code], env=environment, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == "ready\n"
        if signalled == "parent":
            process.kill()
    assert process.returncode == (-9 if signalled == "parent" else 0)
    workers, end = [int(path.name) for path in tmp_path.iterdir()], time.monotonic() + 10.0
    while any(map(alive, workers)) and time.monotonic() < end:
        time.sleep(0.05)
    assert not any(map(alive, workers))


def alive(process):
    try:
        return Path(f"/proc/{process}/stat").read_text().split()[2] != "Z"
    except OSError:
        return False


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

    monkeypatch.setattr("discovery.runs.campaign._ROWS", 5)
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


def test_what_is_watched_is_told_and_passed_on():
    told = []
    outcomes = list(watched(spread(troubled, [*CASES, ("bad", "raise")], workers=1), 13, "studies", told.append))
    assert len(outcomes) == 13
    assert [t.done for t in told] == list(range(1, 14))
    assert told[-1] == "studies: 13 of 13 done, 1 failed"
    assert told[-1].seconds_left == 0


def test_a_case_whose_origin_has_changed_is_done_again(tmp_path):
    cases, before = CASES[:3], {name: {"file": name, "version": "1"} for name, _ in CASES}
    assert len(list(campaign(drawn, cases, tmp_path, origins=before, workers=1))) == 3
    assert list(campaign(drawn, cases, tmp_path, origins=before, workers=1)) == []
    now = {**before, "case_1": {"file": "another", "version": "1"}}
    assert list(unfinished(cases, tmp_path, now)) == [("case_1", 1, "changed since: file")]
    assert [o.name for o in campaign(drawn, cases, tmp_path, origins=now, workers=1)] == ["case_1"]
    assert json.loads((tmp_path / "cases" / "case_1.json").read_text())["origin"] == now["case_1"]
    newer = {name: {**origin, "version": "2"} for name, origin in now.items()}
    assert [reason for *_, reason in unfinished(CASES[:4], tmp_path, newer)] == ["changed since: version"] * 3 + [""]


def test_an_outcome_of_unknown_origin_is_not_believed(tmp_path):
    list(campaign(drawn, CASES[:1], tmp_path, workers=1))
    assert list(unfinished(CASES[:1], tmp_path)) == []
    ((_, _, reason),) = unfinished(CASES[:1], tmp_path, {"case_0": {"version": "1"}})
    assert "not known" in reason


def test_a_table_holds_the_cases_that_are_asked_for(tmp_path):
    list(campaign(drawn, CASES, tmp_path, workers=1))
    table = pd.read_parquet(collect(tmp_path, ["case_7", "case_2"]))
    assert list(table["name"]) == ["case_2", "case_7"]
    with pytest.raises(InputError, match="no outcomes"):
        collect(tmp_path, ["another"])


def test_lists_become_tables_of_their_own_and_all_is_csv_too(tmp_path):
    def work(case, seed):
        return {"case": case, "whole": {"a": [case]}, "parts": [{"part": i, "size": 0.5 * i} for i in range(case)]}

    list(campaign(work, CASES[:4], tmp_path, workers=1))
    table = pd.read_csv(collect(tmp_path, apart=["parts"]).with_suffix(".csv"))
    assert list(table.columns) == ["name", "seconds", "error", "case", "whole"]
    assert json.loads(table["whole"][3]) == {"a": [3]}
    for parts in (pd.read_parquet(tmp_path / "parts.parquet"), pd.read_csv(tmp_path / "parts.csv")):
        assert list(parts.columns) == ["name", "part", "size"]
        assert [tuple(row) for row in parts.itertuples(index=False)] == [
            (f"case_{n}", i, 0.5 * i) for n in range(4) for i in range(n)
        ]
    # Of cases without any, nothing of the cases before is left.
    collect(tmp_path, ["case_0"], apart=["parts"])
    assert len(pd.read_parquet(tmp_path / "parts.parquet")) == len(pd.read_csv(tmp_path / "parts.csv")) == 0


def test_nothing_is_told_above_a_refusal(tmp_path, monkeypatch):
    monkeypatch.setattr("discovery.runs.spread._PATIENCE", 0.3)
    outcomes, told = campaign(drawn, CASES, tmp_path, scheduler="tcp://127.0.0.1:1"), []
    with pytest.raises(InputError, match="No Dask scheduler"):
        list(watched(outcomes, len(CASES), "cases", told.append))
    assert told == []


# --- the command

RIG = """
name = "pendulum"
kind = "pendulum"
[columns]
time = { name = "time", unit = "s" }
output = { name = "theta", unit = "rad", noise = 0.003 }
"""


def place(folder, *names, records=""):
    """Put rig files and recordings of few letters in a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in names:
        (folder / name).write_text(RIG + records if name.endswith(".toml") else name)


def found(where, out, **options):
    rigs, _ = campaign_cases.rig_files(where)
    return dict(campaign_cases.found_cases(rigs, where if where.is_dir() else where.parent, out, **options))


def names(paths):
    return [path.name for path in paths]


def invoke(*arguments):
    (command,) = campaigns.COMMANDS
    return CliRunner().invoke(command, [*map(str, arguments), "--workers", "1"])


def test_recordings_of_a_rig_without_records_lie_beside_it(tmp_path):
    place(tmp_path / "a", "rig.toml", "train_1.csv", "train_2.csv", "holdout.csv", "holdout_clean.csv", "notes.csv")
    place(tmp_path / "b" / "c", "rig.toml", "rig_closed.toml")
    cases = found(tmp_path, tmp_path / "out", seed=5)
    assert set(cases) == {"a", "b_c", "b_c_rig_closed"}
    case = cases["a"]
    assert (case.rig, case.out, case.seed) == (tmp_path / "a" / "rig.toml", tmp_path / "out" / "a", 5)
    assert (names(case.train), names(case.holdout)) == (["train_1.csv", "train_2.csv"], ["holdout.csv"])
    assert not case.own
    assert cases["b_c"].train == cases["b_c"].holdout == ()
    each = found(tmp_path / "a" / "rig.toml", tmp_path, each=True)
    assert {name: names(case.train) for name, case in each.items()} == {
        "rig_train_1": ["train_1.csv"],
        "rig_train_2": ["train_2.csv"],
    }


RECORDS = """
[records]
train = [{ file = "big.csv", samples = [100, 300] }, { file = "small.csv" }, { file = "big.csv", samples = [0, 100] }]
holdout = [{ file = "mid.csv" }]
"""


def test_records_of_a_rig_win_over_files_beside_it_and_are_split_too(tmp_path):
    place(tmp_path, "rig.toml", "big.csv", "small.csv", "mid.csv", "train_old.csv", "holdout_old.csv", records=RECORDS)
    (case,) = found(tmp_path, tmp_path).values()
    assert case.own
    assert names(case.train) == ["big.csv", "small.csv", "big.csv"]
    assert names(case.holdout) == ["mid.csv"]
    each = found(tmp_path, tmp_path, each=True)
    assert {name: (names(c.train), c.only, names(c.holdout)) for name, c in each.items()} == {
        "rig_big": (["big.csv"], 0, ["mid.csv"]),
        "rig_small": (["small.csv"], 1, ["mid.csv"]),
        "rig_big_2": (["big.csv"], 2, ["mid.csv"]),
    }


def test_every_toml_that_describes_a_rig_is_one(tmp_path):
    place(tmp_path, "pendulum.toml", "rig.toml")
    place(tmp_path / "cases", "rig.toml")
    (tmp_path / "known.toml").write_text('[rig]\nunit = "rad"\n')
    (tmp_path / "project.toml").write_text('name = "something"\n')
    (tmp_path / "broken.toml").write_text("name = ")
    (tmp_path / "rig_broken.toml").write_text("name = ")
    place(tmp_path / ".hidden", "rig.toml")
    place(tmp_path / "pendulum", "rig.toml")
    rigs, skipped = campaign_cases.rig_files(tmp_path)
    assert names(skipped) == ["broken.toml", "known.toml", "project.toml"]
    # Names of cases are unique, and none is that of the folder of the outcomes.
    assert set(dict(campaign_cases.found_cases(rigs, tmp_path, tmp_path))) == {
        "cases_2",
        "pendulum",
        "pendulum_2",
        "rig",
        "rig_broken",
    }


def test_datasets_are_rigs_but_what_is_known_of_them_is_not():
    rigs, skipped = campaign_cases.rig_files(DATASETS)
    assert all(path.name.startswith("rig") for path in rigs)
    assert {path.name for path in skipped} == {"known.toml", "measured.toml"}


def test_a_folder_without_rigs_and_a_file_that_is_none_are_refused(tmp_path):
    (tmp_path / "known.toml").write_text('[rig]\nunit = "rad"\n')
    with pytest.raises(InputError, match=r"no rig file below .*skipped, no rig files: .*known\.toml"):
        campaign_cases.rig_files(tmp_path)
    for name in ("known.toml", "nothing.toml"):
        with pytest.raises(InputError, match=name):
            campaign_cases.rig_files(tmp_path / name)
    with pytest.raises(InputError, match=r"absent does not exist\. Give a folder with rig files in it, or a rig file"):
        campaign_cases.rig_files(tmp_path / "absent")


def counted(monkeypatch):
    """Replace the loop by one that notes which cases it was run for."""
    ran = []

    def close(case, _seed):
        ran.append(case.out.name)
        if case.out.name == "bad":
            raise InputError("there is nothing to fit")
        value = {"parameter": "xi", "value": 0.5, "sd": 0.1}
        return {"verdict": "explained", "effects": "sensor_delay", "because": "0 of 1", "parameters": [value]}

    monkeypatch.setattr(campaigns, "close", close)
    return ran


def test_the_command_runs_every_case_and_tells_what_failed(tmp_path, monkeypatch):
    counted(monkeypatch)
    for name in ("good", "bad"):
        place(tmp_path / "rigs" / name, "rig.toml")
    out = tmp_path / "out"
    result = invoke(tmp_path / "rigs", "--out", out, "--quiet")
    assert isinstance(result.exception, ComputationError)
    assert "1 of 2 cases failed" in str(result.exception)
    assert result.output.splitlines() == [
        "bad: InputError: there is nothing to fit",
        "good: explained: sensor_delay",
        str(out / "results.parquet"),
        str(out / "campaign.html"),
    ]
    table = pd.read_parquet(out / "results.parquet").set_index("name")
    assert table.loc["good", "verdict"] == "explained"
    assert pd.read_csv(out / "results.csv", index_col="name").loc["bad", "error"].startswith("InputError")
    assert "is done again: it failed before" in invoke(tmp_path / "rigs", "--out", out).stderr


def test_a_finished_campaign_says_so_and_what_changed_is_done_again(tmp_path, monkeypatch):
    ran = counted(monkeypatch)
    rigs, out = tmp_path / "rigs", tmp_path / "out"
    for name in "abc":
        place(rigs / name, "rig.toml", "train_1.csv", "holdout_1.csv")
    assert "cases: 3 of 3 done" in invoke(rigs, "--out", out).stderr
    assert ran == ["a", "b", "c"]
    again = invoke(rigs, "--out", out)
    assert "3 of 3 cases were done before" in again.stderr
    assert "━" not in again.stderr
    assert again.stdout == f"{out / 'results.parquet'}\n{out / 'campaign.html'}\n"
    changes = {
        "rig file": lambda: (rigs / "a" / "rig.toml").write_text(RIG + "# another\n"),
        "training recordings": lambda: (rigs / "a" / "train_1.csv").write_text("another"),
        "hold outs": lambda: (rigs / "a" / "holdout_2.csv").write_text("another"),
    }
    for what, change in changes.items():
        ran.clear()
        change()
        result = invoke(rigs, "--out", out)
        assert ran == ["a"]
        assert f"a is done again: changed since: {what}" in result.stderr
        assert "2 of 3 cases were done before" in result.stderr
        assert "cases: 1 of 1 done" in result.stderr
    ran.clear()
    monkeypatch.setattr("importlib.metadata.version", lambda _: "99")
    assert "b is done again: changed since: version" in invoke(rigs, "--out", out).stderr
    assert ran == ["a", "b", "c"]


def test_tables_hold_the_cases_of_this_call_only(tmp_path, monkeypatch):
    counted(monkeypatch)
    rigs, out = tmp_path / "rigs", tmp_path / "out"
    for name in "abc":
        place(rigs / name, "rig.toml", "train_1.csv", "train_2.csv")
    invoke(rigs, "--out", out, "--quiet")
    invoke(rigs, "--out", out, "--quiet", "--each")
    for table in ("results", "parameters"):
        assert list(pd.read_parquet(out / f"{table}.parquet")["name"]) == [
            f"{n}_train_{i}" for n in "abc" for i in (1, 2)
        ]
    invoke(rigs / "a" / "rig.toml", "--out", out, "--quiet")
    assert list(pd.read_csv(out / "parameters.csv")["name"]) == ["rig"]


def test_the_command_says_what_it_found_and_which_recordings_it_uses(tmp_path, monkeypatch):
    counted(monkeypatch)
    place(tmp_path / "a", "rig.toml", "big.csv", "small.csv", "mid.csv", "train_old.csv", records=RECORDS)
    place(tmp_path / "b", "rig.toml", "train.csv")
    for i in range(7):
        (tmp_path / f"known_{i}.toml").write_text("")
    said = invoke(tmp_path, "--out", tmp_path / "out").stderr
    assert f"2 rigs found at {tmp_path}, 2 cases; skipped, no rig files: {tmp_path / 'known_0.toml'}" in said
    assert "and 2 more" in said
    assert "recordings of 1 rig: the rig file's own [records]" in said
    assert "recordings of 1 rig: train*.csv and holdout*.csv beside the rig file" in said
    assert f"{tmp_path / 'a' / 'rig.toml'}: not in its [records], not used: train_old.csv" in said


def test_no_bar_stands_above_a_usage_error(tmp_path, monkeypatch):
    counted(monkeypatch)
    place(tmp_path / "rigs", "rig.toml", "train.csv")
    out = tmp_path / "out"
    invoke(tmp_path / "rigs", "--out", out)
    result = invoke(tmp_path / "rigs", "--out", out, "--seed", "2")
    assert isinstance(result.exception, InputError)
    assert result.stderr == ""
    assert "--limit" in invoke(tmp_path / "rigs", "--out", out, "--limit", "0").stderr


def test_the_help_tells_what_a_user_must_know():
    from discovery.cli import cli

    listed = CliRunner().invoke(cli, ["--help"]).output
    assert "Run the loop on every rig file below a folder." in listed
    told = " ".join(CliRunner().invoke(cli, ["campaign", "--help"]).output.split())
    for what in (
        "rig*.toml",
        "[records]",
        "train*.csv",
        "results",
        "parameters",
        "interruption",
        SCHEDULER,
        "same paths",
    ):
        assert what in told


@pytest.fixture
def looped(monkeypatch):
    """What the loop was called with, the loop itself left out."""
    from discovery.runs import loop_files, stages

    seen = {}
    content = {
        "verdict": "explained",
        "model_error": synthetic_run.model_error(1e-3, 1e-5, "m"),
        "effects": [{"id": "quadratic_drag", "parameters": {"c_2": {}}}],
        "errors": {
            "unit": "m",
            "noise_floor": 4e-4,
            **{w: {r: {"rms": 1e-3} for r in ("train", "holdout")} for w in ("before", "after")},
        },
        "model": {
            "after": {
                "parameters": {
                    "xi": {"value": 0.2, "sd": None, "unit": "s^-1", "reason": "at its bound"},
                    "c_2": {"value": 0.1, "sd": 0.01, "unit": "m^-1"},
                }
            }
        },
    }
    monkeypatch.setattr(stages, "loop", lambda dataset, **options: seen.update(dataset=dataset, **options))
    monkeypatch.setattr(stages, "unexplained", lambda *_, **__: None)
    monkeypatch.setattr(loop_files, "write_loop", lambda out, result, **_: content)
    return seen


def test_one_case_returns_verdict_errors_and_parameters(tmp_path, looped):
    arm = DATASETS / "arm"
    case = campaign_cases.Case(
        arm / "rig.toml", (arm / "train_paper.csv",), (arm / "holdout_inside.csv",), False, None, tmp_path, 7
    )
    (tmp_path / "loop.json").write_text("of before")
    result = campaigns.close(case, case_seed(0, "arm"))
    assert not (tmp_path / "loop.json").exists()
    assert result["verdict"] == "explained"
    assert (result["noise_floor"], result["kind"], result["coordinate_unit"]) == (4e-4, "flexible_arm", "rad")
    assert result["because"] == ("the model error falls from 1.00 to 0.0100 mm, which counts as none (up to 0.0450 mm)")
    assert [result[f"{r}_rms_{w}"] for r in ("train", "holdout") for w in ("before", "after")] == [1e-3] * 4
    assert result["parameters"] == [
        {"parameter": "xi", "effect": "", "value": 0.2, "sd": None, "unit": "s^-1", "reason": "at its bound"},
        {"parameter": "c_2", "effect": "quadratic_drag", "value": 0.1, "sd": 0.01, "unit": "m^-1", "reason": ""},
    ]
    assert looped["seed"] == 7
    assert [e.recording.name for e in looped["dataset"].holdout] == ["holdout_inside"]


def test_one_of_the_records_is_fitted_alone(tmp_path, looped):
    time = np.arange(300) / 50
    place(tmp_path, "rig.toml", records=RECORDS)
    for i, name in enumerate(("big", "small", "mid")):
        pd.DataFrame({"time": time, "theta": (i + 1) * np.cos(3 * time)}).to_csv(tmp_path / f"{name}.csv", index=False)
    cases = found(tmp_path, tmp_path / "out", each=True)
    fitted = []
    for name, case in cases.items():
        campaigns.close(case, case_seed(0, name))
        fitted.append([(e.recording.time.size, e.recording.output[0, 0]) for e in looped["dataset"].train])
        assert [e.recording.name for e in looped["dataset"].holdout] == ["mid"]
    assert fitted == [[(200, np.cos(6.0))], [(300, 2.0)], [(100, 1.0)]]


def test_a_rig_without_recordings_says_what_it_needs(tmp_path):
    place(tmp_path, "rig.toml")
    ((name, case),) = found(tmp_path, tmp_path / "out").items()
    with pytest.raises(InputError, match=r"nothing to fit.*\[records\].*train\*\.csv"):
        campaigns.close(case, case_seed(0, name))
