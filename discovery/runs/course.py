"""How far a loop is: what it tells of its search, whose length nobody knows before it ends."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sized
from contextlib import contextmanager

from discovery.foundation.progress import Progress, Tell


class Course:
    """Tells what a loop does, and during its search the share of its budget of work that is spent.

    A search ends when nothing more is accepted. So no time is said for the whole of it, but what one set takes.
    """

    def __init__(self, tell: Tell) -> None:
        self._tell = tell
        self._extended: Sized = ()
        self._most, self._began = 0, 0.0

    @contextmanager
    def searching(self, extended: Sized, most: int) -> Iterator[None]:
        """Tell beside every sentence how many sets, of so many at most, are extended; their collection grows."""
        self._extended, self._most, self._began = extended, most, time.monotonic()
        try:
            yield
        finally:
            self._most = 0

    def __call__(self, sentence: str) -> None:
        """Tell what is being done."""
        done = len(self._extended)
        if not (self._most and done):
            self._tell(sentence)
            return
        each = (time.monotonic() - self._began) / done
        took = f", about {each:.0f} s each" if each >= 1 else ""
        self._tell(
            Progress(f"{sentence}; {done} of at most {self._most} sets are extended{took}", done=done, total=self._most)
        )
