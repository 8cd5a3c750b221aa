"""All cases, by name."""

from __future__ import annotations

import time
from dataclasses import asdict, replace
from itertools import chain
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from benchmarks.faults.case import Case, run
from benchmarks.faults.machine import machine
from benchmarks.faults.recordings import recordings
from benchmarks.faults.rigs import rig_files

#: Seconds of a processor's time beyond which a case counts as hanging.
LIMIT = 60.0


def corpus() -> dict[str, Case]:
    """Return every case by its id."""
    cases = list(chain(recordings(), rig_files(), machine()))
    found = {case.id: case for case in cases}
    if len(found) < len(cases):
        raise ValueError("two cases have the same name")
    return found


def outcome_of(name: str, _seed: object) -> dict[str, Any]:
    """Run the case of a name in a folder of its own, and return the fields of its outcome.

    Other processes find this function here; that of a package's ``__main__`` they would not. What else the machine
    does takes no processor's time of this process.
    """
    began = time.process_time()
    with TemporaryDirectory() as folder:
        outcome = run(corpus()[name], Path(folder))
    seconds = time.process_time() - began
    return asdict(replace(outcome, seconds=seconds, outcome="hang" if seconds > LIMIT else outcome.outcome))
