"""Threads that share blocks of work, or do different work side by side."""

from __future__ import annotations

import os
import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager
from functools import lru_cache
from typing import TypeVar

from threadpoolctl import ThreadpoolController

T = TypeVar("T")
_this_thread = threading.local()


@lru_cache(maxsize=1)
def _algebra() -> ThreadpoolController:
    return ThreadpoolController()


def single_algebra() -> AbstractContextManager[object]:
    """Keep linear algebra in the thread that asks for it: its own threads would spin beside those here."""
    return _algebra().limit(limits=1, user_api="blas")


@lru_cache(maxsize=1)
def _helpers(threads: int) -> ThreadPoolExecutor:
    """Return threads that wait for work beside the one that calls; a forked process makes its own."""
    return ThreadPoolExecutor(threads)


os.register_at_fork(after_in_child=_helpers.cache_clear)


def in_threads(work: Callable[[Iterator[int]], None], blocks: int, *, threads: int) -> None:
    """Do the work on all blocks in this thread and in others, at most so many together.

    The work is called once in each thread with an iterator over the blocks. The threads share it, so each gets what is
    next as it finishes: blocks differ in what they cost.
    """
    waiting = iter(range(blocks))
    others = min(threads - 1, blocks - 1)
    helpers = [_helpers(threads - 1).submit(work, waiting) for _ in range(others)]
    try:
        work(waiting)
    except KeyboardInterrupt:
        # The others end with what they are at, and nobody waits for that.
        deque(waiting, maxlen=0)
        helpers.clear()
        raise
    finally:
        # A helper that has not begun yet is not needed any more.
        errors = [helper.exception() for helper in helpers if not helper.cancel()]
    for error in filter(None, errors):
        raise error


def aside(call: Callable[[], T]) -> T:
    """Return what a call returns, made in another thread if this is the main one.

    An interruption comes to the main thread: the compiler would drop it, and what waits does not.
    """
    if threading.current_thread() is not threading.main_thread():
        return call()
    pool = ThreadPoolExecutor(1)
    try:
        return pool.submit(call).result()
    finally:
        pool.shutdown(wait=False)


def at_once(calls: Sequence[Callable[[], T]], *, threads: int) -> list[T]:
    """Make calls that do not depend on each other side by side, and return what they return in their order.

    What simulates few blocks at a time leaves threads idle. Calls made within such a call follow each other. Each is
    pure, so that the outcome does not depend on which is first; at most so many threads work, this one included.
    """
    threads = 1 if getattr(_this_thread, "is_beside", False) else min(threads, len(calls))

    def beside(call: Callable[[], T]) -> T:
        _this_thread.is_beside = True
        try:
            return call()
        finally:
            _this_thread.is_beside = False

    # Limits that overlap in time would not be undone in their order, so one encloses all.
    with single_algebra():
        if threads < 2:
            return [call() for call in calls]
        pool, waits = ThreadPoolExecutor(threads - 1), True
        try:
            others = [pool.submit(beside, call) for call in calls[1:]]
            first = beside(calls[0])
            return [first, *(other.result() for other in others)]
        except KeyboardInterrupt:
            # What compiles or simulates beside cannot be stopped.
            waits = False
            raise
        finally:
            pool.shutdown(wait=waits, cancel_futures=True)
