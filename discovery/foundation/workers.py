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


@lru_cache(maxsize=2)
def _helpers(threads: int, role: str) -> ThreadPoolExecutor:
    """Return threads that wait for work of a role beside the one that calls; a forked process makes its own."""
    return ThreadPoolExecutor(threads, role)


os.register_at_fork(after_in_child=_helpers.cache_clear)


def in_threads(work: Callable[[Iterator[int]], None], blocks: int, *, threads: int, role: str = "blocks") -> None:
    """Do the work on all blocks in this thread and in others, at most so many together.

    The work is called once in each thread with an iterator over the blocks. The threads share it, so each gets what is
    next as it finishes: blocks differ in what they cost. Work that asks for threads itself is of another `role`: at its
    end, when most of its own have nothing left, that finds helpers.
    """
    waiting = iter(range(blocks))
    others = min(threads - 1, blocks - 1)
    helpers = [_helpers(threads - 1, role).submit(work, waiting) for _ in range(others)]
    try:
        work(waiting)
    except BaseException as failure:
        # The others end with what they are at; after an interruption nobody waits for that.
        deque(waiting, maxlen=0)
        if isinstance(failure, KeyboardInterrupt):
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
    threads = 1 if getattr(_this_thread, "is_beside", False) else threads
    # Limits that overlap in time would not be undone in their order, so one encloses all.
    with single_algebra():
        if threads < 2:
            return [call() for call in calls]
        found: dict[int, T] = {}

        def work(waiting: Iterator[int]) -> None:
            for i in waiting:
                _this_thread.is_beside = True
                try:
                    found[i] = calls[i]()
                finally:
                    _this_thread.is_beside = False

        in_threads(work, len(calls), threads=threads, role="calls")
        return [found[i] for i in range(len(calls))]
