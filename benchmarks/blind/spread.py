"""Work on several processes, each with a bounded memory."""

from __future__ import annotations

import resource
from collections.abc import Callable, Iterator, Sequence
from typing import Any, TypeVar

from discovery.spread import spread as spread_cases

Job = TypeVar("Job")
Result = TypeVar("Result")
MEMORY = 8 << 30  # bytes a process may use: what needs more is one failed case


def limit_memory() -> None:
    """Let this process have so much memory and no more."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, resource.getrlimit(resource.RLIMIT_AS)[1]))


def _value(job: tuple[Callable[[Any], Any], Any], _seed: Any) -> dict[str, Any]:
    work, what = job
    return {"value": work(what)}


def spread(work: Callable[[Job], Result], jobs: Sequence[Job], workers: int) -> Iterator[Result]:
    """Yield the results of jobs as they are done; a single worker is this process."""
    cases = ((str(i), (work, job)) for i, job in enumerate(jobs))
    for outcome in spread_cases(_value, cases, workers=workers):
        if outcome.result is None:
            raise RuntimeError(f"{outcome.error}\n{outcome.trace}")
        yield outcome.result["value"]
