"""One trial: a command is killed some times, then given once more, and compared with one that was left alone."""

from __future__ import annotations

import shutil
import signal
import subprocess
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.kills.commands import OUT, Command, environment, finished, start
from benchmarks.kills.content import content, differences, faults, hidden

SIGNALS = (signal.SIGKILL, signal.SIGTERM, signal.SIGINT)
#: Seconds between two looks at a folder.
_LOOK = 5e-3
#: Seconds in which a command must end that was told to.
_PATIENCE = 600.0


@dataclass(frozen=True)
class Reference:
    """A command that was left alone: its time, the changes of its folder, and what it wrote.

    Parameters
    ----------
    seconds : float
        From its start to its end.
    changes : int
        How often the names, sizes and times of the files in its folder were seen to change.
    content : dict
        From `content`.
    """

    seconds: float
    changes: int
    content: dict[str, Any]


@dataclass
class Trial:
    """What became of a command that was killed.

    Parameters
    ----------
    kills : list of str
        The signals that reached it while it ran.
    faults : list of str
        All that should not be.
    """

    kills: list[str] = field(default_factory=list)
    faults: list[str] = field(default_factory=list)


def _state(folder: Path) -> tuple[tuple[str, int, int], ...]:
    found = []
    for path in sorted(folder.rglob("*")):
        try:
            at = path.lstat()
        except OSError:  # moved away meanwhile
            continue
        found.append((str(path), at.st_size, at.st_mtime_ns))
    return tuple(found)


class _Changes:
    """Counts how often a folder changes while a process runs."""

    def __init__(self, process: subprocess.Popen[str], folder: Path) -> None:
        self._process, self._folder = process, folder
        self.count, self._last = 0, _state(folder)

    def wait(self, seconds: float = np.inf, changes: float = np.inf) -> None:
        """Return after so many seconds or changes, or when the process has ended."""
        end = time.monotonic() + seconds
        while self.count < changes and time.monotonic() < end and self._process.poll() is None:
            now = _state(self._folder)
            self.count, self._last = self.count + (now != self._last), now
            time.sleep(_LOOK)


def reference(command: Command, prepared: Path, folder: Path) -> Reference:
    """Leave a command alone, once that all is compiled which it needs.

    Parameters
    ----------
    command : Command
    prepared : Path
        What it reads.
    folder : Path
        Where a copy of it is made.
    """
    shutil.copytree(prepared, folder)
    finished(command, folder, environment(folder))
    shutil.rmtree(folder)
    shutil.copytree(prepared, folder)
    variables = environment(folder)
    began = time.monotonic()
    process = start(command, folder, variables)
    changes = _Changes(process, folder / OUT)
    changes.wait()
    _, said = process.communicate()
    if process.returncode or (left := hidden(folder / OUT)):
        raise RuntimeError(f"the command that is left alone fails, or leaves something: {said}{left}")
    return Reference(time.monotonic() - began, changes.count, content(folder / OUT))


def killed(
    command: Command, folder: Path, variables: dict[str, str], known: Reference, sent: signal.Signals, rng: Any
) -> tuple[bool, str]:
    """Start a command and kill it: at a random time, or, as often, after a random number of changes of its folder.

    Returns
    -------
    bool
        Whether it still ran.
    str
        What it said on standard error.
    """
    process = start(command, folder, variables)
    changes = _Changes(process, folder / OUT)
    if rng.random() < 0.5:
        changes.wait(seconds=rng.uniform(0.0, known.seconds))
    else:
        changes.wait(changes=rng.integers(1, known.changes + 1))
    ran = process.poll() is None
    if ran:
        process.send_signal(sent)
    try:
        _, said = process.communicate(timeout=_PATIENCE)
    except subprocess.TimeoutExpired:
        process.kill()
        process.communicate()
        return ran, f"{sent.name} does not end it"
    return ran and process.returncode != 0, said


def tried(command: Command, prepared: Path, folder: Path, known: Reference, kills: int, rng: Any) -> Trial:
    """Kill a command some times in the same folder, each time by a random signal, give it once more, and compare.

    Parameters
    ----------
    command, prepared, folder
        See `reference`.
    known : Reference
        The same command left alone.
    kills : int
        How often it is killed.
    rng : numpy.random.Generator
        Chooses the signals and the moments.
    """
    shutil.copytree(prepared, folder)
    variables, trial = environment(folder), Trial()
    for _ in range(kills):
        sent = SIGNALS[rng.integers(len(SIGNALS))]
        landed, said = killed(command, folder, variables, known, sent, rng)
        if not landed:
            continue
        trial.kills.append(sent.name)
        trial.faults += [f"after {sent.name}: {fault}" for fault in faults(folder / OUT)]
        if "does not end it" in said:
            trial.faults.append(said)
        if sent is not signal.SIGKILL and "interrupted:" in said and (left := hidden(folder / OUT)):
            trial.faults.append(f"after {sent.name} that was heard: {', '.join(left)} left over")
    status, _, said = finished(command, folder, variables)
    if status:
        trial.faults.append(f"given once more it ends with status {status}: {said[-500:]}")
    else:
        trial.faults += differences(content(folder / OUT), known.content)
    trial.faults += [f"{name} left over" for name in hidden(folder / OUT)]
    trial.faults += [f"{path.name} left over in the folder of temporary files" for path in (folder / "tmp").iterdir()]
    return trial
