"""The page on systems of one's own: its blocks are run from first to last, and what it quotes is what comes out."""

from __future__ import annotations

import json
import re
import runpy
from pathlib import Path

import numpy as np
import pytest
from worked_page import work_through

from discovery.cli import main
from discovery.declarations.formula import FUNCTIONS
from discovery.rigs.rig_system import ready_made
from discovery.rigs.system_table import SystemTable

PAGE = Path(__file__).parents[1] / "docs" / "YOUR_SYSTEM.md"
TEXT = PAGE.read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder in which the whole page was worked through."""
    place = tmp_path_factory.mktemp("system")
    work_through(TEXT, PAGE.name, place)
    return place


@pytest.mark.slow
def test_the_friction_is_found_where_it_is(folder: Path) -> None:
    found = json.loads((folder / "first" / "loop.json").read_text(encoding="utf-8"))
    assert [e["id"] for e in found["effects"]] == ["coulomb_friction_at_load"]
    friction = found["effects"][0]["parameters"]["f_c_load"]
    assert abs(friction["value"] - 0.006) < 0.01 * 0.006
    assert friction["unit"] == "N m"
    fitted = found["model"]["after"]["parameters"]
    for name, true in {"load_inertia": 4e-3, "stiffness": 2.0, "shaft_loss": 2e-3, "bearing_loss": 0.01}.items():
        assert abs(fitted[name]["value"] - true) < 4 * fitted[name]["sd"] + 0.01 * true
    assert found["errors"]["after"]["holdout"]["rms"] < 1.06 * 2e-4
    assert not (folder / "wrong").exists()


@pytest.mark.slow
def test_the_model_is_taken_along(folder: Path) -> None:
    main(["export", str(folder / "first"), "--out", str(folder / "model")])
    exported = runpy.run_path(str(folder / "model" / "model.py"))
    time, torque, load = np.loadtxt(folder / "two.csv", delimiter=",", skiprows=1).T
    assert np.sqrt(np.mean((1e3 * np.ravel(exported["simulate"](time, torque, 0.0, 0.0)) - load) ** 2)) < 0.5
    written = (folder / "model" / "model.tex").read_text(encoding="utf-8")
    assert r"\mathrm{shaft} = - \mathrm{load} + \mathrm{motor}" in written
    assert "\\mathrm{q}" not in written


@pytest.mark.slow
def test_the_page_of_a_run_has_its_equations(folder: Path) -> None:
    page = (folder / "first" / "report.html").read_text(encoding="utf-8")
    for words in ("Kinetic energy", "Generalised force on motor", "Place shaft", "Dry friction of constant size"):
        assert words in page


def test_the_page_names_every_key_function_and_ready_made_system() -> None:
    keys = {k for row in re.findall(r"^\| (`.*?) \|", TEXT, re.MULTILINE) for k in re.findall(r"`(\w+)`", row)}
    assert keys == set(SystemTable.model_fields) - {"constants"}
    assert not [n for n in (*FUNCTIONS, *ready_made(), "abs", "sqrt", "atan2") if f"`{n}`" not in TEXT]
