"""The study of a controller in a loop with the twin, at a small size."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from benchmarks import closed_loop
from discovery.equations.model import Model
from discovery.export import FittedModel

MODEL = Model("constant_radius", ("viscous_damping", "linear_stiffness"))
FOUND = FittedModel(MODEL, {"length": 1.0, "xi": 0.0459, "alpha": 8.1})


@pytest.mark.parametrize("price", [1e-2, 1e-4])
def test_the_controller_is_stable_on_its_own_model(price: float) -> None:
    made = closed_loop.design(FOUND, price)
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
    move = closed_loop.motion(pushes)
    time = (np.arange(4) + 0.5) * closed_loop.SAMPLE
    angle, rate, acceleration = move(time)
    np.testing.assert_array_equal(acceleration, pushes)
    h = 1e-6
    np.testing.assert_allclose((move(time + h)[0] - move(time - h)[0]) / (2 * h), rate, atol=1e-8)
    for kink in move.kinks:
        np.testing.assert_allclose(move(np.array([kink - 1e-12]))[0], move(np.array([kink]))[0], atol=1e-11)
    assert angle[0] == -closed_loop.TURN


def test_the_study_writes_its_table_and_figure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    reports, page = tmp_path / "reports", tmp_path / "docs" / "page.md"
    (reports / "arm_delay").mkdir(parents=True)
    (tmp_path / "docs" / "images").mkdir(parents=True)
    models = {what: FOUND.to_dict() for what in ("before", "after")}
    (reports / "arm_delay" / "loop.json").write_text(json.dumps({"models": models}))
    page.write_text(f"before\n{closed_loop.BEGIN}\nold\n{closed_loop.END}\nafter\n")
    for name, value in {"LENGTH": 1.6, "PRICES": (1e-3,), "SEEDS": (1,)}.items():
        monkeypatch.setattr(closed_loop, name, value)
    closed_loop.main(reports, tmp_path / "out", page)
    rows = json.loads((tmp_path / "out" / "results.json").read_text())["rows"]
    # The same model twice is the same controller.
    assert {**rows[0], "model": ""} == {**rows[1], "model": ""}
    assert 0 < rows[0]["tip_error_mm"] < 1e3 * closed_loop.TURN
    text = page.read_text()
    assert "old" not in text
    assert text.startswith("before\n")
    assert text.endswith("after\n")
    assert f"| 0.001 | {rows[0]['tip_error_mm']:.4g} → " in text
    assert (tmp_path / "docs" / "images" / "closed_loop.svg").stat().st_size < 200_000
