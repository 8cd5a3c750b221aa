"""All cases, by name."""

from __future__ import annotations

from itertools import chain

from benchmarks.faults.case import Case
from benchmarks.faults.machine import machine
from benchmarks.faults.recordings import recordings
from benchmarks.faults.rigs import rig_files

__all__ = ["corpus"]


def corpus() -> dict[str, Case]:
    """Return every case by its id."""
    cases = list(chain(recordings(), rig_files(), machine()))
    found = {case.id: case for case in cases}
    if len(found) < len(cases):
        raise ValueError("two cases have the same name")
    return found
