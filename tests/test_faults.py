"""Faults of the machine and of odd names: one message, the right exit status, nothing half-written, nothing mixed."""

from __future__ import annotations

import errno
import json
import math
import os
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any

import click
import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner
from test_cli import Said, call

from discovery.cli import stages
from discovery.cli.folders import held
from discovery.foundation.errors import ComputationError, InputError
from discovery.foundation.io import atomic_write
from discovery.foundation.locks import folder_lock
from discovery.posterior import checkpoint
from discovery.results import curves
from discovery.results.manifest import check_whole, hashes, move_in_place, remove_unfinished
from discovery.results.provenance import plain, read_json, restored, write_json
from discovery.rigs.rig_file import read_rig
from discovery.runs.campaign import campaign, unfinished

RIG = """name = "a pendulum"
kind = "pendulum"
length_m = 0.8
[columns]
time = {{ name = "t", unit = "s" }}
output = {{ name = "angle", unit = "{unit}" }}
[records]
train = [{{ file = "{file}" }}]
holdout = [{{ file = "hold.csv" }}]
"""


def swing(amplitude: float, damping: float = 0.02, n: int = 400) -> pd.DataFrame:
    """Return a decaying swing of a pendulum of 0.8 m with some noise [rad]."""
    t = np.arange(n) / 40.0
    y = amplitude * np.exp(-damping * t) * np.cos(3.45 * t)
    return pd.DataFrame({"t": t, "angle": y + 1e-3 * np.random.default_rng(n).standard_normal(n)})


@pytest.fixture
def rig(tmp_path: Path) -> Path:
    swing(0.2).to_csv(tmp_path / "train.csv", index=False)
    swing(0.15, n=390).to_csv(tmp_path / "hold.csv", index=False)
    (tmp_path / "rig.toml").write_text(RIG.format(unit="rad", file="train.csv"))
    return tmp_path / "rig.toml"


def refused(said: Said, status: int, *parts: str) -> None:
    assert said.status == status, said.err
    lines = [line for line in said.err.splitlines() if line.startswith("discovery: ") or line.startswith("Error: ")]
    assert len(lines) == 1, said.err
    assert "Traceback" not in said.err
    for part in parts:
        assert part in said.err


# --- what the disk refuses


