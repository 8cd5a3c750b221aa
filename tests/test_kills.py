"""Commands that are killed: what judges their folders sees each fault, and a share of the kills themselves."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path

import h5py
import pandas as pd
import pytest

from benchmarks.faults.page import put
from benchmarks.kills.__main__ import Row, before, main, table
from benchmarks.kills.content import content, differences, faults, hidden


@pytest.fixture
def results(tmp_path: Path) -> Path:
    """Return a folder with a file of each kind."""
    out = tmp_path / "out"
    (out / "tables").mkdir(parents=True)
    (out / "loop.json").write_text(json.dumps({"created": "2026-01-01T00:00:00+00:00", "value": 0.1}))
    (out / "report.html").write_text("<p>2026-01-01T00:00:00+00:00</p></html>\n")
    pd.DataFrame({"value": [0.1], "seconds": [3.0]}).to_csv(out / "tables" / "a.csv", index=False)
    pd.DataFrame({"value": [0.1], "seconds": [3.0]}).to_parquet(out / "results.parquet")
    with h5py.File(out / "posterior.nc", "w") as file:
        file["x"] = [1.0, 2.0]
    return out


def test_what_the_clock_says_is_no_difference(results: Path) -> None:
    before = content(results)
    assert faults(results) == hidden(results) == []
    (results / "loop.json").write_text(json.dumps({"created": "2027-02-02T02:02:02+00:00", "value": 0.1}))
    (results / "report.html").write_text("<p>2027-02-02T02:02:02+00:00</p></html>\n")
    pd.DataFrame({"value": [0.1], "seconds": [4.0]}).to_csv(results / "tables" / "a.csv", index=False)
    pd.DataFrame({"value": [0.1], "seconds": [4.0]}).to_parquet(results / "results.parquet")
    assert differences(content(results), before) == []


def test_every_other_difference_is_seen(results: Path) -> None:
    before = content(results)
    (results / "loop.json").write_text(json.dumps({"value": 0.1 + 1e-16}))
    pd.DataFrame({"value": [0.10000000000000002]}).to_parquet(results / "results.parquet")
    (results / "posterior.nc").unlink()
    (results / "other.csv").write_text("a\n1\n")
    (results / "loop.json").write_text(json.dumps({"value": 0.2}))
    assert differences(content(results), before) == [
        "loop.json is another", "other.csv is left over", "posterior.nc is missing", "results.parquet is another",
    ]  # fmt: skip


@pytest.mark.parametrize("name", ["loop.json", "report.html", "results.parquet", "posterior.nc"])
def test_a_file_that_is_cut_short_is_seen(name: str, results: Path) -> None:
    data = (results / name).read_bytes()
    (results / name).write_bytes(data[: len(data) // 2])
    (fault,) = faults(results)
    assert fault.startswith(f"{name} is not whole")


def test_what_is_unfinished_and_what_is_mixed_is_seen(results: Path) -> None:
    (results / "tables" / ".discovery-0123abcd-a.csv").write_text("")
    assert hidden(results) == ["tables/.discovery-0123abcd-a.csv"]
    (results / "results.json").write_text(json.dumps({"provenance": {"files": {"posterior.nc": "of another run"}}}))
    assert any("would mix results" in fault for fault in faults(results))


def test_the_table_counts_and_tells() -> None:
    rows = {
        "loop": Row(1.0, Counter(SIGKILL=2, SIGINT=1), trials=1, meetings=3, faults=["loop.json is another"]),
        "run": Row(2.0, Counter(SIGTERM=3), trials=1, meetings=3),
    }
    text = table(rows, [2, 0, 0, 0], 2, [])
    assert "| `loop` | 1.0 | 2 | 0 | 1 | 1 | 3 | 1 |" in text
    assert "| all, 6 kills |  | 2 | 3 | 1 | 2 | 6 | 1 |" in text
    assert "4 fits at once on an empty cache compiled 2, 0, 0, 0 simulators; one alone compiles 2. Faults: 0." in text
    assert text.endswith("- **loop**: loop.json is another\n")


def test_what_was_measured_before_stays_in_the_table(tmp_path: Path) -> None:
    assert before(tmp_path) == ({}, {"compiled": [], "alone": 0, "faults": []})
    row = Row(1.5, Counter(SIGKILL=2), trials=1, meetings=3, faults=["loop.json is another"])
    cache = {"compiled": [2, 0], "alone": 2, "faults": []}
    content = {"loop": {**vars(row), "kills": dict(row.kills)}, "cache": cache}
    (tmp_path / "kills.json").write_text(json.dumps(content))
    assert before(tmp_path) == ({"loop": row}, cache)


def test_a_table_goes_to_its_place(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("# A\n<!-- a: by a -->\nold\n<!-- end of a -->\nmore\n<!-- b: by b -->\n<!-- end of b -->\n")
    put(page, "a", "new\n")
    assert page.read_text() == (
        "# A\n<!-- a: by a -->\nnew\n<!-- end of a -->\nmore\n<!-- b: by b -->\n<!-- end of b -->\n"
    )
    with pytest.raises(ValueError, match="no place for c"):
        put(page, "c", "new")


@pytest.mark.slow
@pytest.mark.parametrize("command", ["loop", "report", "posterior", "campaign", "run"])
def test_a_command_that_was_killed_and_given_again_leaves_what_it_would_have_left(
    command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    status = main([str(tmp_path), "--kills", "3", "--only", command])
    assert status == 0, capsys.readouterr().out
    kills = json.loads((tmp_path / "kills.json").read_text())[command]["kills"]
    assert sum(kills.values()) >= 3


@pytest.mark.slow
def test_four_processes_on_an_empty_cache_compile_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([str(tmp_path), "--only", "cache"]) == 0, capsys.readouterr().out
