"""All cases, by name."""

from __future__ import annotations

from dataclasses import asdict
from itertools import chain
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from benchmarks.faults.case import Case, run
from benchmarks.faults.machine import machine
from benchmarks.faults.recordings import recordings
from benchmarks.faults.rigs import rig_files

__all__ = ["corpus", "outcome_of"]


def corpus() -> dict[str, Case]:
    """Return every case by its id."""
    cases = list(chain(recordings(), rig_files(), machine()))
    found = {case.id: case for case in cases}
    if len(found) < len(cases):
        raise ValueError("two cases have the same name")
    return found


def outcome_of(name: str, _seed: object) -> dict[str, Any]:
    """Run the case of a name in a folder of its own, and return the fields of its outcome.

    Other processes find this function here; that of a package's ``__main__`` they would not.
    """
    with TemporaryDirectory() as folder:
        return asdict(run(corpus()[name], Path(folder)))