class Full:
    """A disk with no room for more: a Linux file that refuses every byte takes the place of what is written."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        def write(path: Path, *_: object, **__: object) -> int:
            path.touch()
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

        monkeypatch.setattr(Path, "write_bytes", write)
        monkeypatch.setattr(Path, "write_text", write)


@pytest.mark.parametrize("writer", ["json", "netcdf", "checkpoint"])
def test_a_full_disk_leaves_what_was_there(writer: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import xarray as xr

    path = tmp_path / "file"
    path.write_text("old")
    Full(monkeypatch)
    writers = {
        "json": lambda: write_json(path, {"a": 1}),
        "netcdf": lambda: curves.save_groups(path, {"a": xr.Dataset({"x": ("t", np.arange(3.0))})}),
        "checkpoint": lambda: checkpoint.save(path, [], "run"),
    }
    with pytest.raises(ComputationError, match=r"file cannot be written: No space left.*half-written.*Make room"):
        writers[writer]()
    assert path.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["file"]


def test_a_folder_in_the_place_of_a_file_is_told(tmp_path: Path) -> None:
    (tmp_path / "a.json").mkdir()
    with (
        pytest.raises(ComputationError, match=r"a\.json cannot be written: Is a directory"),
        atomic_write(tmp_path / "a.json") as draft,
    ):
        draft.write_text("x")
    assert [p.name for p in tmp_path.iterdir()] == ["a.json"]


@pytest.mark.parametrize("command", ["loop", pytest.param("run", marks=pytest.mark.slow), "fit", "residual"])
def test_a_command_on_a_full_disk_is_status_3(
    command: str, rig: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    Full(monkeypatch)
    out = tmp_path / "out"
    said = call(capsys, command, rig, "--out", out, "--quiet", *(["--no-posterior"] if command == "run" else []))
    refused(said, 3, "cannot be written: No space left on device", str(out))
    assert not out.exists()


@pytest.mark.parametrize(
    ("command", "file"),
    [("loop", "loop.json"), ("loop", "prediction.csv"), ("run", "results.json"), ("run", "amplitude.nc"),
     ("fit", "fit.json"), ("posterior", "posterior.nc")],
)  # fmt: skip
def test_a_folder_where_a_result_goes_is_refused_at_once(
    command: str, file: str, rig: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "out" / file).mkdir(parents=True)
    refused(call(capsys, command, rig, "--out", tmp_path / "out"), 2, f"{file} is a folder", "--out")


@pytest.mark.parametrize("command", ["loop", "run", "export", "campaign", "discover"])
@pytest.mark.parametrize("out", ["", "x" * 300, "y" * 5000])
def test_an_out_that_is_no_name_is_refused(
    command: str, out: str, rig: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    (tmp_path / "loop.json").write_text("{}")
    before = sorted(tmp_path.iterdir())
    said = call(capsys, command, tmp_path if command == "export" else rig, "--out", out)
    if command == "export" and out:
        refused(said, 2)
    else:
        refused(said, 2, "--out")
    assert len(said.err) < 1000
    assert sorted(tmp_path.iterdir()) == before


# --- two at once, and one that was ended


def test_two_commands_never_write_to_one_folder(rig: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / "results.json").write_text("{}")
    with folder_lock(out):
        for command in (("loop", rig, "--out", out), ("run", rig, "--out", out), ("report", out)):
            refused(call(capsys, *command), 2, "Another discovery command is writing to", str(out))
    # Whoever held it has ended: nothing is left to be removed by hand.
    assert [p.name for p in out.iterdir()] == ["results.json"]
    refused(call(capsys, "report", out), 2, "results.json lacks")


def gathered(folder: Path, word: str, *names: str) -> Path:
    """Gather the files of a run, as `run` does."""
    beside = folder / f".saving-{word}"
    beside.mkdir(parents=True)
    for name in names:
        (beside / name).write_text(word)
    write_json(beside / "results.json", {"word": word, "provenance": {"files": hashes(beside, names)}})
    return beside


@pytest.mark.parametrize("moves", range(9))
def test_a_run_that_dies_while_it_saves_leaves_no_mixture(
    moves: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    move_in_place(gathered(tmp_path, "old", "trajectories.nc", "laws.nc", "manoeuvre_1.csv"), tmp_path)
    (tmp_path / "report.html").write_text("old")
    check_whole(tmp_path, read_json(tmp_path / "results.json"))
    left = iter(range(moves))

    def dying(method: Any) -> Any:
        def step(self: Path, *arguments: Any, **named: Any) -> Any:
            if next(left, None) is None:
                raise KeyboardInterrupt
            return method(self, *arguments, **named)

        return step

    beside = gathered(tmp_path, "new", "trajectories.nc", "amplitude.nc", "loop.json")
    with monkeypatch.context() as patch:
        patch.setattr(Path, "unlink", dying(Path.unlink))
        patch.setattr(Path, "replace", dying(Path.replace))
        with suppress(KeyboardInterrupt):
            move_in_place(beside, tmp_path)
    if (tmp_path / "results.json").exists():
        results = read_json(tmp_path / "results.json")
        check_whole(tmp_path, results)
        page = (tmp_path / "report.html").exists()
        assert not page or results["word"] == "old"
    remove_unfinished(tmp_path)
    assert not [*tmp_path.glob(".saving-*")]


@pytest.mark.parametrize("change", ["another", "missing", "unnamed"])
def test_files_of_two_runs_are_refused(change: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    move_in_place(gathered(tmp_path, "old", "trajectories.nc"), tmp_path)
    content = {"rig": 1, "recordings": 1, "loop": 1, "models": {}}
    write_json(tmp_path / "results.json", {**read_json(tmp_path / "results.json"), **content})
    if change == "another":
        (tmp_path / "trajectories.nc").write_text("new")
    elif change == "missing":
        (tmp_path / "trajectories.nc").unlink()
    else:
        (tmp_path / "amplitude.nc").write_text("new")
    for command in (("report", tmp_path), ("export", tmp_path, "--out", tmp_path / "model")):
        refused(call(capsys, *command), 2, "the folder would mix results", "Run the pipeline again")
    assert not (tmp_path / "report.html").exists()


def test_what_was_ended_is_removed_and_other_files_are_not(tmp_path: Path) -> None:
    gathered(tmp_path, "old", "trajectories.nc")
    (tmp_path / ".discovery-0123abcd-results.json").touch()
    for name in (".results.json", ".notes.0123abcd.json", "loop.json"):
        (tmp_path / name).touch()
    for name in ("figures", "of_another_command"):
        (tmp_path / name).mkdir()
        (tmp_path / name / ".discovery-0123abcd-fit.svg").touch()
    with folder_lock(tmp_path / "of_another_command"):
        remove_unfinished(tmp_path)
    assert sorted(str(p.relative_to(tmp_path)) for p in tmp_path.rglob("*") if p.is_file()) == [
        ".notes.0123abcd.json", ".results.json", "loop.json", "of_another_command/.discovery-0123abcd-fit.svg",
    ]  # fmt: skip


def test_an_interruption_leaves_no_folder_that_was_just_made(tmp_path: Path) -> None:
    """It may come between making the folder and entering the block that would remove it."""

    @click.command()
    def interrupted() -> None:
        held(tmp_path)
        (tmp_path / ".saving-abc").mkdir()
        (tmp_path / "loop.json").touch()
        raise KeyboardInterrupt

    assert CliRunner().invoke(interrupted).exit_code == 1
    assert [p.name for p in tmp_path.iterdir()] == ["loop.json"]


# --- names and numbers


@pytest.mark.parametrize(
    "name", ["Infinity", "-Infinity", "\\Infinity", "\\\\-Infinity", "NaN", "null", "", "a\\Infinity"]
)
def test_a_name_is_no_number(name: str, tmp_path: Path) -> None:
    content = {"name": name, "values": [math.inf, -math.inf, 1.5, name]}
    assert restored(plain(content)) == content
    write_json(tmp_path / "x.json", content)
    assert read_json(tmp_path / "x.json") == content
    assert json.loads((tmp_path / "x.json").read_text())["values"][:2] == ["Infinity", "-Infinity"]


#: What a reader of JSON, of paths, of lines or of templates might take for something else.
ODD_NAMES = [
    "NaN",
    *(pytest.param(n, marks=pytest.mark.slow) for n in ("..", "a\nb", "Infinity", "-Infinity", "null", "%s{0}")),
]


@pytest.mark.usefixtures("sketched")
@pytest.mark.parametrize("name", ODD_NAMES)
def test_recordings_may_have_any_name(name: str, rig: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "train.csv").rename(tmp_path / f"{name}.csv")
    out = tmp_path / "out"
    recordings = ("--train", tmp_path / f"{name}.csv", "--holdout", tmp_path / "hold.csv")
    said = call(capsys, "run", rig, *recordings, "--out", out, "--quiet", "--no-posterior")
    assert said.status == 0, said.err
    assert read_json(out / "results.json")["recordings"][0]["name"] == name
    assert call(capsys, "export", out, "--out", out).status == 0
    compile((out / "model.py").read_text(), "model.py", "exec")


ODD_RIGS = {
    "NUL in a file's name": (RIG.format(unit="rad", file="a\\u0000b.csv"), ("cannot be read", "null byte")),
    "a long name": (RIG.format(unit="rad", file="x" * 3000 + ".csv"), ("cannot be read", "too long")),
    "control characters": (RIG.format(unit="rad", file="train.csv").replace("a pendulum", "a\\u0000b"), ("'name'",)),
    "nested values": ("a = " + "[" * 3000 + "]" * 3000, ("too deeply",)),
    "nested tables": ("a = " + "{a=" * 3000 + "1" + "}" * 3000, ("too deeply",)),
    "5001 digits": ("length_m = 1" + "0" * 5000, ("not valid TOML", "digits")),
    "400 digits": (RIG.format(unit="rad", file="train.csv").replace("0.8", "1" + "0" * 400), ("length_m",)),
    "400 digits of samples": (
        RIG.format(unit="rad", file="train.csv").replace('"train.csv" ', f'"train.csv", samples = [0, 1{"0" * 400}] '),
        (),
    ),
    "bytes": ("\udcff", ("not valid TOML",)),
}


@pytest.mark.parametrize("kind", ODD_RIGS)
@pytest.mark.parametrize("data", [False, True])
def test_odd_rig_files_are_refused(
    kind: str, data: bool, rig: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.setenv("DISCOVERY_DATA", str(tmp_path / "data") if data else "")
    (tmp_path / "data" / "below").mkdir(parents=True)
    text, parts = ODD_RIGS[kind]
    rig.write_bytes(text.encode("utf-8", "surrogateescape"))
    said = call(capsys, "fit", rig, "--out", tmp_path / "out", "--quiet")
    if parts:
        refused(said, 2, *parts)
        assert len(said.err) < 6000
    assert "Traceback" not in said.err


def test_a_byte_order_mark_is_no_part_of_a_rig_file(rig: Path) -> None:
    known = read_rig(rig)
    rig.write_bytes(b"\xef\xbb\xbf" + rig.read_bytes())
    assert read_rig(rig).name == known.name


@pytest.mark.parametrize(
    ("column", "size"),
    [("t", 1e300), ("t", 1e-200), ("t", 1e70), ("angle", 1e-200), ("angle", 1e150), ("angle", 1e307)],
)
def test_numbers_out_of_range_are_refused(
    column: str, size: float, rig: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = swing(0.2)
    table[column] *= size / table[column].abs().max()
    table.to_csv(tmp_path / "train.csv", index=False)
    text = RIG.format(unit="rad", file="train.csv").replace("pendulum", "oscillator").replace("length_m = 0.8\n", "")
    rig.write_text(text.replace('"rad"', '"km"'))
    said = call(capsys, "loop", rig, "--out", tmp_path / "out", "--quiet")
    refused(said, 2, "train.csv", repr(column), "orrect the unit")
    assert not (tmp_path / "out").exists()


def test_a_cell_of_thousands_of_digits_is_no_traceback(
    rig: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lines = (tmp_path / "train.csv").read_text().splitlines()
    lines[5] = f"0.1,1{'0' * 5000}"
    (tmp_path / "train.csv").write_text("\n".join(lines))
    refused(call(capsys, "fit", rig, "--out", tmp_path / "out", "--quiet"), 2, "train.csv")


@pytest.mark.parametrize("content", ["", "{", "[]", "7", '{"name": "a"}', "[" * 100000, '{"error": ""}', "\0"])
def test_a_damaged_outcome_of_a_campaign_is_done_again(content: str, tmp_path: Path) -> None:
    work = [("a", 1)]
    assert len([*campaign(_nothing, work, tmp_path, workers=1)]) == 1
    assert not [*unfinished(work, tmp_path)]
    (tmp_path / "cases" / "a.json").write_text(content)
    ((_, _, reason),) = unfinished(work, tmp_path)
    assert reason in ("its outcome cannot be read", "its outcome is not whole")
    assert len([*campaign(_nothing, work, tmp_path, workers=1)]) == 1
    assert not [*unfinished(work, tmp_path)]
    (tmp_path / "campaign.json").write_text(content)
    with pytest.raises(InputError, match=r"campaign"):
        campaign(_nothing, work, tmp_path, workers=1)


def _nothing(case: int, _seed: object) -> dict[str, int]:
    return {"value": case}


@pytest.mark.parametrize("content", ["[" * 100000, "7", "[]", '{"models": 7}', '{"models": {"after": []}}'])
@pytest.mark.parametrize("file", ["results.json", "loop.json"])
def test_odd_results_are_refused(content: str, file: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / file).write_text(content)
    refused(call(capsys, "export", tmp_path, "--out", tmp_path / "model"), 2, file)
    refused(call(capsys, "report", tmp_path), 2, "results.json")


# --- standard streams


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="this system has no device that is always full")
@pytest.mark.slow
@pytest.mark.parametrize(
    ("streams", "status"), [(">/dev/full", 3), (">&- 2>&- <&-", 0), ("2>/dev/full", 0), (">&-", 0), ("2>&-", 0)]
)
def test_streams_that_are_full_or_closed(streams: str, status: int, rig: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    command = f'"$0" -m discovery fit "$1" --out "$2" {streams}'
    run = subprocess.run(["sh", "-c", command, sys.executable, rig, out], capture_output=True, text=True)
    assert run.returncode == status, run.stderr
    assert json.loads((out / "fit.json").read_text())
    assert "Traceback" not in run.stderr
    if status:
        assert "discovery: Standard output cannot be written: No space left on device" in run.stderr
        assert len([line for line in run.stderr.splitlines() if "discovery: " in line]) == 1


def test_a_fault_of_the_system_is_status_3(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    for error, words in (
        (OSError(errno.EIO, "Input/output error", "a.nc"), "a.nc: Input/output error"),
        (OSError("a library's own words"), "a library's own words"),
        (MemoryError(), "memory of this machine"),
    ):

        def fail(*_: object, error: BaseException = error) -> None:
            raise error

        monkeypatch.setattr("discovery.rigs.rig_file.read_rig", fail)
        refused(call(capsys, "elastica", "rig.toml"), 3, words)


def test_runner_sees_the_same(rig: Path) -> None:
    assert CliRunner().invoke(stages.fit, [str(rig), "--out", ""]).exit_code == 2
    assert read_rig(rig).name == "a pendulum"
