"""The corpus of bad input and faults: no case ends as none may; what judges them sees each of these ends."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from benchmarks.faults.__main__ import table
from benchmarks.faults.case import OUTCOMES, Case, Outcome, judged, run
from benchmarks.faults.corpus import corpus
from discovery.runs.processes import time_limit

CASES = corpus()
#: Seconds after which a case hangs.
LIMIT = 60.0
#: Families that are refused before anything is fitted: from which of their cases on, every so many of them are quick.
QUICK = {
    "cell": (0, 32), "empty time": (0, 14), "file": (0, 3), "table": (0, 5), "time": (0, 5),
    "rig file, misspelt key": (0, 4), "rig file, odd value": (4, 34), "rig file, part": (0, 8),
    "rig file, whole": (0, 3), "arguments": (0, 5), "results": (0, 8),
}  # fmt: skip


def _quick() -> set[str]:
    """Return the ids of cases for `make test`."""
    found: set[str] = set()
    for family, (first, every) in QUICK.items():
        found.update([case.id for case in CASES.values() if case.family == family][first::every])
    return found


IN_TEST = _quick()


@pytest.mark.parametrize(
    "name", [name if name in IN_TEST else pytest.param(name, marks=pytest.mark.slow) for name in CASES]
)
def test_no_case_ends_as_none_may(name: str, tmp_path: Path) -> None:
    with time_limit(LIMIT):
        outcome = run(CASES[name], tmp_path)
    assert OUTCOMES[outcome.outcome], outcome
    assert not (tmp_path / "pwned").exists()


def test_the_corpus_is_large() -> None:
    assert len(CASES) >= 400
    assert {case.family for case in CASES.values()} >= set(QUICK)


EDITS = st.lists(st.tuples(st.integers(0, 10_000), st.integers(0, 40), st.binary(max_size=12)), min_size=1, max_size=4)


def _edited(file: str, edits: list[tuple[int, int, bytes]], folder: Path) -> list[str]:
    content = (folder / file).read_bytes()
    for place, length, new in edits:
        at = place % len(content)
        content = content[:at] + new + content[at + length :]
    (folder / file).write_bytes(content or b"\n")
    # What is refused is refused here too, and what is read is not worth a loop.
    return ["fit", "rig.toml", "--out", "out"]


@pytest.mark.parametrize("file", ["rig.toml", "high.csv"])
@settings(max_examples=5, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(edits=EDITS)
def test_bytes_changed_anywhere_are_refused_or_read(
    file: str, edits: list[tuple[int, int, bytes]], tmp_path_factory: pytest.TempPathFactory
) -> None:
    case = Case("bytes", file, lambda folder: _edited(file, edits, folder))
    with time_limit(LIMIT):
        outcome = run(case, tmp_path_factory.mktemp("case"))
    assert outcome.outcome in ("refused", "right"), outcome


@pytest.mark.slow
@pytest.mark.parametrize("file", ["rig.toml", "high.csv"])
@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(edits=EDITS)
def test_many_bytes_changed_anywhere_are_refused_or_read(
    file: str, edits: list[tuple[int, int, bytes]], tmp_path_factory: pytest.TempPathFactory
) -> None:
    case = Case("bytes", file, lambda folder: _edited(file, edits, folder))
    with time_limit(LIMIT):
        outcome = run(case, tmp_path_factory.mktemp("case"))
    assert outcome.outcome in ("refused", "right"), outcome


def answer(verdict: str, *effects: str, value: float = 0.0425) -> dict:
    return {
        "verdict": verdict,
        "effects": [{"id": effect, "parameters": {"c_2": {"value": value, "sd": 1e-3}}} for effect in effects],
    }


@pytest.mark.parametrize(
    ("status", "err", "found", "outcome"),
    [
        (0, "fitting\n", answer("explained", "quadratic_drag"), "right"),
        (0, "fitting\na.csv: gaps\n", answer("explained", "quadratic_drag"), "warned, right"),
        (0, "", answer("explained", "quadratic_drag", value=0.06), "wrong"),
        (0, "", answer("explained", "quadratic_drag", "cubic_stiffness"), "wrong"),
        (0, "a.csv: spikes\n", answer("explained", "cubic_stiffness"), "warned, not right"),
        (0, "", answer("unexplained"), "unexplained, no cause"),
        (0, "a.csv: spikes\n", answer("unexplained"), "unexplained, cause told"),
        (2, "discovery: a.csv, row 3: no number. Write one.\n", None, "refused"),
        (2, "discovery: row 3: no number. Write one.\n", None, "poorly refused"),
        (2, "discovery: a.csv, row 3: it is bad.\n", None, "poorly refused"),
        (2, "", None, "poorly refused"),
        (1, "", None, "traceback"),
        (2, "Traceback (most recent call last)\n", None, "traceback"),
    ],
)
def test_each_end_is_seen(status: int, err: str, found: dict | None, outcome: str) -> None:
    assert judged(status, "", err, found, ("a.csv",)).outcome == outcome


def test_the_command_runs_its_cases_in_processes_of_its_own(tmp_path: Path) -> None:
    # As a user starts it: what a package's __main__ defines is not found by the processes that it starts.
    command = [sys.executable, "-m", "benchmarks.faults", str(tmp_path), "--only", "arguments: no such command"]
    run = subprocess.run(command, cwd=Path(__file__).parents[1], capture_output=True, text=True)
    assert run.returncode == 0, run.stdout + run.stderr
    (outcome,) = json.loads((tmp_path / "faults.json").read_text()).values()
    assert outcome["outcome"] == "refused"
    assert 0.0 < outcome["seconds"] < LIMIT


def test_the_table_counts_every_family_and_tells_what_may_not_be() -> None:
    lines = table(
        {"cell: a": Outcome("refused", 2, "x"), "cell: b": Outcome("wrong", 0, "y"), "time: a": Outcome("hang", -1, "")}
    ).splitlines()
    assert lines[0].split(" | ")[1:3] == ["attempted", "refused"]
    counts = {line.split("|")[1].strip(): [int(n) for n in line.split("|")[2:-1]] for line in lines[2:5]}
    order = ["attempted", *OUTCOMES]
    assert {name: counts["all"][order.index(name)] for name in ("attempted", "refused", "wrong", "hang")} == {
        "attempted": 3, "refused": 1, "wrong": 1, "hang": 1,
    }  # fmt: skip
    assert counts["cell"][0] == 2
    assert lines[-2:] == ["- **wrong**, cell: b: y", "- **hang**, time: a: "]
