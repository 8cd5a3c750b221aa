"""Processes that meet: two with one folder of results, four on an empty cache of compiled simulators."""

from __future__ import annotations

import shutil
import time
from pathlib import Path
from typing import Any

from benchmarks.kills.commands import FIT, OUT, Command, environment, start
from benchmarks.kills.content import content, differences, hidden
from benchmarks.kills.trial import Reference

#: Processes that meet on an empty cache.
_PROCESSES = 4
_REFUSED = "Another discovery command is writing to"
_COMPILING = "compiling a simulator"


def two(command: Command, prepared: Path, folder: Path, known: Reference, delay: float) -> list[str]:
    """Start a command twice with the same folder, and return all that should not be.

    Parameters
    ----------
    command, prepared, folder
        See `benchmarks.kills.trial.reference`.
    known : Reference
        The same command left alone.
    delay : float
        Seconds between the two starts.
    """
    shutil.copytree(prepared, folder)
    variables = environment(folder)
    first = start(command, folder, variables)
    time.sleep(delay)
    second = start(command, folder, variables)
    ended = [(process.communicate()[1], process.returncode) for process in (first, second)]
    found = []
    for said, status in ended:
        if status and not (status == 2 and _REFUSED in said and "Traceback" not in said):
            found.append(f"status {status}: {said[-300:]}")
    if all(status for _, status in ended):
        found.append("neither of two succeeds")
    found += differences(content(folder / OUT), known.content)
    return found + [f"{name} left over" for name in hidden(folder / OUT)]


def compiled_once(prepared: Path, folder: Path, known: Reference) -> tuple[list[int], int, list[str]]:
    """Start four fits at once on an empty cache.

    Returns
    -------
    list of int
        How many simulators each of them compiled.
    int
        How many a single process compiles on an empty cache.
    list of str
        All that should not be.
    """
    found: list[str] = []

    def begun(name: str, cache: Path) -> Any:
        shutil.copytree(prepared, folder / name)
        return start(FIT, folder / name, environment(folder / name, cache))

    folder.mkdir()
    _, said = begun("alone", folder / "cache_alone").communicate()
    alone = said.count(_COMPILING)
    names = [f"process_{i}" for i in range(_PROCESSES)]
    processes = [begun(name, folder / "cache") for name in names]
    counts = []
    for name, process in zip(names, processes, strict=True):
        _, said = process.communicate()
        counts.append(said.count(_COMPILING))
        if process.returncode:
            found.append(f"{name}: status {process.returncode}: {said[-300:]}")
        else:
            found += [f"{name}: {fault}" for fault in differences(content(folder / name / OUT), known.content)]
    if sum(counts) != alone:
        found.append(f"{sum(counts)} simulators are compiled, and {alone} are needed")
    found += [f"{path.name} left over in the cache" for path in (folder / "cache").iterdir() if path.suffix != ".kept"]
    return counts, alone, found
