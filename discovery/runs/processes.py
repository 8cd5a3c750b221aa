"""Work on processes of this machine, by pipes that nobody else can open, and work that ends when its time is up."""

from __future__ import annotations

import ctypes
import hashlib
import json
import math
import multiprocessing
import os
import pickle
import signal
import threading
import time
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from typing import Any

import numpy as np
from numpy.random import SeedSequence

from discovery.results.provenance import plain, restored

#: Seconds after which a process whose work does not heed its limit is ended.
_GRACE = 10.0
Work = Callable[[Any, SeedSequence], Mapping[str, Any]]
#: An alarm that nobody could hear, as within a callback of a compiled library, rings again after so many seconds.
_AGAIN = 10.0


class Died(Exception):
    """A process ended before it had done its work."""


class Pool:
    """At most so many processes, each at one piece of work, with variables of their environment; started as needed."""

    def __init__(self, size: int, environment: dict[str, str]) -> None:
        self._size, self._environment = size, environment
        # A forked process would have the locks of threads that it does not have.
        self._context = multiprocessing.get_context("spawn")
        self._idle: list[tuple[Any, Connection]] = []
        self._busy: dict[Connection, tuple[Any, Any]] = {}

    def room(self) -> int:
        """Return how many pieces of work can be done at once."""
        return self._size

    def submit(self, key: Any, work: Callable[..., Any], *arguments: Any) -> None:
        """Give work, picklable with its arguments, to a process that waits; `next` names it by its key."""
        content = pickle.dumps((work, arguments))
        process, pipe = self._idle.pop() if self._idle else self._started()
        # Of a process that has died meanwhile, `next` hears.
        with suppress(OSError):
            pipe.send_bytes(content)
        self._busy[pipe] = key, process

    def next(self) -> tuple[Any, Callable[[], Any]]:
        """Return the key of the work that ends next, and what returns its result, or raises its error or `Died`."""
        ready = wait(list(self._busy))[0]
        assert isinstance(ready, Connection)
        key, process = self._busy.pop(ready)
        try:
            result, error = pickle.loads(ready.recv_bytes())
        except (EOFError, OSError):
            process.join()
            ready.close()
            result, error = None, Died()
        else:
            self._idle.append((process, ready))

        def returned() -> Any:
            if error is not None:
                raise error
            return result

        return key, returned

    def close(self) -> None:
        """End every process, whatever it is at."""
        every = [*self._idle, *((process, pipe) for pipe, (_, process) in self._busy.items())]
        for process, pipe in every:
            process.kill()
            process.join()
            pipe.close()
        self._idle, self._busy = [], {}

    def _started(self) -> tuple[Any, Connection]:
        ours, theirs = self._context.Pipe()
        process = self._context.Process(target=_serve, args=(theirs, self._environment), daemon=True)
        process.start()
        theirs.close()
        return process, ours


def _serve(pipe: Connection, environment: dict[str, str]) -> None:
    """Do what comes through a pipe until it is closed."""
    os.environ.update(environment)
    # An interruption comes to all processes of a terminal; the one that gave the work ends the others.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    while True:
        try:
            content = pipe.recv_bytes()
        except EOFError:
            return
        pipe.send_bytes(_answer(content))


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)


def _answer(content: bytes) -> bytes:
    """Return result and error of one piece of work."""
    try:
        work, arguments = pickle.loads(content)
        return pickle.dumps((work(*arguments), None))
    except Exception as error:
        try:
            pickle.loads(said := pickle.dumps((None, error)))
        except Exception:  # an error that cannot be sent
            return pickle.dumps((None, RuntimeError(f"{type(error).__name__}: {error}")))
        return said


@dataclass(frozen=True)
class Outcome:
    """What became of one case after so many seconds: what its work returned, or what went wrong, and where."""

    name: str
    seconds: float
    result: Mapping[str, Any] | None
    error: str = ""
    trace: str = ""


def case_seed(seed: int, name: str) -> SeedSequence:
    """Return the seed of one case: a child of the common seed that its name alone chooses."""
    words = np.frombuffer(hashlib.sha256(name.encode()).digest()[:16], np.uint32)
    return SeedSequence(seed, spawn_key=tuple(words.tolist()))


class TooLong(BaseException):
    """The limit of a case has passed: no error of its work's own, which the work might catch."""


@contextmanager
def _limited(limit: float | None, *, alone: bool) -> Iterator[None]:
    """Raise `TooLong` in this thread after so many seconds; where it is alone, end its process if it does not react."""
    if limit is None:
        yield
        return
    thread, guard, over = threading.get_ident(), threading.Lock(), threading.Event()

    def watch() -> None:
        if over.wait(limit):
            return
        with guard:
            if not over.is_set():
                # What a signal would do, but a signal reaches the main thread only, and Dask's work runs in another.
                ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread), ctypes.py_object(TooLong))
        if alone and not over.wait(_GRACE):
            os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
    try:
        yield
    finally:
        with guard:
            over.set()


def attempt(work: Work, name: str, case: Any, seed: SeedSequence, limit: float | None, alone: bool) -> Outcome:
    """Do one case; a failure is an outcome, too."""
    start = time.perf_counter()
    try:
        with _limited(limit, alone=alone):
            result = restored(plain(dict(work(case, seed))))
            json.dumps(result)
    except TooLong:
        said = f"TooLong: the case took longer than its limit of {limit:g} s"
        trace = traceback.format_exc()
    except Exception as error:
        said, trace = f"{type(error).__name__}: {error}", traceback.format_exc()
    else:
        return Outcome(name, time.perf_counter() - start, result)
    return Outcome(name, time.perf_counter() - start, None, said, trace)


class TimeIsUp(KeyboardInterrupt):
    """The time for a piece of work is over: it is interrupted as by Ctrl-C."""


@contextmanager
def time_limit(seconds: float = math.inf) -> Iterator[None]:
    """Interrupt what is done in a context by TimeIsUp after some seconds; finite ones in the main thread only."""
    if seconds <= 0:
        raise TimeIsUp
    if math.isinf(seconds):
        yield
        return

    def ring(*_: object) -> None:
        raise TimeIsUp

    before = signal.signal(signal.SIGALRM, ring)
    try:
        signal.setitimer(signal.ITIMER_REAL, seconds, _AGAIN)
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
