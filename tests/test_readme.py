"""The README: its session is true, its table is in shape, the public names that it uses exist."""

from __future__ import annotations

import ast
import doctest
import json
import pkgutil
import re
import runpy
from pathlib import Path

import pytest
from worked_page import agree, run

import discovery

ROOT = Path(__file__).parents[1]
README = ROOT / "README.md"
SCRIPT = runpy.run_path(str(ROOT / "docs" / "results_table.py"))


@pytest.mark.slow
def test_the_session_is_true(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    results = doctest.testfile(str(README), module_relative=False)
    assert results.attempted >= 5
    assert results.failed == 0


def pasted() -> list[tuple[str, str]]:
    """Return the commands to paste of the page, and what is quoted after each."""
    text = README.read_text(encoding="utf-8")
    return re.findall(r"^```\n\.venv/bin/(discovery .*?)```\n\n```\n(.*?)```$", text, re.MULTILINE | re.DOTALL)


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize("place", ["build/spring_bench", pytest.param("build/arm_delay", marks=pytest.mark.slow)])
def test_a_command_to_paste_prints_what_is_quoted(place: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    ((command, quoted),) = [(command, quoted) for command, quoted in pasted() if place in command]
    monkeypatch.chdir(ROOT)
    # What is run goes elsewhere; the page says where it went.
    printed = run(command.replace("\\\n", "").replace(place, str(tmp_path)))
    assert agree(quoted, printed.replace(str(tmp_path), place)), printed


def test_every_command_to_paste_is_run() -> None:
    assert len(pasted()) == README.read_text(encoding="utf-8").count("\n.venv/bin/discovery ") == 2


def test_every_environment_variable_is_explained() -> None:
    sources = [*(ROOT / "discovery").rglob("*.py"), *(ROOT / "datasets").rglob("*.py"), *(ROOT / "tests").glob("*.py")]
    read = {name for path in sources for name in re.findall(r"DISCOVERY_[A-Z]+", path.read_text(encoding="utf-8"))}
    page = (ROOT / "docs" / "COMMAND_LINE.md").read_text(encoding="utf-8")
    shown = re.findall(r"^\| `(DISCOVERY_[A-Z]+)` \|", page, re.MULTILINE)
    assert len(shown) == len(set(shown))
    # A constant of `discovery.runs.stages`, and what shells ask the library of the command line with.
    assert set(shown) == read - {"DISCOVERY_SAMPLES", "DISCOVERY_COMPLETE"}


def test_it_is_said_plainly_what_is_simulated_and_what_is_measured() -> None:
    text = " ".join(README.read_text(encoding="utf-8").split())
    assert "All results on the arm are on a simulated twin" in text
    assert "The real measurements are other systems" in text


def test_the_table_names_every_set_of_recordings() -> None:
    text = README.read_text(encoding="utf-8")
    table = text.partition(SCRIPT["BEGIN"])[2].partition(SCRIPT["END"])[0]
    assert [line.split("|")[1].strip(" `") for line in table.splitlines() if line.startswith("| `")] == [
        *SCRIPT["HIDDEN"]
    ]


def test_the_table_is_made_from_result_files(tmp_path: Path) -> None:
    errors = {"rms": 2e-3, "mean": 1e-3, "peak": 4e-3}
    found = {
        "verdict": "explained",
        "effects": [
            {"id": "radius_inertia", "parameters": {}},
            {"id": "sensor_delay", "parameters": {"tau": {"value": 0.01, "sd": 2e-5, "unit": "s"}}},
        ],
        "errors": {"unit": "m", "before": {"holdout": errors}, "after": {"holdout": {**errors, "mean": 4e-4}}},
    }
    (tmp_path / "arm_delay").mkdir()
    (tmp_path / "arm_delay" / "loop.json").write_text(json.dumps(found))
    rows = SCRIPT["table"](tmp_path).splitlines()
    assert len(rows) == 3
    assert rows[2].startswith("| `arm_delay` | a camera 10 ms late | explained | `radius_inertia`, `sensor_delay` ")
    assert "(tau = 0.010000 ± 0.000020 s) | 1.00 → 0.400 mm mean |" in rows[2]
    # A run that is not at hand keeps its row.
    kept = SCRIPT["table"](tmp_path, "| `arm` | as it was |\n| `arm_delay` | old |").splitlines()
    assert kept == [*rows[:2], "| `arm` | as it was |", rows[2]]
    page = f"before\n{SCRIPT['BEGIN']}\nold\n{SCRIPT['END']}\nafter\n"
    new = SCRIPT["insert"](page, "new")
    assert new == page.replace("old", "new")


def test_public_names_are_there_and_load_lazily() -> None:
    assert len(discovery.__all__) == len(set(discovery.__all__)) >= 25
    for name in discovery.__all__:
        assert getattr(discovery, name).__name__
        assert name in dir(discovery)
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = discovery.nothing  # type: ignore[attr-defined]


def test_type_checkers_see_what_is_loaded() -> None:
    tree = ast.parse(Path(discovery.__file__).read_text(encoding="utf-8"))
    seen = {
        alias.asname: f"{node.module}:{alias.name}"
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("discovery.")
        for alias in node.names
        if alias.asname
    }
    assert seen == discovery._HOMES
    assert sorted(seen) == sorted(discovery.__all__)


def test_no_public_name_hides_a_module() -> None:
    modules = {m.name for m in pkgutil.iter_modules(discovery.__path__)}
    assert modules.isdisjoint(discovery.__all__)
