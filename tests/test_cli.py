"""The command line is a contract: exit statuses, files and their columns, one clear message on bad input."""

from __future__ import annotations

import io
import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any, get_args

import numpy as np
import pandas as pd
import pytest
import synthetic_run
import xarray as xr
from discovery_datasets import instrument, recordings, registry
from discovery_datasets.disturbances import DISTURBANCES

from discovery.cli import cli, main
from discovery.cli.options import KINDS as NAMED_KINDS
from discovery.cli.options import Seconds, progress
from discovery.cli.prediction import check_state, read_wanted
from discovery.cli.say import doubts, say_loop
from discovery.cli.sources import MANOEUVRES
from discovery.cli.stages import NOISES
from discovery.declarations.registry import catalogue
from discovery.declarations.system import System
from discovery.diagnosis.caution import missed
from discovery.estimation.holdout import SEPARATE
from discovery.foundation.errors import ComputationError, InputError
from discovery.mechanics.upgrades import UPGRADES
from discovery.posterior.noise import GAUSSIAN, NOISE_MODELS, words_of
from discovery.recordings.dataset import load_dataset
from discovery.recordings.flags import Flag
from discovery.recordings.reading_flags import bend_flags
from discovery.report import build_report
from discovery.results.provenance import surroundings
from discovery.rigs.rig_schema import RigTable
from discovery.runs import stages
from discovery.runs.loop_result import LoopResult
from discovery.selection.decision import Decision
from discovery.simulation.kernel import compile as compiled

ARM = Path(__file__).parents[1] / "datasets" / "arm"
ROWS = 801  # 8 s
BEFORE_AFTER = ["tip_x_before_m", "tip_y_before_m", "tip_x_after_m", "tip_y_after_m"]
SPREADS = ["tip_x_before_sd_m", "tip_y_before_sd_m", "tip_x_after_sd_m", "tip_y_after_sd_m"]


@dataclass(frozen=True)
class Said:
    """What a command left behind."""

    status: int
    out: str
    err: str


def call(capsys: pytest.CaptureFixture[str], *arguments: object) -> Said:
    """Run a command in this process."""
    capsys.readouterr()
    status = 0
    try:
        main([str(a) for a in arguments])
    except SystemExit as leaving:
        status = int(leaving.code or 0)
    said = capsys.readouterr()
    return Said(status, said.out, said.err)


def shell(*arguments: object) -> Said:
    """Run a command in a process of its own, warnings being errors."""
    run = subprocess.run(
        [sys.executable, "-W", "error", "-m", "discovery", *map(str, arguments)], capture_output=True, text=True
    )
    return Said(run.returncode, run.stdout, run.stderr)


def cut(name: str, rows: int = ROWS) -> pd.DataFrame:
    return pd.read_csv(ARM / f"{name}.csv", nrows=rows)


@dataclass(frozen=True)
class Case:
    """A short recording with a hold-out and a file to predict."""

    rig: Path
    train: Path
    holdout: Path
    drive: Path


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> Case:
    folder = tmp_path_factory.mktemp("case")
    rig = folder / "rig.toml"
    rig.write_text((ARM / "rig.toml").read_text())
    cut("train_large").to_csv(folder / "train.csv", index=False)
    holdout = cut("holdout_inside")
    holdout.to_csv(folder / "holdout.csv", index=False)
    holdout[["time_s", "motor_angle_rad"]][::2].to_csv(folder / "drive.csv", index=False)
    return Case(rig, folder / "train.csv", folder / "holdout.csv", folder / "drive.csv")


def heard(*arguments: object) -> Said:
    """Run a command in this process, for fixtures that several tests share; the pictures of its page are empty."""
    out, err, status = io.StringIO(), io.StringIO(), 0
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(out), redirect_stderr(err):
        patch.setattr("discovery.report.page.render", lambda picture: (".svg", b"<svg/>"))
        try:
            main([str(a) for a in arguments])
        except SystemExit as leaving:
            status = int(leaving.code or 0)
    return Said(status, out.getvalue(), err.getvalue())


@pytest.fixture(scope="module")
def found(case: Case) -> LoopResult:
    """Return what the loop finds in the case; the commands below say and write it, and do not find it again."""
    return stages.loop(load_dataset(case.rig, [case.train], [case.holdout]))


@pytest.fixture(scope="module")
def looped(case: Case, found: LoopResult, tmp_path_factory: pytest.TempPathFactory) -> tuple[Said, Path]:
    out = tmp_path_factory.mktemp("looped") / "new" / "run"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(stages, "loop", lambda *_, **__: found)
        said = heard("loop", case.rig, "--train", case.train, "--holdout", case.holdout, "--predict", case.drive,
                     "--out", out, "--quiet")  # fmt: skip
    return said, out


