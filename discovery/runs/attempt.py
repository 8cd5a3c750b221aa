"""One case of a campaign: run within its time, and told as an outcome whatever happens."""

from __future__ import annotations

import ctypes
import hashlib
import json
import os
import threading
import time
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.random import SeedSequence

from discovery.results.provenance import plain, restored

#: Seconds after which a process whose work does not heed its limit is ended.
_GRACE = 10.0
Work = Callable[[Any, SeedSequence], Mapping[str, Any]]


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
