"""A case of the corpus, and what became of it."""

from __future__ import annotations

import io
import json
import os
import re
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from warnings import catch_warnings, simplefilter

from benchmarks.faults.base import DRAG, write

#: Every outcome, with whether it may be.
OUTCOMES = {
    "refused": True,
    "right": True,
    "warned, right": True,
    "warned, not right": True,
    "unexplained, cause told": True,
    "unexplained, no cause": False,
    "wrong": False,
    "poorly refused": False,
    "traceback": False,
    "hang": False,
}
#: Standard deviations, and part of the truth, within which the drag counts as found.
_SDS, _PART = 5.0, 0.05
#: What a refusal tells to do.
_REMEDY = re.compile(
    r"\b(write|give|help|correct|remove|leave|export|record|rename|add|use|choose|state|declare|check|name|make|keep|cut|"
    r"sort|set|put|fill|widen|read|run|did you mean|see|try|must be|needed|select|convert|save|repair|is not known)\b",
    re.IGNORECASE,
)
#: Lines that tell how far a command is.
_PROGRESS = re.compile(
    r"^(refitting|compiling|screening|comparing|writing|designing|searching|reconstructing|separating|reading|taking|"
    r"looking|fitting|adding|checking|testing|trying|weighing|going)\b|^$"
)


@dataclass(frozen=True)
class Case:
    """One change of the sound case.

    Parameters
    ----------
    family, name : str
        What kind of fault it is, and which.
    prepare : callable
        Changes a folder that holds the sound case, and may return the arguments of the command; else they are those
        of `discovery loop`.
    place : tuple of str
        What a refusal must name.
    environment : mapping of str to str
        Variables that are set.
    """

    family: str
    name: str
    prepare: Callable[[Path], list[str] | None]
    place: tuple[str, ...] = ()
    environment: dict[str, str] = field(default_factory=dict)

    @property
    def id(self) -> str:
        """Family and name."""
        return f"{self.family}: {self.name}"


@dataclass(frozen=True)
class Outcome:
    """What became of a case: one of `OUTCOMES`, exit status, what was said, and the processor's time [s]."""

    outcome: str
    status: int
    said: str
    seconds: float = 0.0


def judged(status: int, out: str, err: str, answer: dict[str, Any] | None, place: tuple[str, ...]) -> Outcome:
    """Return what a command that ended did with a case.

    Parameters
    ----------
    status : int
        Exit status.
    out, err : str
        What was printed.
    answer : dict or None
        The content of ``loop.json``.
    place : tuple of str
        What a refusal must name.
    """
    refusals = [line for line in err.splitlines() if line.startswith(("discovery: ", "Error: "))]
    told = [line for line in err.splitlines() if not _PROGRESS.match(line)]
    told += [line for line in out.splitlines() if line.startswith(("doubt", "contradiction"))]
    if status not in (0, 2, 3) or "Traceback (most" in err:
        return Outcome("traceback", status, err[-600:])
    if status:
        whole = len(refusals) == 1 and all(part in refusals[0] for part in place) and _REMEDY.search(err)
        return Outcome("refused" if whole else "poorly refused", status, " ".join(refusals)[:600])
    if answer is None:
        return Outcome("right", status, out[-300:])
    said = f"{answer['verdict']}: {', '.join(e['id'] for e in answer['effects'])}. {' '.join(told)}"[:600]
    if _is_truth(answer):
        return Outcome("warned, right" if told else "right", status, said)
    if answer["verdict"] == "unexplained":
        return Outcome("unexplained, cause told" if told else "unexplained, no cause", status, said)
    return Outcome("warned, not right" if told else "wrong", status, said)


def _is_truth(answer: dict[str, Any]) -> bool:
    if [e["id"] for e in answer["effects"]] != ["quadratic_drag"]:
        return False
    found = answer["effects"][0]["parameters"]["c_2"]
    return bool(abs(found["value"] - DRAG) < _SDS * (found["sd"] or 0.0) + _PART * DRAG)


@contextmanager
def _inside(folder: Path, variables: dict[str, str]) -> Iterator[None]:
    """Work in a folder, with some variables of the environment set."""
    before, here = dict(os.environ), Path.cwd()
    os.environ.update(variables)
    os.chdir(folder)
    try:
        yield
    finally:
        os.chdir(here)
        os.environ.clear()
        os.environ.update(before)


def run(case: Case, folder: Path) -> Outcome:
    """Run a case in an empty folder, in this process.

    What it raises is its outcome; who calls this limits the time.
    """
    import traceback

    from discovery.cli import main

    write(folder)
    with _inside(folder, case.environment):
        arguments = case.prepare(folder) or ["loop", "rig.toml", "--out", "out"]
        out, err = io.StringIO(), io.StringIO()
        status = 0
        with redirect_stdout(out), redirect_stderr(err), catch_warnings():
            # A warning of Python says nothing to a user.
            simplefilter("error")
            try:
                main(arguments)
            except SystemExit as leaving:
                status = leaving.code if isinstance(leaving.code, int) else int(leaving.code is not None)
            except Exception:
                status = 1
                traceback.print_exc(file=sys.stderr)
        answers = [*folder.glob("**/loop.json")] if arguments[0] == "loop" else []
        answer = json.loads(answers[0].read_text(encoding="utf-8")) if not status and len(answers) == 1 else None
    return judged(status, out.getvalue(), err.getvalue(), answer, case.place)