@pytest.fixture
def as_found(found: LoopResult, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the loop find in the case what it has found there."""
    monkeypatch.setattr(stages, "loop", lambda *_, **__: found)


def test_loop_says_what_it_found_and_quiet_is_quiet(looped: tuple[Said, Path]) -> None:
    said, out = looped
    assert said.status == 0, said.err
    assert said.err == ""
    assert re.match(r"verdict: (explained|partly_explained|nothing_missing|unexplained)\n", said.out)
    assert sorted(p.name for p in out.iterdir()) == ["loop.json", "page", "prediction.csv", "report.html"]


def found_loop(verdict: str, *effects: dict[str, Any], **more: Any) -> SimpleNamespace:
    """Return a loop's result of which only what is said is there."""
    errors = {"unit": "m", "holdout_kind": "separate recordings", "before": {"holdout": {"rms": 2.0, "mean": 1.5}},
              "after": {"holdout": {"rms": 1.0, "mean": 0.5}}}  # fmt: skip
    error = synthetic_run.model_error(6.5e-4, 5.03e-5, "m", "deflection")
    content = {"verdict": verdict, "effects": [*effects], "errors": errors, "model_error": error, **more}
    return SimpleNamespace(summary=lambda: content, contradiction=None, separations=())


def test_what_is_named_beside_a_model_error_is_said_with_its_odds(capsys: pytest.CaptureFixture[str]) -> None:
    drag = {"id": "quadratic_drag", "parameters": {"c_2": {"value": 0.1, "sd": 0.01, "unit": "m^-1"}},
            "evidence": synthetic_run.odds(6.0, 2.0, 3.0), "probability": 0.6, "group_probability": 0.9973,
            "ambiguous_with": ["coulomb_friction"]}  # fmt: skip
    geometry = {"id": "elastica_geometry", "parameters": {}, "evidence": {}, "probability": None,
                "group_probability": None, "ambiguous_with": []}  # fmt: skip
    say_loop(found_loop("partly_explained", geometry, drag))
    assert capsys.readouterr().out == (
        "verdict: partly_explained\n"
        "mechanics: elastica_geometry\n"
        "added: quadratic_drag (c_2 = 0.100 +- 0.010 m^-1); as well explained by coulomb_friction; odds of 400 to 1, "
        "probability 0.60, of the group 0.997\n"
        "model error: 0.650 -> 0.0503 mm, 7.7 % is left; it depends on deflection; up to 0.0450 mm counts as none\n"
        "before: holdout rms 2 (mean 1.5) m\n"
        " after: holdout rms 1 (mean 0.5) m\n"
    )


def test_an_effect_that_is_small_beside_the_model_error_is_said_so(capsys: pytest.CaptureFixture[str]) -> None:
    drag = {"id": "quadratic_drag", "parameters": {"c_2": {"value": 0.1, "sd": 0.01, "unit": "m^-1"}},
            "probability": 0.95, "group_probability": 0.95, "ambiguous_with": []}  # fmt: skip
    small = "it moves the prediction by 1.7 times the model error that is left: another law may do the same\n"
    for size, said in ((1.7, True), (4.0, False)):
        say_loop(found_loop("partly_explained", {**drag, "evidence": synthetic_run.odds(60.0, 20.0, size)}))
        assert (small in capsys.readouterr().out) is said


def test_a_bias_is_told_as_the_zero_of_the_sensor_whatever_its_unit(capsys: pytest.CaptureFixture[str]) -> None:
    bias = {"id": "angle_offset", "parameters": {"theta_0": {"value": 0.1, "sd": 0.01, "unit": "m s^-2"}},
            "evidence": {}, "probability": None, "group_probability": None, "ambiguous_with": []}  # fmt: skip
    say_loop(found_loop("explained", bias))
    said = "added: angle_offset, the zero offset of the sensor (theta_0 = 0.100 +- 0.010 m s^-2)\n"
    assert said in capsys.readouterr().out


def test_what_differs_between_recordings_is_told_of_each(capsys: pytest.CaptureFixture[str]) -> None:
    rows = {n: {"value": v, "sd": 0.01, "unit": "N"} for n, v in (("f_1", 0.1), ("f_r_0_init[up]", 0.2))}
    grade = {"id": "recording_force", "parameters": rows, "evidence": {}, "probability": None,
             "group_probability": None, "ambiguous_with": []}  # fmt: skip
    say_loop(found_loop("explained", grade))
    said = (
        "(f_1 = 0.100 +- 0.010 N, f_r of up = 0.200 +- 0.010 N; a held-out recording has its own, fitted to it, "
        "and any other is predicted with that of the first, within what they differ by)"
    )
    assert said in capsys.readouterr().out


def test_what_is_not_explained_is_said_with_the_strongest_lead(capsys: pytest.CaptureFixture[str]) -> None:
    lead = {"effects": ["table_tilt", "wind"], "code": "size", "numbers": synthetic_run.odds(94.0, 10.0, 0.5)}
    say_loop(found_loop("unexplained", lead=lead))
    said = capsys.readouterr().out
    assert (
        "\nlead: the strongest lead is table tilt and wind, with odds of 1.3 to 1; it is not named: the prediction "
        "moves by 0.5 times the model error that is left, which may look the same\nbefore: "
    ) in said
    assert "added: " not in said
    force = {"effects": ["smooth_force"], "code": "unknown", "numbers": synthetic_run.odds(300.0, 90.0, 0.5)}
    say_loop(found_loop("unexplained", lead={**force, "law": lead}))
    assert (
        "it gains 300 nats in training and 90.0 held out; the strongest law is table tilt and wind, with odds of 1.3 "
        "to 1: the prediction moves by 0.5 times the model error that is left, which may look the same\n"
    ) in capsys.readouterr().out


def test_a_prediction_of_another_model_does_not_stay_beside_a_new_loop(filmed: tuple[Said, Path]) -> None:
    said, out = filmed
    assert said.status == 0, said.err
    assert sorted(p.name for p in out.iterdir()) == ["loop.json", "page", "report.html"]
    assert (out / "report.html").read_text(encoding="utf-8").startswith("<!DOCTYPE html>")


def test_progress_is_told_unless_quietly(filmed: tuple[Said, Path], looped: tuple[Said, Path]) -> None:
    assert "refitting the declared model" in filmed[0].err
    assert looped[0].err == ""


def test_what_stands_where_the_page_is_kept_is_refused_and_stays(
    case: Case, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "page").mkdir()
    (tmp_path / "page" / "mine.txt").write_text("mine", encoding="utf-8")
    said = call(capsys, "loop", case.rig, "--train", case.train, "--out", tmp_path)
    assert said.status == 2
    assert "holds something else. Move it away" in said.err
    assert [p.name for p in (tmp_path / "page").iterdir()] == ["mine.txt"]


def test_errors_are_said_once(looped: tuple[Said, Path], capsys: pytest.CaptureFixture[str]) -> None:
    said = r"^ after: train rms \S+ \(mean \S+\), holdout rms \S+ \(mean \S+\) m$"
    assert re.search(said, looped[0].out, re.MULTILINE)
    errors: dict[str, Any] = {"unit": "m", "before": {}, "after": {}}
    errors |= {"holdout_kind": "last third", "holdout_motion": 12.3}
    for i, group in enumerate(("train", "holdout", "holdout_inside", "holdout_outside"), 1):
        errors["before"][group] = errors["after"][group] = {"rms": float(i), "mean": 0.1, "peak": 9.0}
    say_loop(found_loop("nothing_missing", errors=errors))
    out = capsys.readouterr().out
    assert " after: train rms 1 (mean 0.1), holdout rms 2 (mean 0.1), holdout_inside rms 3 (mean 0.1), " in out
    assert "holdout: the last third; its motion is 12 times the noise; --holdout names a recording of its own\n" in out
    assert "holdout: " not in looped[0].out


def test_it_is_said_when_a_kernel_is_compiled_but_not_quietly(capsys: pytest.CaptureFixture[str]) -> None:
    for quiet in (False, True):
        with progress(quiet) as tell:
            tell("fitting")
            for began, ended in compiled._LISTENING:
                began()
                ended()
        told = capsys.readouterr().err
        assert told.startswith("fitting\ncompiling a simulator") != quiet
        assert bool(told) != quiet
    assert not compiled._LISTENING


def test_a_loop_says_which_files_it_wrote(looped: tuple[Said, Path]) -> None:
    said, out = looped
    assert said.out.splitlines()[-1] == (
        f"written: {out / 'loop.json'}, {out / 'report.html'}, {out / 'prediction.csv'}"
    )


def test_the_page_of_a_loop_says_what_it_found(looped: tuple[Said, Path]) -> None:
    _, out = looped
    page, found = ((out / name).read_text(encoding="utf-8") for name in ("report.html", "loop.json"))
    assert f'<p class="verdict {json.loads(found)["verdict"]}">' in page
    assert "This is the page of a closed loop" in page
    assert "A loop samples no posterior." in page
    assert 'id="figure-errors"' in page
    assert 'id="figure-time_holdout"' in page
    assert not re.search('<iframe|src="(?!data:)', page)


@pytest.mark.usefixtures("sketched")
def test_the_page_of_a_loop_is_written_again(looped: tuple[Said, Path], capsys: pytest.CaptureFixture[str]) -> None:
    _, out = looped
    page = out / "report.html"
    first = page.read_text(encoding="utf-8")
    page.write_text("lost", encoding="utf-8")
    said = call(capsys, "report", out)
    assert (said.status, said.out) == (0, f"{page}\n"), said.err
    assert page.read_text(encoding="utf-8") == first
    assert (out / "page" / "tables" / "errors.csv").is_file()
    verdict = json.loads((out / "loop.json").read_text(encoding="utf-8"))["verdict"]
    assert json.loads(call(capsys, "report", out, "--json").out) == {"verdict": verdict, "files": [str(page)]}


@pytest.mark.parametrize(
    ("said", "seconds"), [("90", 90.0), ("1.5", 1.5), ("20s", 20.0), ("5min", 300.0), ("5 m", 300.0), ("0.5h", 1800.0)]
)
def test_a_time_is_in_seconds_or_has_a_unit(said: str, seconds: float) -> None:
    assert Seconds().convert(said, None, None) == seconds


@pytest.mark.parametrize("said", ["", "soon", "-3", "5 days", "nan", "1e3"])
def test_what_is_no_time_is_refused(said: str, film: Film, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    refusal = call(capsys, "run", film.rig, "--train", film.train, "--max-time", said, "--out", tmp_path / "out")
    assert refusal.status == 2
    assert "is no time" in refusal.err
    assert not (tmp_path / "out").exists()


@pytest.mark.usefixtures("undrawn")
def test_a_run_without_time_gives_the_answer_and_says_what_is_left_out(
    film: Film, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    said = call(capsys, "run", film.rig, "--train", film.train, "--max-time", "0", "--out", tmp_path, "--quiet")
    assert said.status == 0, said.err
    assert said.out.startswith("verdict: ")
    *_, left_out, last = said.out.splitlines()
    assert left_out.startswith("left out for --max-time: the posterior and what it predicts; the noise models")
    assert last == str(tmp_path / "report.html")
    assert "The time limit left out the posterior" in (tmp_path / "report.html").read_text(encoding="utf-8")


@pytest.mark.slow
def test_a_run_that_is_killed_while_it_samples_has_said_and_written_its_answer(film: Film, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "discovery", "run", film.rig, "--train", film.train, "--out", tmp_path]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        assert process.stdout is not None
        for line in process.stderr:
            if line.startswith("sampling the posterior"):
                process.kill()
        said = process.stdout.read()
    assert process.returncode == -signal.SIGKILL
    assert said.startswith("verdict: ")
    assert "Not all is here." in (tmp_path / "report.html").read_text(encoding="utf-8")
    assert build_report(tmp_path).exists()


@dataclass(frozen=True)
class Film:
    """Two films of a pendulum in degrees, with a rig file that states half their noise."""

    rig: Path
    train: Path


@pytest.fixture(scope="module")
def film(tmp_path_factory: pytest.TempPathFactory) -> Film:
    folder = tmp_path_factory.mktemp("film")
    time = np.arange(900) / 30
    angle = 20 * np.exp(-0.05 * time) * np.cos(3.5 * time) + np.random.default_rng(1).normal(0, 0.2, time.size)
    pd.DataFrame({"t": time, "a": angle}).to_csv(folder / "film.csv", index=False)
    (folder / "rig.toml").write_text(
        'name = "film"\nkind = "pendulum"\n[columns]\ntime = { name = "t", unit = "s" }\n'
        'output = { name = "a", unit = "deg", noise = 0.1 }\n'
    )
    return Film(folder / "rig.toml", folder / "film.csv")


@pytest.fixture(scope="module")
def filmed(film: Film, tmp_path_factory: pytest.TempPathFactory) -> tuple[Said, Path]:
    """A loop on the film, in the folder of an old one."""
    out = tmp_path_factory.mktemp("filmed")
    for name in ("prediction.csv", "manoeuvre_3.csv", "report.html"):
        (out / name).write_text("old", encoding="utf-8")
    return heard("loop", film.rig, "--train", film.train, "--out", out), out


def test_a_loop_ends_with_what_doubts_it_and_what_judged(filmed: tuple[Said, Path]) -> None:
    said, _ = filmed
    assert said.status == 0, said.err
    stated, left = [line for line in said.out.splitlines() if line.startswith("doubt: ")]
    assert re.fullmatch(r"doubt: film: 'a' scatters by 0\.\d+ deg beside .* a noise of 0\.1 deg, .*", stated)
    assert re.fullmatch(r"doubt: .* readings lie .* from the model, .* times their noise of .*", left)
    assert "\nholdout: the last third of each training recording, continued; its motion is " in said.out


@pytest.mark.parametrize(("state", "offered"), [("80,0", "1.396,0"), ("-80,10", "-1.396,0.1745"), ("6.2,80", "")])
def test_a_state_in_degrees_is_refused_before_the_loop(
    film: Film, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, state: str,
    offered: str,
) -> None:  # fmt: skip
    def stop(*_: object, **__: object) -> None:
        raise ComputationError("The loop began.")

    monkeypatch.setattr("discovery.runs.stages.loop", stop)
    said = call(capsys, "loop", film.rig, "--train", film.train, "--predict", film.train, "--initial-state", state,
                "--out", tmp_path / "out", "--quiet")  # fmt: skip
    if not offered:
        assert said.err == "discovery: The loop began.\n"
        return
    refused(said, tmp_path / "out")
    assert f"--initial-state {state} is in rad and rad/s" in said.err
    assert f"give --initial-state {offered}." in said.err


def test_a_length_may_be_any_that_was_recorded_but_not_in_another_unit(tmp_path: Path) -> None:
    time = np.arange(400) / 40
    pd.DataFrame({"t": time, "y": 12 * np.cos(3 * time)}).to_csv(tmp_path / "y.csv", index=False)
    text = 'name = "y"\nkind = "oscillator"\n[columns]\ntime = { name = "t", unit = "s" }\n'
    for unit, wrong in (("mm", True), ("m", False), ("deg", False)):
        (tmp_path / "rig.toml").write_text(text + f'output = {{ name = "y", unit = "{unit}" }}\n')
        data = load_dataset(tmp_path / "rig.toml", [tmp_path / "y.csv"])
        check_state(None, data)
        check_state((0.02, 80.0), data)
        if not wrong:
            check_state((5.0, 0.0), data)
            continue
        with pytest.raises(InputError, match=r"is in m and m/s, .* reach no .* 0\.012 m\. .* -8 mm.*-0\.008,0\.001\."):
            check_state((-8.0, 1.0), data)


def test_a_command_that_there_is_not_names_what_does_its_work(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as left:
        main(["predict", "rig.toml"])
    assert left.value.code == 2
    assert "discovery loop RIG --predict FILE" in capsys.readouterr().err


def test_a_drive_that_has_turned_far_may_start_there(tmp_path: Path) -> None:
    time = np.arange(400) / 40
    pd.DataFrame({"t": time, "u": np.sin(time), "y": 10 * time}).to_csv(tmp_path / "y.csv", index=False)
    (tmp_path / "rig.toml").write_text(
        'name = "y"\nkind = "drive"\n[columns]\ntime = { name = "t", unit = "s" }\n'
        'input = { name = "u", unit = "V" }\noutput = { name = "y", unit = "rad" }\n'
    )
    data = load_dataset(tmp_path / "rig.toml", [tmp_path / "y.csv"])
    check_state((120.0, 0.0), data)
    with pytest.raises(InputError, match="If you mean 400 degrees"):
        check_state((400.0, 0.0), data)


@pytest.mark.parametrize(("unit", "told"), [("V", True), ("rad", False)])
def test_an_input_beyond_that_of_training_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], unit: str, told: bool
) -> None:
    time = np.arange(400) / 40
    for name, size in (("y", 1.0), ("far", 3.0)):
        rows = {"t": time, "u": size * np.sin(time), "y": size * np.cos(time)}
        pd.DataFrame(rows).to_csv(tmp_path / f"{name}.csv", index=False)
    kind = "drive" if told else "base_excited"
    (tmp_path / "rig.toml").write_text(
        f'name = "y"\nkind = "{kind}"\n[columns]\ntime = {{ name = "t", unit = "s" }}\n'
        f'input = {{ name = "u", unit = "{unit}" }}\noutput = {{ name = "y", unit = "rad" }}\n'
    )
    data = load_dataset(tmp_path / "rig.toml", [tmp_path / "y.csv"])
    read_wanted(tmp_path / "y.csv", data, None)
    assert "its input reaches" not in capsys.readouterr().err
    read_wanted(tmp_path / "far.csv", data, None)
    said = capsys.readouterr().err
    assert ("far.csv: its input reaches 3 V, and that of the training recordings 1 V." in said) == told


def test_fits_have_units_and_what_is_known_exactly_no_deviation(
    film: Film, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    said = call(capsys, "fit", film.rig, "--train", film.train, "--out", tmp_path, "--quiet")
    number = r"\S+ = \(?\S+ \+- \S+"
    assert re.search(rf"^declared: {number} s\^-1, {number} rad s\^-2, {number} rad s\^-2; ", said.out, re.MULTILINE)


def test_quiet_keeps_what_a_result_means(
    film: Film, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def stop(*_: object, **__: object) -> None:
        raise ComputationError("The loop began.")

    monkeypatch.setattr("discovery.runs.stages.loop", stop)
    arguments = ["loop", film.rig, "--train", film.train, "--predict", film.train, "--out", tmp_path]
    quiet, loud = (call(capsys, *arguments, *more).err for more in (["--quiet"], []))
    warning = f"{film.train}: without --initial-state the prediction starts at rest, and no input drives this system"
    assert quiet.startswith(warning)
    assert warning in loud
    assert "stays there, unless it falls or a force in time is found" in loud
    assert "scatters by" in loud
    assert "scatters by" not in quiet
    assert "errors stay, and a warning that" in " ".join(call(capsys, "loop", "--help").out.split())


def test_what_can_be_given_once_is_refused_twice(
    film: Film, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    twice = ("--predict", film.train, "--predict", film.rig)
    said = call(capsys, "loop", film.rig, "--train", film.train, *twice, "--out", tmp_path / "out")
    assert said.status == 2
    assert f"--predict is given 2 times ({film.train}, {film.rig}): give it once." in said.err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("command", "words"),
    [
        ("campaign", "the same command goes on from what is finished"),
        ("posterior", "goes on with the chains"),
        ("run", "the same command fits again and goes on with the posterior where it was"),
        ("loop", "half-written; give the same command to start over\n"),
        ("fit", "half-written; give the same command to start over\n"),
        ("discover", "half-written; give the same command to start over\n"),
    ],
)
def test_an_interrupted_command_says_what_the_next_one_does(
    command: str, words: str, film: Film, tmp_path: Path, capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    def interrupt(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("discovery.rigs.rig_file.read_rig", interrupt)
    monkeypatch.setattr("discovery.recordings.dataset.read_rig", interrupt)
    said = call(capsys, command, film.rig, "--out", tmp_path / "out")
    assert said.status == 130
    assert words in said.err


@pytest.fixture
def _interruptible() -> Iterator[None]:
    """Let processes hear an interruption that are started where it is ignored, as in the background of a script."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("_interruptible")
@pytest.mark.parametrize(
    ("sent", "status"), [pytest.param(signal.SIGINT, 130, marks=pytest.mark.slow), (signal.SIGTERM, 143)]
)
def test_an_interruption_does_not_wait_for_the_compiler(
    sent: signal.Signals, status: int, film: Film, tmp_path: Path
) -> None:
    cache, out = tmp_path / "cache", tmp_path / "of" / "this"
    command = [sys.executable, "-m", "discovery", "loop", film.rig, "--train", film.train, "--out", out]
    environment = {**os.environ, "DISCOVERY_CACHE": str(cache)}
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=environment) as process:
        assert process.stderr is not None
        while "compiling a simulator" not in process.stderr.readline():
            assert process.poll() is None
        process.send_signal(sent)
        assert "interrupted: no file is half-written" in process.stderr.read()
        assert process.wait() == status
    # The program is kept, what was being compiled is not, and nothing lies half-written beside.
    assert {path.suffix for path in cache.iterdir()} <= {".kept", ".lock"}
    # Nothing was written, so nothing is left.
    assert not out.parent.exists()


@pytest.mark.usefixtures("_interruptible")
def test_an_interruption_that_falls_into_the_end_of_an_object_is_not_lost() -> None:
    code = """
import sys, time
from discovery.cli import cli, main
class Ending:
    def __del__(self):
        raise KeyboardInterrupt
@cli.command()
def sleep():
    ending = Ending()
    del ending
    time.sleep(60)
sys.argv = ["discovery", "sleep"]
main()
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=50)
    assert done.returncode == 130
    assert "interrupted: no file is half-written" in done.stderr
    assert "Exception ignored" not in done.stderr


def test_an_interrupted_process_waits_for_no_thread() -> None:
    code = """
import sys, threading, time
from discovery.cli import cli, main
@cli.command()
def sleep():
    threading.Thread(target=time.sleep, args=(600,)).start()
    raise KeyboardInterrupt
sys.argv = ["discovery", "sleep"]
main()
"""
    # Whoever reads what it says may have been interrupted, too.
    reads, writes = os.pipe()
    os.close(reads)
    try:
        for errors in (subprocess.DEVNULL, writes):
            command = [sys.executable, "-c", code]
            assert subprocess.run(command, stderr=errors, timeout=60, check=False).returncode == 130
    finally:
        os.close(writes)


@pytest.mark.parametrize(("reader", "status"), [("closed", 1), ("full", 3)])
def test_what_is_left_to_do_is_done_without_a_console(tmp_path: Path, reader: str, status: int) -> None:
    """A reader such as `head` has enough after some lines, and a disk may be full: files are written all the same."""
    code = f"""
import sys
import click
from discovery.cli import cli, main
from discovery.cli.streams import spoken
@cli.command()
def answer():
    with spoken():
        click.echo("verdict: explained")
        raise SystemExit(9)
    open({str(tmp_path / "page")!r}, "w").close()
    click.echo("written: page")
sys.argv = ["discovery", "answer"]
main()
"""
    reads, writes = os.pipe()
    os.close(reads)
    with open("/dev/full", "w") as full:
        output = writes if reader == "closed" else full
        found = subprocess.run(
            [sys.executable, "-c", code], stdout=output, stderr=subprocess.PIPE, text=True, check=False
        )
    os.close(writes)
    assert (tmp_path / "page").exists()
    assert found.returncode == status
    assert ("Standard output cannot be written" in found.stderr) == (reader == "full")


@pytest.mark.slow
def test_a_loop_whose_reader_left_writes_its_page(film: Film, tmp_path: Path) -> None:
    reads, writes = os.pipe()
    os.close(reads)
    command = [sys.executable, "-m", "discovery", "loop", film.rig, "--train", film.train, "--out", tmp_path, "--quiet"]
    assert subprocess.run(command, stdout=writes, stderr=subprocess.PIPE, check=False).returncode == 1
    os.close(writes)
    assert {"loop.json", "report.html"} <= {path.name for path in tmp_path.iterdir()}


def answer(**more: Any) -> SimpleNamespace:
    said = {"complete": True, "recordings": (), "stand_ins": {}, "steps": (), "named": {}, "cautions": []}
    return SimpleNamespace(**{**said, **more})


def test_a_loop_says_its_cautions() -> None:
    after = {"train": {"rms": 1.0}, "holdout": {"rms": 9.0}, "holdout_outside": {"rms": 9.0}}
    beyond = {"after": after, "noise_floor": 1.0, "unit": "m", "holdout_scatter": 9.0, "holdout_kind": SEPARATE}
    found = missed(beyond, left=0.0, held=0.0, least=1.0)
    (doubt,) = doubts(answer(cautions=[found]), SimpleNamespace(rig=SimpleNamespace(unfilled=())))
    assert doubt.startswith("the model explains the training recordings to 1 m (rms) and misses the held-out ones")


def test_a_loop_tells_decisions_that_doubt_its_answer() -> None:
    """What the page says of a fit that went astray and of draws that tell nothing, the console says, and no more."""
    astray = Decision("declare", (), False, "astray", {"left": 0.83})
    drawn = Decision("integrate", ("hysteresis",), False, "laplace", {"pareto_k": 1.4})
    good = Decision("integrate", ("hysteresis",), True, "sampled", {"correction": 0.1, "error": 0.1, "pareto_k": 0.2})
    rig = SimpleNamespace(rig=SimpleNamespace(unfilled=()), train=(), holdout=())
    sure, likely = ({"hysteresis": SimpleNamespace(probability=p)} for p in (0.99995, 0.97))
    first, second = doubts(answer(steps=(astray, good, drawn), complete=False, named=likely), rig)
    assert first.startswith("the declared model leaves 83 % of the variance: check")
    assert "check columns, signs, units" in first
    assert "(their largest weights have Pareto k = 1.4)" in second
    # What is beyond doubt stays so, and what was drawn for an effect that is not named tells nothing.
    assert doubts(answer(steps=(drawn,), complete=False), rig) == []
    assert doubts(answer(steps=(drawn,), named=sure), rig) == []
    assert doubts(answer(steps=(drawn,), named=likely), rig) == [second]
    # What explains all that is left was the main force.
    assert doubts(answer(steps=(astray, good)), rig) == []


def test_a_loop_doubts_columns_that_are_exchanged() -> None:
    arm = ARM.parent / "arm_coulomb"
    frame = pd.read_csv(arm / "train_paper.csv")
    notes = bend_flags(
        frame["motor_angle_rad"].to_numpy(),
        {"tip_x": frame["tip_y_m"].to_numpy(), "tip_y": frame["tip_x_m"].to_numpy()},
    )
    recordings_ = tuple(SimpleNamespace(name=name, flags=(Flag("rate_unknown"), *notes)) for name in ("a", "b"))
    (doubt,) = doubts(
        answer(recordings=recordings_), SimpleNamespace(rig=SimpleNamespace(unfilled=()), train=(), holdout=())
    )
    assert doubt == f"a: {notes[0]} So in b."


def test_notes_on_recordings_are_said_and_quiet_is_quiet(
    case: Case, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    frozen, arguments = cut("train_large"), ["elastica", case.rig, "--train", tmp_path / "frozen.csv"]
    frozen.loc[300:340, "tip_y_m"] = 0.12345
    frozen.to_csv(tmp_path / "frozen.csv", index=False)
    said = call(capsys, *arguments)
    assert said.status == 0, said.err
    note = "'tip_y_m' is stuck for 41 samples from 3 s, while the system moves. They are left out."
    assert f"{tmp_path / 'frozen.csv'}: {note}\n" in said.err
    assert call(capsys, *arguments, "--quiet").err == ""


def test_loop_json_keeps_the_contract(looped: tuple[Said, Path]) -> None:
    result = json.loads((looped[1] / "loop.json").read_text())
    assert result["verdict"] == "explained"
    assert result["declared"] == ["viscous_damping", "linear_stiffness", "cubic_stiffness", "radius_law"]
    geometry = {"radius_inertia", "elastica_geometry"}
    assert result["effects"]
    for effect in result["effects"]:
        assert effect["id"] in geometry | set(catalogue())
        assert set(effect) == {
            "id", "parameters", "evidence", "probability", "group_probability", "ambiguous_with",
            "may_stand_for_unknown",
        }  # fmt: skip
        assert set(effect["evidence"]) in (
            set(),
            {"train", "held", "ahead", "size", "against_error", "gain", "beside", "odds"},
        )
        for parameter in effect["parameters"].values():
            assert set(parameter) in ({"value", "sd", "unit"}, {"value", "sd", "unit", "physical"})
            assert set(parameter.get("physical", ())) in (set(), {"value", "sd", "unit"})
    assert set(result["model_error"]) == {"before", "after", "unit", "share", "least", "held", "depends_on"}
    assert result["complete"] is True
    for step in result["steps"]:
        assert set(step) == {"action", "effects", "accepted", "code", "numbers", "candidates"}
    quiet = {"notes": [], "flags": []}
    assert result["recordings"] == [{"name": "train", **quiet}, {"name": "holdout", **quiet}]
    errors = result["errors"]
    assert errors["unit"] == "m"
    assert errors["noise_floor"] == pytest.approx(np.sqrt(2) * 3e-4)
    assert errors["holdout_kind"] == "separate recordings"
    for when in ("before", "after"):
        for what in ("train", "holdout", "holdout_inside"):
            found = errors[when][what]
            assert set(found) == {"rms", "mean", "peak"}
            assert 0 < found["mean"] <= found["rms"] <= found["peak"]
    assert errors["after"]["holdout"]["rms"] < 0.2 * errors["before"]["holdout"]["rms"]


def test_prediction_has_a_row_for_every_time(looped: tuple[Said, Path], case: Case) -> None:
    table, asked = pd.read_csv(looped[1] / "prediction.csv"), pd.read_csv(case.drive)
    assert list(table.columns[:5]) == ["time_s", *BEFORE_AFTER]
    assert set(table.columns[5:]) == set(SPREADS)
    np.testing.assert_allclose(table["time_s"], asked["time_s"], atol=1e-9)
    assert np.isfinite(table.to_numpy()).all()
    assert (table[SPREADS].to_numpy() >= 0).all()


def test_prediction_starts_at_rest_and_follows_the_arm(looped: tuple[Said, Path], case: Case) -> None:
    table, recorded = pd.read_csv(looped[1] / "prediction.csv"), pd.read_csv(case.holdout)[::2]
    motor = float(recorded["motor_angle_rad"].iloc[0])
    start = table.loc[0, BEFORE_AFTER].to_numpy(float)
    # The input is made smooth within the encoder's resolution.
    np.testing.assert_allclose(start, [np.cos(motor), np.sin(motor)] * 2, atol=7e-5)
    truth = recorded[["tip_x_m", "tip_y_m"]].to_numpy()
    distance = {
        when: np.linalg.norm(table[[f"tip_x_{when}_m", f"tip_y_{when}_m"]].to_numpy() - truth, axis=1).mean()
        for when in ("before", "after")
    }
    assert distance["after"] < 1e-3
    assert distance["after"] < 0.5 * distance["before"]


def test_export_writes_the_models_of_a_loop(
    looped: tuple[Said, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    result = json.loads((looped[1] / "loop.json").read_text())
    said = call(capsys, "export", looped[1], "--out", tmp_path / "after")
    assert said.status == 0, said.err
    files = ["model_sympy.py", "model.tex", "model.py", "model.json", "model.h", "model.c", "model_c.py"]
    files.append("model.fmu")
    assert said.out.splitlines() == [str(tmp_path / "after" / name) for name in files]
    for when, chosen in (("after", "json"), ("before", "json,latex")):
        out = tmp_path / f"{when}_chosen"
        said = call(capsys, "export", looped[1], "--out", out, "--what", when, "--format", chosen)
        assert said.status == 0, said.err
        assert len(said.out.splitlines()) == len(list(out.iterdir())) == len(chosen.split(","))
        content = json.loads((out / "model.json").read_text())
        fitted = {row["name"] for row in content["parameters"] if row["fitted"]}
        assert content["model"] == result["model"][when]["model"]
        assert not fitted & content["model"]["known"].keys()
        for row in content["parameters"]:
            if row["fitted"]:
                assert row["value"] == result["model"][when]["parameters"][row["name"]]["value"]
    assert content["provenance"]["data"][0]["source"] == "train.csv"
    assert content["provenance"]["git_revision"] == surroundings()["git_revision"]
    printed = json.loads(
        call(capsys, "export", looped[1], "--out", out, "--what", when, "--format", "json", "--json").out
    )
    assert printed.pop("files") == [str(out / "model.json")]
    assert printed.items() <= content.items()
    said = call(capsys, "export", looped[1], "--out", tmp_path / "none", "--format", "")
    assert said.status == 2
    assert "No format is named" in said.err


def test_export_refuses_what_is_no_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said = call(capsys, "export", tmp_path, "--out", tmp_path / "out")
    assert said.status == 2
    assert "holds no results.json and no loop.json" in said.err
    (tmp_path / "loop.json").write_text('{"model": {}}')
    said = call(capsys, "export", tmp_path, "--out", tmp_path / "out")
    assert said.status == 2
    assert "Make it again" in said.err
    said = call(capsys, "export", tmp_path / "nowhere", "--out", tmp_path / "out")
    assert said.status == 2
    assert "There is no folder" in said.err
    assert not (tmp_path / "out").exists()


@pytest.mark.usefixtures("as_found", "undrawn")
def test_a_prediction_begins_where_it_is_told(case: Case, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said = call(capsys, "loop", case.rig, "--train", case.train, "--holdout", case.holdout, "--predict", case.drive,
                "--initial-state", "0.2,-0.1", "--out", tmp_path)  # fmt: skip
    assert said.status == 0, said.err
    table = pd.read_csv(tmp_path / "prediction.csv")
    motor = float(pd.read_csv(case.drive)["motor_angle_rad"][0])
    for when in ("before", "after"):
        x, y = table.loc[0, [f"tip_x_{when}_m", f"tip_y_{when}_m"]]
        assert np.arctan2(y, x) == pytest.approx(motor + 0.2, abs=7e-5)
        dx, dy = np.diff(table.loc[:1, [f"tip_x_{when}_m", f"tip_y_{when}_m"]].to_numpy(), axis=0)[0]
        # The spring pulls back from the first instant on: about 8.1 x 0.2 rad/s^2 over 0.02 s.
        turn = (np.cos(motor + 0.2) * dy - np.sin(motor + 0.2) * dx) / 0.02
        assert turn == pytest.approx(-0.1 - 0.5 * 8.1 * 0.2 * 0.02, abs=0.015)


@pytest.mark.usefixtures("as_found", "undrawn")
def test_a_motion_that_blows_up_is_status_3(case: Case, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    said = call(capsys, "loop", case.rig, "--train", case.train, "--holdout", case.holdout, "--predict", case.drive,
                "--initial-state", "0.1,1e9", "--out", out, "--quiet")  # fmt: skip
    assert said.status == 3
    assert re.fullmatch(r"discovery: .+\.\n", said.err)
    assert not (out / "prediction.csv").exists()


@pytest.mark.parametrize(
    ("command", "file", "keys"),
    [
        ("discover", "discovery.json", {"provenance", "discovery", "radius"}),
        ("fit", "fit.json", {"provenance", "fits", "fit_errors"}),
        ("elastica", "elastica.json", {"provenance", "prediction", "comparison", "delta_max"}),
        ("residual", "residual.json", {"provenance", "rms", "systematic", "white", "ljung_box_p"}),
    ],
)
def test_single_stages(
    case: Case, tmp_path: Path, capsys: pytest.CaptureFixture[str], command: str, file: str, keys: set[str]
) -> None:
    said = call(capsys, command, case.rig, "--train", case.train, "--out", tmp_path, "--quiet", "--seed", 3)
    assert said.status == 0, said.err
    assert said.err == ""
    assert said.out
    assert [p.name for p in tmp_path.iterdir()] == [file]
    content = json.loads((tmp_path / file).read_text())
    assert keys <= set(content)
    assert content["provenance"]["seed"] == 3
    assert content["provenance"]["data"][0]["name"] == "train"
    if command == "fit":
        said = call(capsys, command, case.rig, "--train", case.train, "--out", tmp_path, "--quiet", "--json")
        assert json.loads(said.out)["files"] == [str(tmp_path / file)]


def test_posterior(case: Case, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from discovery.posterior.draws import Posterior

    said = call(capsys, "posterior", case.rig, "--train", case.train, "--out", tmp_path, "--quiet")
    assert said.status == 0, said.err
    assert sorted(p.name for p in tmp_path.iterdir()) == ["posterior.json", "posterior.nc"]
    assert [line.partition(":")[0] for line in said.out.splitlines()][:4] == ["xi", "alpha", "beta", "gamma"]
    found = Posterior.from_netcdf(tmp_path / "posterior.nc")
    assert len(found.flat()["alpha"]) >= 4000
    # The warning is said under --quiet too, and what belongs to a recording is told apart.
    assert (found.status in said.err) == found.warns
    assert found.warns or found.status in said.out
    physics, _, states = said.out.partition("initial states:\n")
    assert "_init" not in physics
    assert all("_init[train]: " in line for line in states.splitlines() if line.startswith("  "))
    assert {"observed_data", "posterior_predictive"} <= set(xr.open_datatree(tmp_path / "posterior.nc").children)


@pytest.mark.slow
def test_posterior_under_the_noise_of_largest_evidence(
    case: Case, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from discovery.posterior.sampling import sample

    monkeypatch.setattr("discovery.posterior.sampling.sample", partial(sample, min_effective=400, r_hat_max=1.2))
    said = call(capsys, "posterior", case.rig, "--train", case.train, "--out", tmp_path, "--noise", "auto")
    assert said.status == 0, said.err
    content = json.loads((tmp_path / "posterior.json").read_text())
    noise = content["noise"]
    assert noise["chosen"] == max(noise["models"], key=lambda m: m["log_evidence"])["noise"] != "gaussian"
    assert f"noise: {noise['chosen']}, by its evidence" in said.out
    words = words_of(noise["chosen"])
    assert f"sampling the posterior, errors {words}" in said.err
    assert all(row["interval"].endswith(words) for row in content["rows"])
    assert {row["name"] for row in content["rows"] if "meaning" in row} > {"sigma"}


def test_noise_must_be_known_and_apply(case: Case, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert set(NOISES) == {"auto", GAUSSIAN, *NOISE_MODELS}
    common = ("posterior", case.rig, "--train", case.train, "--out", tmp_path, "--quiet", "--noise")
    unknown = call(capsys, *common, "pink")
    assert unknown.status == 2
    assert "student_t" in unknown.err
    other = call(capsys, *common, "quantised")
    assert other.status == 2
    assert "readings in steps" in other.err
    assert list(tmp_path.iterdir()) == []


def test_effects(capsys: pytest.CaptureFixture[str]) -> None:
    listed = call(capsys, "effects")
    assert [line.split()[0] for line in listed.out.splitlines()] == sorted({*catalogue(), *UPGRADES})
    assert list(NAMED_KINDS) == list(get_args(RigTable.model_fields["kind"].annotation))
    assert call(capsys, "effects", "coulomb_friction", "--system", "oscillator").status == 2
    card = call(capsys, "effects", "coulomb_friction")
    assert card.status == 0
    for part in ("dissipation", "f_c", "q s^-2", "Dry friction", "Coulomb (1785)"):
        assert part in card.out
    assert ":math:" not in card.out
    assert ".. math::" not in card.out
    assert "The paper: Experimental Validation" in call(capsys, "effects", "cubic_stiffness").out
    unknown = call(capsys, "effects", "coulomb_frcition")
    assert unknown.status == 2
    assert "Did you mean coulomb_friction" in unknown.err


#: Some effects that a loop tries on a kind or that it declares, and some that act on such a system but are not tried.
TRIED = {
    "flexible_arm": ({"cubic_stiffness", "base_backlash", "elastica_geometry"}, {"coriolis_coupling", "cogging"}),
    "oscillator": ({"second_mode", "constant_force", "sensor_delay"}, {"play", "buoyancy"}),
    "pendulum": ({"gravity_torque", "input_dead_zone"}, {"play", "friction_through_play"}),
    "base_excited": ({"linear_stiffness", "second_mode"}, {"input_dead_zone", "cogging"}),
    "drive": ({"friction_through_play", "presliding_friction", "cogging", "input_saturation"}, {"play", "buoyancy"}),
    "system": ({"cogging", "play", "sensor_delay", "linear_stiffness"}, {"second_mode", "buoyancy"}),
    "falling_body": ({"buoyancy", "quadratic_drag"}, {"coulomb_friction", "gravity_torque", "constant_force"}),
}


@pytest.mark.parametrize("kind", NAMED_KINDS)
def test_effects_of_a_kind_are_those_that_a_loop_tries(kind: str, capsys: pytest.CaptureFixture[str]) -> None:
    listed = {line.split()[0] for line in call(capsys, "effects", "--system", kind).out.splitlines()}
    tried, never = TRIED[kind]
    assert tried <= listed
    assert not never & listed
    assert listed <= {i for i, e in catalogue().items() if System.of(kind) in e.systems} | {*UPGRADES}


def test_effects_says_where_an_effect_applies_and_what_to_do_elsewhere(capsys: pytest.CaptureFixture[str]) -> None:
    card = call(capsys, "effects", "base_backlash").out
    assert "Applies to a flexible arm. On any other system" in card
    assert "w_p        [rad]" in card
    assert "unit of the coordinate" not in card
    assert "`discovery effects --system oscillator` lists what is tried there" in card
    both = call(capsys, "effects", "coulomb_friction").out
    assert "Applies to a flexible arm and to any other system" in both
    assert "[q s^-2]" in both
    assert both.endswith("\n  q is the unit of the coordinate.\n")
    spoken = call(capsys, "effects", "backlash")
    assert spoken.status == 2
    assert "Did you mean base_backlash, friction_through_play?" in spoken.err


@pytest.mark.parametrize(("base", "name"), [(step.base, name) for name, step in UPGRADES.items()])
def test_effects_shows_what_the_loop_calls_a_step_of_the_mechanics(
    base: str, name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    card = call(capsys, "effects", name)
    assert card.status == 0
    for part in (f"{name} (mechanics;", "\n    ", f"base to `{base}`", "no free parameter", "Lagrange"):
        assert part in card.out
    misspelt = call(capsys, "effects", f"{name[:-2]}x")
    assert misspelt.status == 2
    assert f"Did you mean {name}" in misspelt.err


def test_effects_shows_the_force_that_is_in_no_catalogue(capsys: pytest.CaptureFixture[str]) -> None:
    assert "in no catalogue" in call(capsys, "effects", "external_force").out


@pytest.mark.slow
def test_simulate(tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recordings, "DURATION", 2.0)
    first, same, other = (tmp_path / f"{n}.csv" for n in ("first", "same", "other"))
    for path, seed in ((first, 1), (same, 1), (other, 2)):
        arguments = ["simulate", "train_paper", "--effect", "camera_origin_offset:x=0.01,y=-0.02"]
        said = call(capsys, *arguments, "--seed", seed, "--out", path)
        assert said.status == 0, said.err
        assert said.out == f"{path}\n"
    assert first.read_bytes() == same.read_bytes() != other.read_bytes()
    table = pd.read_csv(first)
    assert list(table.columns) == ["time_s", "motor_angle_rad", "tip_x_m", "tip_y_m"]
    assert len(table) == 201
    said = call(capsys, *arguments, "--seed", 1, "--out", same, "--json")
    hidden = {"id": "camera_origin_offset", "x": 0.01, "y": -0.02}
    of = {"manoeuvre": "train_paper", "seed": 1, "columns": list(table.columns), "samples": 201, "effects": [hidden]}
    assert json.loads(said.out) == {**of, "files": [str(same)]}
    # Where the camera says that the hub's far end is, while the arm still rests.
    np.testing.assert_allclose(table.loc[:40, ["tip_x_m", "tip_y_m"]].mean(), [1.01, -0.02], atol=2e-4)


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        (["no_manoeuvre"], "it knows train_paper"),
        (["train_paper", "--effect", "no_effect:x=1"], "It has coulomb_friction"),
        (
            ["train_paper", "--effect", "coulomb_friction:force=much"],
            "'force' is 'much', which is no number. Write it as",
        ),
        (["train_paper", "--effect", "coulomb_friction:force=nan"], "'force' is 'nan', which is no number"),
        (["train_paper", "--effect", "coulomb_friction:force=1,force=2"], "'force' is given twice"),
        (["train_paper", "--effect", "coulomb_friction:forc=1"], "has no parameter 'forc'. Did you mean 'force'?"),
        (["train_paper", "--effect", "coulomb_friction:power=1"], "as coulomb_friction:force=VALUE,speed=0.002;"),
        (["train_paper", "--effect", "coulomb_friction"], "lacks the parameter 'force'. Write it as coulomb_friction:"),
    ],
)
def test_simulate_refuses(tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], part: str) -> None:
    said = call(capsys, "simulate", *arguments, "--out", tmp_path / "x.csv")
    refused(said, tmp_path / "x.csv")
    assert part in said.err


def test_simulate_refuses_what_is_no_file_to_write(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recordings, "DURATION", 1.0)
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").touch()
    monkeypatch.chdir(tmp_path)
    for out, part in (
        (".", "name the file to write with --out, as train_paper.csv"),
        ("folder", "folder is a folder"),
        ("file/x.csv", "file/x.csv cannot be written: "),
    ):
        said = call(capsys, "simulate", "train_paper", "--out", out)
        assert said.status == 2
        assert said.out == ""
        assert said.err.startswith("discovery: ")
        assert part in said.err
    said = call(capsys, "simulate", "train_paper", "--seed", "-3", "--out", "x.csv")
    assert said.status == 2
    assert "-3 is not in the range" in said.err
    # A folder that appears while the twin is simulated.
    with pytest.raises(OSError, match="folder"):
        instrument.write_csv(cut("train_paper", 3), tmp_path / "folder")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["file", "folder"]


def test_the_help_of_simulate_names_manoeuvres_and_where_effects_are(capsys: pytest.CaptureFixture[str]) -> None:
    assert list(recordings.MANOEUVRES) == list(MANOEUVRES)
    said = call(capsys, "simulate", "--help")
    assert all(name in said.out for name in MANOEUVRES)
    assert "--list-effects" in said.out
    loaded = "import sys; sys.argv = ['d', 'simulate', '-h']\nfrom discovery.cli import main\nmain()\n"
    loaded += "sys.exit('numpy' in sys.modules or 'discovery_datasets' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", loaded], capture_output=True).returncode == 0
    listed = call(capsys, "simulate", "--list-effects")
    assert listed.status == 0, listed.err
    assert [line.partition(":")[0] for line in listed.out.splitlines()[::2]] == list(DISTURBANCES)
    assert "coulomb_friction:force,speed=0.002\n    Dry friction between disc and table" in listed.out


def test_data_list_and_check(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setenv(registry.VARIABLE, str(tmp_path))
    listed = call(capsys, "data", "list")
    assert listed.status == 0
    assert [line.split()[0] for line in listed.out.splitlines()[::2]] == list(registry.FILES)
    first, second = list(registry.FILES)[:2]
    (tmp_path / second).parent.mkdir()
    (tmp_path / second).write_bytes(b"something else")
    states = dict(reversed(line.split()) for line in call(capsys, "data", "check").out.splitlines())
    assert list(states) == list(registry.FILES)
    assert (states[first], states[second]) == ("absent", "altered")
    monkeypatch.setattr(registry, "fetch", lambda name: tmp_path / name)
    fetched = json.loads(call(capsys, "data", "fetch", first, "--json").out)
    assert fetched["files"] == [str(tmp_path / first)]
    assert fetched["licence"] == registry.FILES[first].licence
    monkeypatch.undo()
    unknown = call(capsys, "data", "fetch", "unknown.csv")
    assert unknown.status == 2
    assert "unknown.csv" in unknown.err


# Bad input: status 2, one paragraph that names the file, nothing written.


def refused(said: Said, out: Path) -> None:
    assert said.status == 2
    assert said.out == ""
    assert said.err.startswith("discovery: ")
    assert said.err.count("\n") == 1
    assert said.err.endswith(".\n")
    assert "Traceback" not in said.err
    assert not out.exists()


def put(row: int, column: str, value: object) -> Callable[[pd.DataFrame], pd.DataFrame]:
    def edit(frame: pd.DataFrame) -> pd.DataFrame:
        frame = frame.astype(object)
        frame.loc[row, column] = value
        return frame

    return edit


TABLES: dict[str, tuple[Callable[[pd.DataFrame], pd.DataFrame], list[str]]] = {
    "missing column": (lambda f: f.drop(columns="tip_y_m"), ["tip_y_m"]),
    "wrong column": (lambda f: f.rename(columns={"motor_angle_rad": "motr_angle_rad"}), ["motor_angle_rad"]),
    "duplicate column": (lambda f: pd.concat([f, f[["tip_x_m"]]], axis=1), ["tip_x_m", "two columns"]),
    "wrong unit": (lambda f: f.rename(columns={"tip_x_m": "tip_x_rad"}), ["tip_x_rad"]),
    "text in numbers": (put(41, "tip_x_m", "lost"), ["tip_x_m", "row 42", "'lost'"]),
    "time goes back": (put(100, "time_s", 0.5), ["time_s", "row 101"]),
    "time repeats": (put(100, "time_s", 0.99), ["time_s", "row 101"]),
    "gap in the input": (put(200, "motor_angle_rad", np.nan), ["motor_angle_rad", "row 201"]),
    "dead sensor": (lambda f: f.assign(tip_y_m=0.25), ["tip_y_m"]),
    "too short": (lambda f: f[:20], ["too short"]),
    "millimetres": (lambda f: f.assign(tip_x_m=1e3 * f["tip_x_m"], tip_y_m=1e3 * f["tip_y_m"]), ["tip_x_mm"]),
    "degrees": (lambda f: f.assign(motor_angle_rad=np.degrees(f["motor_angle_rad"])), ["motor_angle_deg"]),
}


@pytest.mark.parametrize("fault", TABLES)
def test_bad_recordings(case: Case, tmp_path: Path, capsys: pytest.CaptureFixture[str], fault: str) -> None:
    edit, parts = TABLES[fault]
    bad, out = tmp_path / "bad.csv", tmp_path / "out"
    edit(cut("train_large")).to_csv(bad, index=False)
    said = call(capsys, "loop", case.rig, "--train", bad, "--out", out)
    refused(said, out)
    assert str(bad) in said.err
    for part in parts:
        assert part in said.err


@pytest.mark.parametrize("content", [None, b"", bytes(range(256))], ids=["missing", "empty", "binary"])
@pytest.mark.parametrize("role", ["--train", "--holdout", "--predict"])
def test_bad_files_in_every_role(
    case: Case, tmp_path: Path, capsys: pytest.CaptureFixture[str], content: bytes | None, role: str
) -> None:
    bad, out = tmp_path / "bad.csv", tmp_path / "out"
    if content is not None:
        bad.write_bytes(content)
    train = [] if role == "--train" else ["--train", case.train]
    said = call(capsys, "loop", case.rig, *train, role, bad, "--out", out)
    refused(said, out)
    assert str(bad) in said.err


@pytest.mark.parametrize("command", ["run", "loop", "discover", "fit", "posterior", "elastica", "residual"])
def test_every_command_refuses_a_bad_rig(
    case: Case, tmp_path: Path, capsys: pytest.CaptureFixture[str], command: str
) -> None:
    rig, out = tmp_path / "rig.toml", tmp_path / "out"
    rig.write_text('name = "arm"\nlength = 1.0\n')
    said = call(capsys, command, rig, "--train", case.train, "--out", out)
    refused(said, out)
    assert str(rig) in said.err
    assert "length_m" in said.err


@pytest.mark.parametrize("state", ["0.1", "0.1,b", "1,2,3", "nan,0"])
def test_bad_initial_state(case: Case, tmp_path: Path, capsys: pytest.CaptureFixture[str], state: str) -> None:
    out = tmp_path / "out"
    said = call(capsys, "loop", case.rig, "--train", case.train, "--predict", case.drive, "--initial-state", state,
                "--out", out)  # fmt: skip
    refused(said, out)
    assert "POSITION,RATE" in said.err


def test_a_file_in_place_of_the_folder(case: Case, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    out.write_text("kept")
    said = call(capsys, "loop", case.rig, "--train", case.train, "--out", out)
    assert said.status == 2
    assert f"{out} is a file" in said.err
    assert out.read_text() == "kept"


def test_nothing_to_fit(case: Case, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said = call(capsys, "loop", case.rig, "--out", tmp_path / "out")
    refused(said, tmp_path / "out")
    assert "--train" in said.err


def test_a_report_needs_a_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said = call(capsys, "report", tmp_path)
    assert said.status == 2
    assert "neither results.json nor the page of a loop" in said.err
    assert not list(tmp_path.iterdir())


def test_the_elastica_predicts_from_the_rig_alone(case: Case, capsys: pytest.CaptureFixture[str]) -> None:
    said = call(capsys, "elastica", case.rig, "--quiet")
    assert said.status == 0
    rows = [line.split() for line in said.out.splitlines()]
    alpha = next(float(row[3]) for row in rows if row[:3] == ["rod_counted", "static_small", "alpha"])
    assert alpha == pytest.approx(8.093, rel=2e-3)
    units = {row[2]: " ".join(row[6 if "+-" in row else 4 :]) for row in rows if row[0] == "rod_counted"}
    parameters = {p.name: p.unit for e in ("linear_stiffness", "cubic_stiffness", "radius_law") for p in
                  catalogue()[e].parameters()}  # fmt: skip
    assert parameters.items() <= units.items()
    assert "static_least_squares" not in said.out


def test_the_elastica_needs_the_rig(case: Case, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rig, out = tmp_path / "rig.toml", tmp_path / "out"
    rig.write_text('name = "arm"\nlength_m = 1.0\n')
    said = call(capsys, "elastica", rig, "--train", case.train, "--out", out, "--quiet")
    refused(said, out)
    assert "flexural_rigidity" in said.err


@pytest.mark.parametrize(
    "arguments", [["frobnicate"], ["loop"], ["loop", "r.toml"], ["fit", "r.toml", "--out", "o", "--seed", "many"]]
)
def test_usage_errors(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, arguments: list[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    said = call(capsys, *arguments)
    assert said.status == 2
    assert "Usage: discovery" in said.err
    assert not list(tmp_path.iterdir())


def test_help_names_every_command() -> None:
    said = shell("--help")
    assert said.status == 0
    for name in ("run", "loop", "discover", "fit", "posterior", "elastica", "residual", "report", "effects", "data"):
        assert name in cli.commands
        assert re.search(rf"^  {name} ", said.out, re.MULTILINE)


@pytest.mark.slow
def test_the_exit_status_reaches_the_shell(tmp_path: Path) -> None:
    said = shell("loop", tmp_path / "none.toml", "--out", tmp_path / "out")
    refused(said, tmp_path / "out")
