"""The study of a controller in a loop with the twin, at a small size."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import synthetic_run

from benchmarks.closed_loop import study
from benchmarks.closed_loop.__main__ import main
from benchmarks.closed_loop.page import markdown
from benchmarks.dashboard.page import build_index
from discovery.equations.model import Model
from discovery.export import FittedModel
from discovery.report.numbers import significant
from discovery.results.provenance import write_json

MODEL = Model("constant_radius", ("viscous_damping", "linear_stiffness"))
FOUND = FittedModel(MODEL, {"length": 1.0, "xi": 0.0459, "alpha": 8.1})


@pytest.mark.parametrize("price", [1e-2, 1e-4])
def test_the_controller_is_stable_on_its_own_model(price: float) -> None:
    made = study.design(FOUND, price)
    n = made.a.shape[0]
    corrected = made.observe @ made.c @ made.a
    loop = np.block([
        [made.a, -made.b @ made.gain],
        [corrected, made.a - made.b @ made.gain - corrected],
    ])  # fmt: skip
    assert np.abs(np.linalg.eigvals(loop)).max() < 1
    assert made.gain.shape == (1, n)


def test_the_motion_holds_its_acceleration() -> None:
    pushes = [0.0, 3.0, -1.0, 2.0]
    move = study.motion(pushes)
    time = (np.arange(4) + 0.5) * study.SAMPLE
    angle, rate, acceleration = move(time)
    np.testing.assert_array_equal(acceleration, pushes)
    h = 1e-6
    np.testing.assert_allclose((move(time + h)[0] - move(time - h)[0]) / (2 * h), rate, atol=1e-8)
    for kink in move.kinks:
        np.testing.assert_allclose(move(np.array([kink - 1e-12]))[0], move(np.array([kink]))[0], atol=1e-11)
    assert angle[0] == -study.TURN


@pytest.mark.slow
def test_the_study_writes_its_pages(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    reports, page = tmp_path / "reports", tmp_path / "docs" / "page.md"
    (reports / "arm_delay").mkdir(parents=True)
    (tmp_path / "docs" / "images").mkdir(parents=True)
    models = {what: FOUND.to_dict() for what in ("before", "after")}
    (reports / "arm_delay" / "loop.json").write_text(json.dumps({"models": models}))
    page.write_text("before\n<!-- table: written by a -->\nold\n<!-- end of table -->\nafter\n")
    for name, value in {"LENGTH": 1.6, "PRICES": (1e-3,), "SEEDS": (1,)}.items():
        monkeypatch.setattr(study, name, value)
    folder = reports / "closed_loop"
    main([str(reports), str(folder), "--workers", "1", "--page", str(page)])
    rows = json.loads((folder / "controllers.json").read_text())["rows"]
    # The same model twice is the same controller.
    assert {**rows[0], "model": ""} == {**rows[1], "model": ""}
    assert 0 < rows[0]["tip_error_mm"] < 1e3 * study.TURN
    text = page.read_text()
    assert "old" not in text
    assert text.startswith("before\n")
    assert text.endswith("after\n")
    assert f"| 0.001 | {significant(rows[0]['tip_error_mm'])} → " in text
    assert (tmp_path / "docs" / "images" / "closed_loop.svg").stat().st_size < 200_000
    told = (folder / "report.html").read_text()
    tip = significant(rows[0]["tip_error_mm"])
    assert f"falls from {tip} to {tip} mm" in told
    assert told.count("<figure") == 1
    assert len(pd.read_csv(folder / "tables" / "controllers.csv")) == 2
    # Without --again the pages are of the results that are there.
    monkeypatch.setattr(study, "PRICES", ())
    main([str(reports), str(folder)])
    assert json.loads((folder / "controllers.json").read_text())["rows"] == rows


def test_a_loop_that_is_unstable_is_told() -> None:
    rows = study.compare(Path("nowhere"))
    assert {row["model"] for row in rows} == {"before", "after"}
    assert all("no folder" in row["failure"] for row in rows)
    assert markdown(rows).splitlines()[-1] == "| 1e-06 | unstable | unstable | unstable | unstable |"


def test_the_page_over_all_runs_leads_to_the_controllers(tmp_path: Path) -> None:
    synthetic_run.write_oscillator_run(tmp_path / "whole")
    link = 'href="closed_loop/report.html"'
    assert link not in build_index(tmp_path).read_text(encoding="utf-8")
    (tmp_path / "closed_loop").mkdir()
    (tmp_path / "closed_loop" / "report.html").touch()
    write_json(tmp_path / "closed_loop" / "controllers.json", {"rows": []})
    assert build_index(tmp_path).read_text(encoding="utf-8").count(link) == 2
