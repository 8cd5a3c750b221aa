"""Work on processes of this machine, by pipes that nobody else can open: there is no port, and no code from outside."""

from __future__ import annotations

import multiprocessing
import os
import pickle
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection, wait
from typing import Any


class Died(Exception):
    """A process ended before it had done its work."""


class Pool:
    """Processes that do one piece of work each at a time; one is started where none waits for work.

    At most so many work at once. The environment holds variables of theirs, beside those of this process.
    """

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
        """Return the key of the work that is done next, and a function that returns its result.

        That function raises what the work raised, or `Died`.
        """
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

    def end(self) -> None:
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


@contextmanager
def pool(size: int, environment: dict[str, str]) -> Iterator[Pool]:
    """Yield a `Pool`, all of whose processes end with the block."""
    made = Pool(size, environment)
    try:
        yield made
    finally:
        made.end()


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
