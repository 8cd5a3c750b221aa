"""A declared model that has no fit: the loop and the run say why and what would help, in loop.json and on a page."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

from benchmarks.dashboard.page import build_index
from discovery.cli import main
from discovery.report import build_report
from discovery.report.doubt_sentences import failure_sentence, remedy_sentence
from discovery.report.sentences import verdict_sentence

#: The words and files of pages are what is tested here.
pytestmark = pytest.mark.usefixtures("undrawn")

#: A loss and a spring with the wrong sign: it runs away, and its guesses are stiff.
RIG = """
name = "wrong signs"

[system]
coordinates = { angle = "rad" }
kinetic = "inertia*dot(angle)^2/2"
potential = "-stiffness*angle^4/4"
dissipation = "-loss*dot(angle)^2/2"
output = "angle"
places = { joint = "angle" }

[system.constants]
inertia = { value = 1.0, unit = "kg m^2" }
stiffness = { guess = 2000.0, unit = "N m" }
loss = { guess = 10.0, unit = "N m s" }

[columns]
time = { name = "t", unit = "s" }
output = { name = "y", unit = "rad", noise = 1e-3 }
"""


def write(path: Path, **columns: np.ndarray) -> None:
    np.savetxt(path, np.column_stack(list(columns.values())), "%.7g", ",", header=",".join(columns), comments="")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a folder with the rig file and a free decay that is nothing like it."""
    (tmp_path / "rig.toml").write_text(RIG, encoding="utf-8")
    time = np.arange(400) / 100
    noise = np.random.default_rng(1).normal(0, 1e-3, time.size)
    write(tmp_path / "swing.csv", t=time, y=0.5 * np.exp(-0.1 * time) * np.cos(5.4 * time) + noise)
    return tmp_path


@pytest.mark.parametrize("command", ["loop", pytest.param("run", marks=pytest.mark.slow)])
def test_a_declaration_that_runs_away_is_answered(
    command: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = folder / "runs" / "out"
    out.mkdir(parents=True)
    (out / "manoeuvre_1.csv").write_text("of an earlier answer")
    main([command, str(folder / "rig.toml"), "--train", str(folder / "swing.csv"), "--out", str(out), "--quiet"])
    said = capsys.readouterr().out
    loop = json.loads((out / "loop.json").read_text(encoding="utf-8"))
    assert loop["verdict"] == "unexplained"
    assert loop["effects"] == loop["cautions"] == []
    assert loop["contradiction"] == {"checks": [], "contradictions": []}
    assert loop["failure"]["code"] == "runs_away"
    # The loss turns the sign of a small motion's decay: 1 kg m^2 over 10 N m s.
    assert loop["failure"]["numbers"]["grows_in"] == pytest.approx(0.1, rel=1e-3)
    assert loop["errors"]["before"]["train"]["rms"] == "Infinity"
    assert "failed: the declared system runs away" in said
    assert "remedy: check the signs" in said
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "runs away by itself" in page
    assert "Check the signs" in page
    assert not (out / "manoeuvre_1.csv").exists()
    assert "unexplained" in build_index(out.parent).read_text(encoding="utf-8")
    with pytest.raises(SystemExit) as refused:
        main(["export", str(out), "--out", str(folder / "model")])
    assert refused.value.code == 2
    assert "has no fit" in capsys.readouterr().err
    if command == "run":
        build_report(out)


def test_a_prediction_without_a_model_is_status_3(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    swing, out = str(folder / "swing.csv"), folder / "out"
    with pytest.raises(SystemExit) as failed:
        main(["loop", str(folder / "rig.toml"), "--train", swing, "--predict", swing, "--out", str(out), "--json"])
    assert failed.value.code == 3
    content = json.loads(capsys.readouterr().out)
    assert content["failure"]["code"] == "runs_away"
    assert (out / "loop.json").exists()
    assert not (out / "prediction.csv").exists()


def test_a_motor_with_a_torque_step_is_led_to_its_fit(tmp_path: Path) -> None:
    """The declared damping of a drive is a guess: from there its angle goes a hundred times too far."""
    gain, loss = 1000.0, 20.0
    time = np.arange(600) / 100
    torque = np.where(time > 1, 0.05, 0.0)
    on = np.maximum(time - 1, 0)
    angle = gain * 0.05 / loss * (on - (1 - np.exp(-loss * on)) / loss)
    write(tmp_path / "step.csv", t=time, u=torque, y=angle + np.random.default_rng(2).normal(0, 1e-3, time.size))
    (tmp_path / "rig.toml").write_text(
        'name = "motor"\nkind = "drive"\n[columns]\ntime = { name = "t", unit = "s" }\n'
        'input = { name = "u", unit = "N m", interpolation = "hold" }\n'
        'output = { name = "y", unit = "rad", noise = 1e-3 }\n'
    )
    main(["loop", str(tmp_path / "rig.toml"), "--train", str(tmp_path / "step.csv"), "--out", str(tmp_path), "--quiet"])
    loop = json.loads((tmp_path / "loop.json").read_text(encoding="utf-8"))
    fitted = loop["model"]["before"]["parameters"]
    assert fitted["g"]["value"] / fitted["xi"]["value"] == pytest.approx(gain / loss, rel=0.01)
    assert loop["errors"]["before"]["train"]["rms"] < 2e-3


@pytest.mark.parametrize("code", ["runs_away", "diverges", "unresolved"])
@pytest.mark.parametrize("numbers", [{}, {"time": 0.2, "followed": 0.1}])
def test_every_cause_has_its_words(code: str, numbers: dict[str, float]) -> None:
    failure = {"code": code, "numbers": numbers, "message": ""}
    assert re.fullmatch(r"[a-z].*[^.;,: ]", failure_sentence(failure))
    assert re.fullmatch(r"[a-z].*[^.;,: ]", remedy_sentence(failure))
    assert verdict_sentence({"failure": failure}) == failure_sentence(failure)
    assert ("to the first 0.100 s" in failure_sentence(failure)) == bool(numbers)
