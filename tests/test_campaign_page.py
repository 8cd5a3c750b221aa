"""The page of a campaign and the parameters pooled for it: what is shown, what is linked, and odd names."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from markupsafe import escape
from test_security import HOSTILE, harmless

from discovery.report.campaign import build_campaign
from discovery.runs.campaign import pooled_parameters


def outcome(name: str, value: float = 1.0, **other: Any) -> dict[str, Any]:
    """Return what the campaign keeps of a case."""
    parameters = [
        {"parameter": "c_2", "effect": "quadratic_drag", "value": value, "sd": 0.1, "unit": "q^-1"},
        {"parameter": "rate_0_init[a]", "effect": "", "value": 1.0, "sd": 0.1, "unit": "rad"},
        {"parameter": "xi", "effect": "", "value": 1.0, "sd": None, "unit": "s^-1"},
    ]
    errors = {f"{role}_rms_{when}": size for when, size in (("before", 0.02), ("after", 4e-3 * value))
              for role in ("train", "holdout")}  # fmt: skip
    return {
        "name": name, "seconds": 1.0, "error": "", "verdict": "explained", "effects": "quadratic_drag, sensor_delay",
        "because": "the model error falls", "unit": "rad", "kind": "pendulum", "coordinate_unit": "rad",
        "noise_floor": 2e-3, "parameters": parameters, **errors, **other,
    }  # fmt: skip


def failed(name: str) -> dict[str, Any]:
    return {"name": name, "seconds": 1.0, "error": f"InputError: {name} cannot be read"}


def test_parameters_are_pooled_over_systems_of_one_kind_and_unit() -> None:
    rows = [outcome(f"p{i}", 1.0 + 0.01 * i) for i in range(4)]
    rows += [outcome(f"o{i}", kind="oscillator", coordinate_unit="m") for i in range(3)]
    rows += [outcome("mm", coordinate_unit="mm"), failed("bad"), {"name": "old", "seconds": 1.0, "error": ""}]
    first, second = pooled_parameters(rows)
    assert (first["parameter"], first["kind"], first["unit"], first["effect"]) == (
        "c_2", "pendulum", "rad^-1", "quadratic_drag",
    )  # fmt: skip
    assert [case["name"] for case in first["cases"]] == ["p0", "p1", "p2", "p3"]
    assert first["mean"]["low"] < 1.015 < first["mean"]["high"]
    assert (second["kind"], second["unit"], len(second["cases"])) == ("oscillator", "m^-1", 3)
    assert pooled_parameters(rows[:2]) == []


def test_the_page_shows_every_case_and_links_those_that_have_a_page(tmp_path: Path) -> None:
    rows = [*(outcome(name, 1.0 + i) for i, name in enumerate("abc")), failed("bad")]
    (tmp_path / "b").mkdir()
    (tmp_path / "b" / "report.html").touch()
    page = build_campaign(tmp_path, rows, pooled_parameters(rows)).read_text(encoding="utf-8")
    assert "Of 4 cases: 3 explained and 1 failed. Added most often: quadratic drag (3) and sensor delay (3)." in page
    assert page.count('href="b/report.html"') == 2
    assert 'href="a/report.html"' not in page
    assert page.count("<figure") == 1
    matrix = pd.read_csv(tmp_path / "tables" / "matrix.csv").set_index("case")
    assert matrix["quadratic_drag"].tolist() == [1, 1, 1, 0]
    worst = pd.read_csv(tmp_path / "tables" / "worst.csv")
    assert worst["case"].tolist() == ["c", "b", "a"]
    assert worst["after_over_floor"].tolist() == pytest.approx([6.0, 4.0, 2.0])
    assert len(pd.read_csv(tmp_path / "tables" / "pooled.csv")) == 1


@pytest.mark.parametrize(
    ("dashboard", "linked"),
    [
        ("http://127.0.0.1:8787/status", True),
        ("", False),
        ("javascript:alert(1)", False),
        ('http://a/"><script>', True),
    ],
)
def test_the_dashboard_of_the_cluster_is_linked(dashboard: str, linked: bool, tmp_path: Path) -> None:
    page = build_campaign(tmp_path, [outcome("a")], [], dashboard).read_text(encoding="utf-8")
    assert (f'href="{escape(dashboard)}"' in page) == linked
    assert "<script" not in page
    assert "javascript:" not in page


def test_no_name_of_a_case_is_markup_or_code(tmp_path: Path) -> None:
    rows = [*(outcome(f"{name}{i}") for i, name in enumerate(HOSTILE)), *map(failed, HOSTILE)]
    page = harmless(build_campaign(tmp_path, rows, pooled_parameters(rows)).read_text(encoding="utf-8"))
    words = " ".join(" ".join(page.words).split())
    assert all(" ".join(name.split()) in words for name in HOSTILE)


def test_what_was_kept_by_an_earlier_version_is_shown(tmp_path: Path) -> None:
    rows = [{"name": "old", "seconds": 1.0, "error": "", "verdict": "unexplained", "effects": ""}]
    page = build_campaign(tmp_path, rows, []).read_text(encoding="utf-8")
    assert "Of 1 case: 1 unexplained. Nothing was added to any." in page
