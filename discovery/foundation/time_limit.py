"""Work that ends when its time is up, wherever it is then."""

from __future__ import annotations

import math
import signal
from collections.abc import Iterator
from contextlib import contextmanager

#: An alarm that nobody could hear, as within a callback of a compiled library, rings again after so many seconds.
_AGAIN = 10.0


class TimeIsUp(KeyboardInterrupt):
    """The time for a piece of work is over: it is interrupted as by Ctrl-C."""


@contextmanager
def time_limit(seconds: float = math.inf) -> Iterator[None]:
    """Interrupt what is done in a context after some seconds; only in the main thread, where they are finite.

    Raises TimeIsUp when the time is over; at once where there is none.
    """
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
