from __future__ import annotations

from functools import cache
from pathlib import Path

import pytest
import synthetic_run

from discovery.cli.say import doubts
from discovery.recordings.dataset import load_dataset
from discovery.report import build_report
from discovery.report.doubt_sentences import stand_in_sentence
from discovery.results.provenance import plain, write_json
from discovery.runs.loop import close_loop
from discovery.runs.loop_result import LoopResult

ARM = Path(__file__).parents[1] / "datasets" / "arm"


@cache
def with_length(line: str, folder: Path) -> tuple[LoopResult, list[str]]:
    """Close the loop on the clean arm, 1 m long, with a rig file that says something else; return the doubts, too."""
    rig = folder / "rig.toml"
    rig.write_text((ARM / "rig.toml").read_text(encoding="utf-8").replace("length_m = 1.0\n", line), encoding="utf-8")
    data = load_dataset(rig, [ARM / "train_large.csv"])
    result = close_loop(data.train, data.holdout)
    return result, doubts(result, data)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("rig")


@pytest.mark.slow
def test_a_scale_that_the_rig_s_length_covers_is_named_with_that_doubt(folder: Path) -> None:
    result, said = with_length("length_m = 1.001\n", folder)
    assert result.added[-1] == "position_scale"
    other = result.stand_ins["position_scale"]
    assert other.value == pytest.approx(1.0, abs=5e-5)
    assert other.z == pytest.approx(-1.0, abs=0.05)
    assert other.doubtful
    assert said == [stand_in_sentence("position_scale", other.summary())]
    assert "a length of 1.0000 m in place of 1.0010 +- 0.0010 m" in said[0]
    assert "measure the length" in said[0]
    effect = result.summary()["effects"][-1]
    # The recordings know the scale to a hundred thousandth, the rig file the length to a thousandth.
    assert result.after.sd["s"] < 3e-5
    assert effect["parameters"]["s"]["sd"] == pytest.approx(1e-3, rel=0.01)
    assert plain(effect["stands_for"])["quantity"] == "length"


@pytest.mark.slow
def test_a_scale_beyond_the_rig_s_length_is_doubted_less(folder: Path) -> None:
    result, said = with_length("length_m = { value = 1.001, sd = 0.0002 }\n", folder)
    assert result.added[-1] == "position_scale"
    other = result.stand_ins["position_scale"]
    assert other.z == pytest.approx(-5.0, abs=0.3)
    assert not other.doubtful
    assert said == [stand_in_sentence("position_scale", other.summary())]
    assert "5 standard deviations off: is that excluded?" in said[0]
    assert result.summary()["effects"][-1]["parameters"]["s"]["sd"] == pytest.approx(2e-4, rel=0.05)


@pytest.mark.slow
def test_a_length_without_error_leaves_the_scale_as_it_was_found(folder: Path) -> None:
    result, said = with_length("length_m = { value = 1.001, sd = 0.0 }\n", folder)
    assert result.stand_ins == {}
    assert said == []
    effect = result.summary()["effects"][-1]
    assert "stands_for" not in effect
    assert effect["parameters"]["s"]["sd"] == result.after.sd["s"]


@pytest.mark.usefixtures("undrawn")
def test_the_report_says_what_an_effect_may_stand_for(tmp_path: Path) -> None:
    results = synthetic_run.write_arm_run(tmp_path)
    other = {"quantity": "length", "unit": "m", "value": 1.0, "stated": 1.01, "sd": 0.01, "z": -1.0, "doubtful": True}
    results["loop"]["effects"][-1]["stands_for"] = other
    write_json(tmp_path / "results.json", results)
    assert "A length of 1.000 m in place of 1.010" in build_report(tmp_path).read_text(encoding="utf-8")
    del results["loop"]["effects"][-1]["stands_for"]
    write_json(tmp_path / "results.json", results)
    assert "would do the same" not in build_report(tmp_path).read_text(encoding="utf-8")
