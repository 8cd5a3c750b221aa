"""Kill commands and write the table: ``python -m benchmarks.kills FOLDER [--kills N] [--only COMMAND]``.

What a folder holds of commands that are not named stays in the table.
"""

from __future__ import annotations

import argparse
import json
import signal
import sys
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from benchmarks.faults.page import put
from benchmarks.kills.commands import COMMANDS, FIT
from benchmarks.kills.together import compiled_once, two
from benchmarks.kills.trial import SIGNALS, reference, tried

#: Kills of one trial, after which the command is given once more.
_KILLS = 3
#: Of its own time, after which a second process starts with the same folder.
_DELAYS = (0.0, 0.3, 0.7)


@dataclass
class Row:
    """What became of one command."""

    seconds: float
    kills: Counter[str] = field(default_factory=Counter)
    trials: int = 0
    meetings: int = 0
    faults: list[str] = field(default_factory=list)


def of_command(name: str, folder: Path, kills: int, seed: int) -> Row:
    """Kill a command so often, and let it meet itself.

    Parameters
    ----------
    name : str
        The command.
    folder : Path
        An empty one.
    kills, seed : int
        How many kills must reach it, and the seed of their moments.
    """
    command, rng = COMMANDS[name], np.random.default_rng(seed)
    prepared = folder / "prepared"
    prepared.mkdir()
    try:
        command.prepare(prepared)
        known = reference(command, prepared, folder / "alone")
    except RuntimeError as error:
        return Row(np.nan, faults=[str(error)])
    row = Row(known.seconds)
    while row.kills.total() < kills:
        trial = tried(command, prepared, folder / f"trial_{row.trials}", known, _KILLS, rng)
        row.trials += 1
        row.kills.update(trial.kills)
        _note(name, row, trial.faults)
    for i, part in enumerate(_DELAYS):
        row.meetings += 1
        _note(name, row, two(command, prepared, folder / f"two_{i}", known, part * known.seconds))
    return row


def _note(name: str, row: Row, faults: list[str]) -> None:
    row.faults += faults
    for fault in faults:
        print(f"{name}: {fault}", flush=True)


def before(folder: Path) -> tuple[dict[str, Row], dict[str, Any]]:
    """Return what a folder holds of an earlier call: a row of each command, and what became of the cache."""
    path = folder / "kills.json"
    content = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    cache = content.pop("cache", {"compiled": [], "alone": 0, "faults": []})
    return {name: Row(**{**row, "kills": Counter(row["kills"])}) for name, row in content.items()}, cache


def table(rows: dict[str, Row], counts: list[int], alone: int, faults: list[str]) -> str:
    """Return what became of every command, and all that should not be, as Markdown."""
    lines = [
        f"| command | alone [s] | {' | '.join(s.name for s in SIGNALS)} | given once more | twice at once | faults |",
        "|---|---|" + "---|" * (len(SIGNALS) + 3),
    ]
    total: Counter[str] = Counter()
    for name, row in rows.items():
        total += row.kills
        kills = " | ".join(str(row.kills[s.name]) for s in SIGNALS)
        lines.append(f"| `{name}` | {row.seconds:.1f} | {kills} | {row.trials} | {row.meetings} | {len(row.faults)} |")
    sums = " | ".join(str(total[s.name]) for s in SIGNALS)
    trials, meetings = (sum(getattr(row, name) for row in rows.values()) for name in ("trials", "meetings"))
    found = sum(len(row.faults) for row in rows.values())
    lines += [f"| all, {total.total()} kills |  | {sums} | {trials} | {meetings} | {found} |", ""]
    if counts:
        lines.append(
            f"{len(counts)} fits at once on an empty cache compiled {', '.join(map(str, counts))} simulators; one "
            f"alone compiles {alone}. Faults: {len(faults)}."
        )
    lines += [f"- **{name}**: {' '.join(fault.split())}" for name, row in rows.items() for fault in row.faults]
    return "\n".join([*lines, *(f"- **cache**: {' '.join(fault.split())}" for fault in faults)]) + "\n"


def main(arguments: list[str] | None = None) -> int:
    """Kill every command, and return how many faults there are."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.kills")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--kills", type=int, default=21, help="that must reach each command")
    parser.add_argument("--page", type=Path, help="a page that is given the table")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=2, help="commands that are killed side by side")
    parser.add_argument("--only", nargs="*", choices=[*COMMANDS, "cache"], default=[*COMMANDS, "cache"])
    given = parser.parse_args(arguments)
    given.folder.mkdir(parents=True, exist_ok=True)
    # In the background of a script interruptions are ignored, and what is started from here would ignore them, too.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    rows, cache = before(given.folder)
    with TemporaryDirectory() as made:
        names = [name for name in COMMANDS if name in given.only]
        folders = [Path(made) / name for name in names]
        for folder in folders:
            folder.mkdir()
        with ThreadPoolExecutor(given.workers) as threads:
            found = threads.map(lambda name, at: of_command(name, at, given.kills, given.seed), names, folders)
            rows |= dict(zip(names, found, strict=True))
        if "cache" in given.only:
            prepared = Path(made) / "prepared"
            prepared.mkdir()
            FIT.prepare(prepared)
            known = reference(FIT, prepared, Path(made) / "alone")
            counts, alone, faults = compiled_once(prepared, Path(made) / "empty", known)
            cache = {"compiled": counts, "alone": alone, "faults": faults}
    text = table(rows, cache["compiled"], cache["alone"], cache["faults"])
    (given.folder / "kills.md").write_text(text, encoding="utf-8")
    if given.page is not None:
        put(given.page, "kills", text)
    content = {name: {**vars(row), "kills": dict(row.kills)} for name, row in rows.items()}
    content["cache"] = cache
    (given.folder / "kills.json").write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    print(f"{text}written: {given.folder / 'kills.md'}")
    return len(cache["faults"]) + sum(len(row.faults) for row in rows.values())


if __name__ == "__main__":
    sys.exit(min(main(), 1))
