"""The commands that are killed, each with the folder that it works in."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from benchmarks.scale.rig import write

#: Folder of the results, in the folder that a command works in.
OUT = "out"
#: Rigs of the campaign.
_RIGS = ("first", "second", "third")
#: Seconds after which a command that was not killed hangs.
_LIMIT = 7200.0


@dataclass(frozen=True)
class Command:
    """A command that writes results.

    Parameters
    ----------
    arguments : tuple of str
        Of `discovery`.
    prepare : callable
        Puts into an empty folder what the command reads.
    """

    arguments: tuple[str, ...]
    prepare: Callable[[Path], object]


def environment(folder: Path, cache: Path | None = None) -> dict[str, str]:
    """Return the variables of a command: temporary files go to a folder where they are seen.

    Parameters
    ----------
    folder : Path
        That the command works in.
    cache : Path, optional
        Folder of the compiled simulators; the user's own by default.
    """
    temporary = folder / "tmp"
    temporary.mkdir(exist_ok=True)
    named = {} if cache is None else {"DISCOVERY_CACHE": str(cache)}
    return {**os.environ, "TMPDIR": str(temporary), "DISCOVERY_THREADS": "1", **named}


def start(command: Command, folder: Path, variables: Mapping[str, str]) -> subprocess.Popen[str]:
    """Start a command in its folder."""
    return subprocess.Popen(
        [sys.executable, "-m", "discovery", *command.arguments],
        cwd=folder,
        env=dict(variables),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        stdin=subprocess.DEVNULL,
        text=True,
    )


def finished(command: Command, folder: Path, variables: Mapping[str, str]) -> tuple[int, str, str]:
    """Run a command to its end: return its status and what it printed."""
    process = start(command, folder, variables)
    try:
        out, err = process.communicate(timeout=_LIMIT)
    except subprocess.TimeoutExpired:
        process.kill()
        out, err = process.communicate()
        return -1, out, f"{err}\nthe command hangs"
    return process.returncode, out, err


def _rig(folder: Path) -> None:
    write(folder, 0)


def _rigs(folder: Path) -> None:
    for seed, name in enumerate(_RIGS):
        write(folder / "rigs" / name, seed)


def _run(folder: Path) -> None:
    """Leave the results of a run, without its page."""
    _rig(folder)
    status, _, err = finished(COMMANDS["run"], folder, os.environ)
    if status:
        raise RuntimeError(err)
    for name in ("figures", "tables"):
        shutil.rmtree(folder / OUT / name)
    (folder / OUT / "report.html").unlink()


#: The shortest one that compiles.
FIT = Command(("fit", "rig.toml", "--out", OUT), _rig)
COMMANDS = {
    "loop": Command(("loop", "rig.toml", "--out", OUT, "--predict", "low.csv"), _rig),
    "report": Command(("report", OUT), _run),
    "posterior": Command(("posterior", "rig.toml", "--out", OUT), _rig),
    "campaign": Command(("campaign", "rigs", "--out", OUT), _rigs),
    "run": Command(("run", "rig.toml", "--out", OUT), _rig),
}
