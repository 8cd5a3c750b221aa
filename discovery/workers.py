"""Threads that share blocks of work."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager
from functools import lru_cache

from threadpoolctl import ThreadpoolController

__all__ = ["in_threads", "single_algebra"]


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


def in_threads(work: Callable[[Iterator[range]], None], blocks: int, *, threads: int, together: int = 1) -> None:
    """Do the work on all blocks in this thread and in others.

    Parameters
    ----------
    work : callable
        Called once in each thread with an iterator over consecutive blocks. The threads share it, so each gets what
        is next as it finishes: blocks differ in what they cost.
    blocks : int
        How many there are.
    threads : int
        At most so many, this one included.
    together : int
        Blocks that are handed out at once.
    """
    waiting = iter([range(first, min(first + together, blocks)) for first in range(0, blocks, together)])
    others = min(threads - 1, -(-blocks // together) - 1)
    helpers = [_helpers(threads - 1).submit(work, waiting) for _ in range(others)]
    try:
        work(waiting)
    finally:
        # A helper that has not begun yet is not needed any more.
        errors = [helper.exception() for helper in helpers if not helper.cancel()]
    for error in filter(None, errors):
        raise error
