"""Work on several processes, each with a bounded memory."""

from __future__ import annotations

import resource
from collections.abc import Callable, Iterator, Sequence
from multiprocessing import get_context
from typing import TypeVar

Job = TypeVar("Job")
Result = TypeVar("Result")
MEMORY = 8 << 30  # bytes a process may use: what needs more is one failed case
LIFETIME = 50  # jobs of a process


def limit_memory() -> None:
    """Let this process have so much memory and no more."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, resource.getrlimit(resource.RLIMIT_AS)[1]))


def spread(work: Callable[[Job], Result], jobs: Sequence[Job], workers: int) -> Iterator[Result]:
    """Yield the results of jobs as they are done; a single worker is this process."""
    if workers == 1:
        yield from map(work, jobs)
        return
    with get_context("spawn").Pool(workers, maxtasksperchild=LIFETIME) as pool:
        yield from pool.imap_unordered(work, jobs)
