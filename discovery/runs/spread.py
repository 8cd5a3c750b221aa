"""Many cases spread over processes, or over machines by Dask: each has an outcome, and none is lost with another.

A case is a name and whatever its work needs. Its random numbers depend on a common seed and its name alone, so an
outcome is the same on any number of workers, in any order, and whatever other cases there are.
"""

from __future__ import annotations

import os
import time
import traceback
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, closing, contextmanager
from itertools import count, islice
from typing import TYPE_CHECKING, Any, Protocol

from discovery.foundation.errors import ComputationError, InputError
from discovery.runs.processes import _GRACE, Died, Outcome, Pool, Work, attempt, case_seed

if TYPE_CHECKING:
    from distributed import Client

#: Environment variable with the address of a Dask scheduler.
SCHEDULER = "DISCOVERY_SCHEDULER"
#: How often a case is tried whose worker dies: it may have died of another case's memory.
_TRIES = 3
#: Seconds in which a scheduler must answer, and have a worker; and after which it is given up without any.
_PATIENCE, _ABANDONED = 10.0, 60.0
#: Seconds between two looks at a cluster.
_LOOK = 0.02


def spread(
    work: Work,
    cases: Iterable[tuple[str, Any]],
    *,
    seed: int = 0,
    workers: int = 2,
    scheduler: str | None = None,
    insecure: bool = False,
    limit: float | None = None,
    heard: Callable[[str], object] | None = None,
) -> Iterator[Outcome]:
    """Do cases on several processes, or on a cluster, and yield the `Outcome` of each as it ends, failed ones too.

    The work is called with what a case needs and its seed (see `case_seed`), and returns what JSON can hold; it and the
    cases must be picklable. Cases are taken as workers become free, so neither they nor the outcomes pile up here. The
    processes, `workers` of one thread each, import the calling script: it must do its work under
    ``if __name__ == "__main__"``. A single one is this process.

    With the address of a Dask `scheduler`, such as ``"tcp://host:8786"``, by default that in ``DISCOVERY_SCHEDULER``,
    its workers are used instead, and `heard` receives the address of its dashboard, if any. One of another machine
    without TLS, through which others of its network can run code, is used if `insecure`. Without one nothing listens on
    any port. A case may take `limit` seconds; a worker whose work does not heed them is ended, but not this process.

    InputError if there is no scheduler at that address, no worker, or others could run code through it;
    ComputationError if a cluster has lost its last worker, and no other comes.
    """
    address = scheduler or os.environ.get(SCHEDULER)
    if address is None and workers == 1:
        for name, case in cases:
            yield attempt(work, name, case, case_seed(seed, name), limit, False)
        return
    if address is None and workers < 1:
        raise InputError(f"{workers} workers cannot work; give at least one.")
    with _here(workers) if address is None else _client(address, insecure, heard) as crew:
        yield from _stream(crew, work, iter(cases), seed, limit)


class _Crew(Protocol):
    """Who does the work: processes of this machine, or a cluster."""

    def room(self) -> int:
        """Return how many cases can be done at once."""

    def submit(self, key: int, work: Callable[..., Outcome], *arguments: Any) -> None:
        """Begin with a case."""

    def next(self) -> tuple[int, Callable[[], Outcome]]:
        """Return the key of the case that ends next, and a function that returns its outcome, or raises."""


class _Cluster:
    """The workers of a Dask scheduler."""

    def __init__(self, client: Client) -> None:
        from distributed import as_completed

        self._client, self._done = client, as_completed()
        self._keys: dict[Any, int] = {}

    def room(self) -> int:
        return sum(self._client.ncores().values())

    def submit(self, key: int, work: Callable[..., Outcome], *arguments: Any) -> None:
        # One prefix for all: the scheduler keeps statistics of every prefix for ever.
        own = ("case", os.urandom(8).hex())
        self._keys[own] = key
        self._done.add(self._client.submit(work, *arguments, key=own, pure=False, retries=0))

    def next(self) -> tuple[int, Callable[[], Outcome]]:
        from distributed import KilledWorker

        self._wait()
        future = next(self._done)

        def returned() -> Outcome:
            try:
                outcome: Outcome = future.result()
            except KilledWorker:
                raise Died from None
            finally:
                future.release()
            return outcome

        return self._keys.pop(future.key), returned

    def _wait(self) -> None:
        """Wait for a case to end, but not for ever where there is nobody to do it."""
        manned = time.perf_counter()
        while not self._done.has_ready():
            if self.room():
                manned = time.perf_counter()
            elif time.perf_counter() - manned > _ABANDONED:
                raise ComputationError(
                    f"The Dask cluster has had no worker for {_ABANDONED:g} s. What is done is kept: start workers, "
                    "and give the same command again."
                )
            time.sleep(_LOOK)


