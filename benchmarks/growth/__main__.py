"""Measure long recordings: ``python -m benchmarks.growth FOLDER [--only WORD ...] [--run]``.

Seconds are those of processors, so that work beside it counts little; memory is the peak of the command's process.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from dataclasses import asdict, dataclass
from pathlib import Path

from benchmarks.growth.recordings import CASES, Recorded

#: Megabytes in a unit of ``ru_maxrss``: bytes on macOS, kibibytes elsewhere.
_MEGABYTES = 2.0**-20 if sys.platform == "darwin" else 2.0**-10


@dataclass(frozen=True)
class Cost:
    """What a command cost.

    Parameters
    ----------
    rows : int
        Readings that are fitted.
    status : int
        Exit status; negative: the signal that ended it.
    cpu : float
        Seconds of processors.
    peak : float
        Largest memory [MB].
    answer : str
        Verdict and added effects.
    """

    rows: int
    status: int
    cpu: float
    peak: float
    answer: str


def measured(command: str, folder: Path, case: Recorded) -> Cost:
    """Run a command on a case whose files are in a folder, and return what it cost."""
    with (folder / f"{command}.txt").open("w", encoding="utf-8") as said:
        process = os.posix_spawn(
            sys.executable,
            [sys.executable, "-c", _ENTER, str(folder), command, "rig.toml", "--out", command, "--quiet"],
            os.environ,
            file_actions=[(os.POSIX_SPAWN_DUP2, said.fileno(), 1), (os.POSIX_SPAWN_DUP2, said.fileno(), 2)],
        )
        _, status, used = os.wait4(process, 0)
    written = folder / command / "loop.json"
    answer = ""
    if written.is_file():
        loop = json.loads(written.read_text(encoding="utf-8"))
        answer = " ".join([loop["verdict"], *(effect["id"] for effect in loop["effects"])])
    code = os.waitstatus_to_exitcode(status)
    return Cost(case.rows, code, used.ru_utime + used.ru_stime, used.ru_maxrss * _MEGABYTES, answer)


#: The command line, in the folder of the case.
_ENTER = "import os, sys; os.chdir(sys.argv.pop(1)); from discovery.cli import main; main(sys.argv[1:])"


def table(costs: dict[str, Cost]) -> str:
    """Return the costs as Markdown."""
    lines = ["| recordings | rows fitted | CPU [s] | peak memory [MB] | answer |", "|---|---|---|---|---|"]
    for name, c in costs.items():
        ended = c.answer if c.status == 0 else f"exit {c.status}"
        lines.append(f"| {name} | {c.rows} | {c.cpu:.1f} | {c.peak:.0f} | {ended} |")
    return "\n".join(lines) + "\n"


def main(arguments: list[str] | None = None) -> int:
    """Run the cases, and return how many did not end with an answer."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.growth")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", nargs="*", default=[""], help="parts of the names of the cases to run")
    parser.add_argument("--run", action="store_true", help="sample the posterior of the spring bench, too")
    given = parser.parse_args(arguments)
    costs: dict[str, Cost] = {}
    for name, case in CASES.items():
        if not any(part in name for part in given.only):
            continue
        folder = given.folder / "cases" / "".join(c if c.isalnum() else "_" for c in name.lower())
        folder.mkdir(parents=True, exist_ok=True)
        case.write(folder)
        costs[name] = measured("loop", folder, case)
        print(f"{name}: {costs[name]}", flush=True)
        if given.run and case.sampled:
            costs[f"{name}, with its posterior"] = measured("run", folder, case)
            print(f"{name}, run: {costs[f'{name}, with its posterior']}", flush=True)
    records = {name: asdict(cost) for name, cost in costs.items()}
    (given.folder / "growth.json").write_text(json.dumps(records, indent=1) + "\n", encoding="utf-8")
    (given.folder / "growth.md").write_text(table(costs), encoding="utf-8")
    print(f"written: {given.folder / 'growth.md'}")
    return sum(cost.status != 0 for cost in costs.values())


if __name__ == "__main__":
    sys.exit(min(main(), 1))
