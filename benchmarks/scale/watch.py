"""What kills workers, and looks at the memory of who gives them work."""

from __future__ import annotations

import random
import threading
from contextlib import suppress
from pathlib import Path

import psutil


def _workers_of(process: psutil.Process) -> list[psutil.Process]:
    """Return the processes that work for another."""
    found = []
    for child in process.children(recursive=True):
        try:
            if any("multiprocessing.spawn" in part for part in child.cmdline()):
                found.append(child)
        except psutil.Error:  # it has ended meanwhile
            continue
    return found


class Watch:
    """Kills workers after random numbers of rigs, and notes the memory of this process and of the largest worker [MiB].

    Parameters
    ----------
    log : Path
        Of `logged`.
    every : float
        Rigs between two kills, on average.
    seed : int
        Of the kills.
    """

    def __init__(self, log: Path, every: float, seed: int) -> None:
        self._log = log
        self.kills, self.memory, self.of_worker = 0, list[float](), 0.0
        self._every, self._random, self._over = every, random.Random(seed), threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> Watch:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join()

    def _run(self) -> None:
        me = psutil.Process()
        following = self._random.expovariate(1 / self._every)
        while not self._over.wait(0.2):
            self.memory.append(me.memory_info().rss / 2**20)
            workers = _workers_of(me)
            for worker in workers:
                with suppress(psutil.Error):
                    self.of_worker = max(self.of_worker, worker.memory_info().rss / 2**20)
            done = self._log.read_text(encoding="utf-8").count("ended")
            if done > following and workers:
                following = done + self._random.expovariate(1 / self._every)
                with suppress(psutil.Error):
                    self._random.choice(workers).kill()
                    self.kills += 1
