"""One case as its user would run it, and whether its answer is right."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.systems.cases import Case
from benchmarks.systems.record import record

#: Held-out residual over the noise up to which a prediction counts as within it.
_WITHIN = 1.1
#: Seconds after which a command is given up.
_LIMIT = 900


@dataclass(frozen=True)
class Outcome:
    """What became of a case.

    Parameters
    ----------
    right : bool
        The effect is named where it is, alone, within its margin, and the held-out recording is predicted within the
        noise.
    verdict : str
        Of the loop; what went wrong, where there is none.
    added : tuple of str
        Effects that the loop added.
    errors : mapping of str to float
        Relative error of each parameter.
    before, after : float or None
        Held-out residual of the declared and of the final model, over the noise.
    seconds, cpu, load : float
        What the loop took [s], of the clock and of processors, and the machine's load beside it.
    """

    right: bool
    verdict: str
    added: tuple[str, ...] = ()
    errors: dict[str, float] | None = None
    before: float | None = None
    after: float | None = None
    seconds: float = 0.0
    cpu: float = 0.0
    load: float = 0.0


def run(case: Case, folder: Path, seed: int) -> Outcome:
    """Simulate a training and a held-out recording, and run the loop on them."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "rig.toml").write_text(case.machine.rig, encoding="utf-8")
    for k, name in enumerate(("train.csv", "holdout.csv")):
        record(case.machine, case.joint, case.law, folder / name, 1000 * seed + k)
    given = ["rig.toml", "--train", "train.csv", "--holdout", "holdout.csv"]
    status, said, seconds, cpu = _command(["loop", *given, "--out", "loop"], folder)
    file = folder / "loop" / "loop.json"
    if status or not file.is_file():
        return Outcome(
            False, f"exit {status}: {said.strip()[-300:]}", seconds=seconds, cpu=cpu, load=os.getloadavg()[0]
        )
    return judged(case, json.loads(file.read_text(encoding="utf-8")), seconds, cpu)


def judged(case: Case, found: dict[str, Any], seconds: float, cpu: float) -> Outcome:
    """Return what a loop.json says of a case."""
    added = {e["id"]: e["parameters"] for e in found["effects"]}
    # A kind with one coordinate has no places, and neither has the drive.
    place = f"_{case.joint}" if "[system]" in case.machine.rig and case.joint else ""
    wanted = [f"{name}_at{place}" if place else name for name in case.law.names]
    named = next((added[e] for e in wanted if e in added), None)
    said = {n: p.get("physical", p)["value"] for n, p in (named or {}).items()}
    errors = {n: said[n + place] / value - 1 for n, value in case.law.truth.items() if n + place in said}
    floor = found["errors"]["noise_floor"]
    before, after = (found["errors"][when]["holdout"]["rms"] / floor for when in ("before", "after"))
    right = (
        (named is not None and len(added) == 1 if wanted else not added)
        and all(abs(e) <= case.within for e in errors.values())
        and after <= _WITHIN
    )
    return Outcome(right, found["verdict"], tuple(added), errors, before, after, seconds, cpu, os.getloadavg()[0])


def _command(arguments: Sequence[str], folder: Path) -> tuple[int, str, float, float]:
    """Run the command line, and return status, what it said on stderr, seconds, and those of processors."""
    begin, before = time.perf_counter(), os.times()
    try:
        done = subprocess.run(
            [sys.executable, "-m", "discovery", *arguments],
            cwd=folder,
            capture_output=True,
            text=True,
            timeout=_LIMIT,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return 124, f"longer than {_LIMIT} s", float(_LIMIT), 0.0
    after = os.times()
    (folder / f"{arguments[0]}.txt").write_text(done.stdout + done.stderr, encoding="utf-8")
    cpu = after.children_user + after.children_system - before.children_user - before.children_system
    return done.returncode, done.stderr, time.perf_counter() - begin, cpu
