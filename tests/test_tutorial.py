"""The tutorial: its blocks are run from first to last, and what it quotes is what comes out."""

from __future__ import annotations

import html
import json
import re
import tomllib
from pathlib import Path

import pytest
from worked_page import agree, work_through

from discovery.declarations.registry import catalogue
from discovery.rigs.kinds import KINDS
from discovery.selection.verdict import VERDICTS

PAGE = Path(__file__).parents[1] / "docs" / "YOUR_RECORDING.md"
TEXT = PAGE.read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder in which the whole page was worked through."""
    place = tmp_path_factory.mktemp("tutorial")
    blocks = re.findall(r"^```(\w*)\n(.*?)^```$", TEXT, re.MULTILINE | re.DOTALL)
    assert {language for language, _ in blocks} == {"python", "toml", "console"}
    work_through(TEXT, PAGE.name, place)
    return place


@pytest.mark.slow
def test_every_block_does_what_the_page_says(folder: Path) -> None:
    for name in ("first", "report", "swing"):
        assert (folder / name / "loop.json").exists()
    assert not (folder / "wrong").exists()


@pytest.mark.slow
def test_the_rig_file_has_ten_lines(folder: Path) -> None:
    lines = [line for line in (folder / "rig.toml").read_text().splitlines() if line and line[0] != "#"]
    assert len(lines) <= 10
    assert tomllib.loads("\n".join(lines))["kind"] == "pendulum"


@pytest.mark.slow
def test_the_report_says_what_is_quoted_and_has_the_sections(folder: Path) -> None:
    page = (folder / "report" / "report.html").read_text(encoding="utf-8")
    words = " ".join(html.unescape(re.sub(r"<[^>]+>", " ", page)).split())
    quoted = " ".join(re.findall(r"^> (.*)", TEXT, re.MULTILINE))
    found = re.search(r"Explained: .*?\(noise floor .*?\)\.", words)
    assert found
    assert agree(quoted, found[0].replace(" ;", ";")), found[0]
    table = TEXT.partition("| section |")[2].partition("\n\n")[0]
    sections = [line.split("|")[1].strip() for line in table.splitlines()[2:]]
    linked = re.findall(r'<a href="#[^"]*">([^<]*)</a>', page)
    assert len(sections) > 5
    assert not set(sections) - set(linked)


@pytest.mark.slow
def test_sparse_regression_finds_what_the_page_says(folder: Path) -> None:
    terms = json.loads((folder / "report" / "results.json").read_text(encoding="utf-8"))["discovery"]["terms"]
    assert {"quadratic_drag", "linear_stiffness", "cubic_stiffness"} <= {term["effect"] for term in terms}


def test_the_table_of_kinds_is_that_of_the_package() -> None:
    rows = [[cell.strip() for cell in line.split("|")[1:5]] for line in TEXT.splitlines() if line.startswith("| `")]
    shown = {row[0].strip("`"): row[1:] for row in rows if row[0].strip("`") in KINDS}
    assert list(shown) == list(KINDS)
    for name, kind in KINDS.items():
        given = kind.input + (", or none" if kind.needs_input is None else "")
        declared = ", ".join(f"`{effect}`" for effect in kind.declared) or "none"
        signals = [given, kind.output]
        if "inverse_dynamics" in kind.searched:
            signals = [f"{given}; with `[view]` {kind.output}", f"{kind.output}; with `[view]` {kind.input}"]
        assert shown[name] == [*signals, declared]


def test_the_verdicts_and_effects_are_known() -> None:
    source = (PAGE.parents[1] / "docs" / "ATTRIBUTION.md").read_text(encoding="utf-8")
    verdicts = set(re.findall(r"^\| `(\w+)`", TEXT.partition("## 6.")[2].partition("## 7.")[0], re.MULTILINE))
    assert verdicts == set(VERDICTS)
    assert all(f"| `{verdict}` |" in source for verdict in verdicts)
    assert {"quadratic_drag", "periodic_disturbance", "viscous_damping", "gravity_torque"} <= set(catalogue())


@pytest.mark.parametrize(
    ("quoted", "printed", "same"),
    [
        ("rms 0.0133 rad", "rms 0.0133 rad", True),
        ("rms 0.0133 rad", "rms 0.0134 rad", True),
        ("rms 0.0133 rad", "rms 0.0135 rad", False),
        ("c_2 = 0.0430922", "c_2 = 0.0431001", True),
        ("c_2 = 0.0430922", "c_2 = 0.0432", False),
        ("v_c = (5.74 +- 0.79)e-4 m", "v_c = (5.78 +- 0.79)e-4 m", True),
        ("v_c = (5.74 +- 0.09)e-4 m", "v_c = (5.78 +- 0.09)e-4 m", False),
        ("30 samples", "31 samples", False),
        ("rms 0.0133 rad", "rms 0.0133 mrad", False),
        ("added: drag", "added: drag; as well explained by tilt", False),
    ],
)
def test_numbers_may_differ_in_their_last_digit_alone(quoted: str, printed: str, same: bool) -> None:
    assert agree(quoted, printed) is same