def _here(workers: int) -> AbstractContextManager[_Crew]:
    """Return processes on this machine, all of which end with the block."""
    # The processes share the processors; each would else simulate on all of them.
    threads = max(1, (os.cpu_count() or 1) // workers)
    return closing(Pool(workers, {"DISCOVERY_THREADS": os.environ.get("DISCOVERY_THREADS", str(threads))}))


def _is_safe(address: str) -> bool:
    """Return whether nobody on the way to a scheduler can read or change what is sent: code, in both directions."""
    scheme, _, rest = address.rpartition("://")
    host = rest.rpartition(":")[0].strip("[]")
    return scheme in ("tls", "inproc") or host == "localhost" or _is_loopback(host)


def _is_loopback(host: str) -> bool:
    from ipaddress import ip_address

    try:
        return ip_address(host).is_loopback
    except ValueError:  # a name
        return False


@contextmanager
def _client(address: str, insecure: bool, heard: Callable[[str], object] | None) -> Iterator[_Crew]:
    """Yield the workers of the scheduler at an address."""
    if not (insecure or _is_safe(address)):
        raise InputError(
            f"The connection to the Dask scheduler at {address!r} is neither encrypted nor authenticated: anybody on "
            "its network can run code on the workers and here. Give it a tls:// address (distributed.comm.tls in "
            "Dask's configuration names the certificates), or accept that with --insecure."
        )
    import dask
    from distributed import Client

    # A worker that dies is replaced; what it did is tried again here, not by the scheduler, which keeps a short diary.
    with dask.config.set({"distributed.scheduler.allowed-failures": 0, "distributed.admin.log-length": 500}):
        try:
            client = Client(address, timeout=_PATIENCE)
        except (OSError, ValueError, TypeError) as error:
            raise InputError(f"No Dask scheduler answers at {address!r}: {error}") from error
        with client:
            # Workers that died are replaced after a while.
            try:
                client.wait_for_workers(1, timeout=_PATIENCE)
            except TimeoutError as error:
                said = f"The Dask scheduler at {address!r} has no workers. Start some: dask worker {address}"
                raise InputError(said) from error
            if heard is not None and "dashboard" in client.scheduler_info()["services"]:
                heard(client.dashboard_link)
            yield _Cluster(client)


def _stream(
    crew: _Crew, work: Work, cases: Iterator[tuple[str, Any]], seed: int, limit: float | None
) -> Iterator[Outcome]:
    running: dict[int, tuple[str, Any, int, float]] = {}
    keys = count()
    lost: deque[Outcome] = deque()

    def submit(name: str, case: Any, tries: int) -> None:
        key = next(keys)
        running[key] = name, case, tries, time.perf_counter()
        try:
            crew.submit(key, attempt, work, name, case, *(case_seed(seed, name), limit, True))
        except Exception as error:
            # The case cannot be sent.
            del running[key]
            lost.append(Outcome(name, 0.0, None, f"{type(error).__name__}: {error}", traceback.format_exc()))

    # No more at once than there are workers: a case that takes its worker down harms no other that waits there.
    for name, case in islice(cases, crew.room()):
        submit(name, case, 1)
    while running or lost:
        outcome = lost.popleft() if lost else _ended(crew, running, submit, limit)
        if outcome is None:
            continue
        if (following := next(cases, None)) is not None:
            submit(*following, 1)
        yield outcome


def _ended(
    crew: _Crew, running: dict[int, tuple[str, Any, int, float]], submit: Callable[[str, Any, int], None],
    limit: float | None,
) -> Outcome | None:  # fmt: skip
    """Return the outcome of the case that ends next, None where its worker died and it is tried again."""
    key, returned = crew.next()
    name, case, tries, start = running.pop(key)
    seconds = time.perf_counter() - start
    try:
        return returned()
    except Died:
        # A process that does not heed its limit ends itself; one that died sooner may have died of the case before,
        # behind which this one waited.
        if tries < _TRIES and (limit is None or seconds < limit + _GRACE):
            submit(name, case, tries + 1)
            return None
        return Outcome(name, seconds, None, "WorkerDied: its process crashed, or took too much memory or time")
    except Exception as error:
        # The case or its outcome could not be sent.
        return Outcome(name, seconds, None, f"{type(error).__name__}: {error}", traceback.format_exc())
