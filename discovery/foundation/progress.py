"""What long work tells on its way: one sentence, and, where it is known, how long it still takes."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from datetime import datetime, timedelta
from typing import Self, TypeVar

from discovery.foundation.arguments import check_callable

_Item = TypeVar("_Item")

#: What every function with an argument ``progress`` calls with one sentence, most often a `Progress`.
Tell = Callable[[str], None]
#: Less than this is not worth a word [s].
_SOON = 1.0
#: Up to here a time is said in seconds, in minutes beyond [s].
_MINUTES = 120.0


class Progress(str):
    """One sentence on what is being done, which also holds how far it is.

    `text`: the sentence. `done`, `total`: work done and work in all, in what the sentence counts; NaN where it is not
    known. `seconds_left`: how long it still takes at the pace so far [s]; NaN where it is not known.

    Examples
    --------
    >>> told = Progress.counting("fitting", 2, 8, "models", seconds_left=12.0)
    >>> told.partition(", until")[0], told.done / told.total
    ('fitting: 2 of 8 models, about 12 s left', 0.25)
    """

    done: float
    total: float
    seconds_left: float

    def __new__(
        cls, text: str, *, done: float = math.nan, total: float = math.nan, seconds_left: float = math.nan
    ) -> Self:
        """Return the sentence with its numbers."""
        told = super().__new__(cls, text)
        told.done, told.total, told.seconds_left = float(done), float(total), float(seconds_left)
        return told

    @classmethod
    def counting(
        cls, doing: str, done: float, total: float, unit: str, *, beside: str = "", seconds_left: float = math.nan
    ) -> Self:
        """Return the sentence of work that is counted, with the time left where it is known."""
        left = _left(seconds_left) if _SOON < seconds_left < math.inf else ""
        text = f"{doing}: " + ", ".join(filter(None, (f"{done:.0f} of {total:.0f} {unit}", beside, left)))
        return cls(text, done=done, total=total, seconds_left=seconds_left)


class Counter:
    """Tells how much of equal pieces of work is done, and how long the rest takes at the pace since it was made."""

    def __init__(self, tell: Tell, doing: str, total: int, unit: str) -> None:
        self._tell, self._doing, self._total, self._unit = tell, doing, total, unit
        self._began = time.monotonic()

    def told(self, done: int, beside: str = "") -> None:
        """Tell that so many pieces are done, and something beside it; before the first, no time is known."""
        left = (time.monotonic() - self._began) / done * (self._total - done) if done else math.nan
        counting = Progress.counting(self._doing, done, self._total, self._unit, beside=beside, seconds_left=left)
        self._tell(counting)


def counted(items: Sequence[_Item], tell: Tell, doing: str, unit: str) -> Iterator[_Item]:
    """Yield items of work, and tell before each how many are done."""
    counter = Counter(tell, doing, len(items), unit)
    for done, item in enumerate(items):
        counter.told(done)
        yield item


def silent(_: str) -> None:
    """Tell nobody."""


def teller(progress: Tell | None) -> Tell:
    """Return what is told on the way: None means nobody is, and what cannot be called is refused."""
    check_callable(progress, "progress")
    return silent if progress is None else progress


def _left(seconds: float) -> str:
    """Return how long something still takes, and the time of day at which it is done."""
    long = f"{seconds:.0f} s" if seconds < _MINUTES else f"{seconds / 60:.0f} min"
    return f"about {long} left, until {datetime.now() + timedelta(seconds=seconds):%H:%M:%S}"


class Course:
    """Tells what a loop does, and during its search the share of its budget of work that is spent.

    A search ends when nothing more is accepted. So no time is said for the whole of it, but what one set takes.
    """

    def __init__(self, tell: Tell) -> None:
        self._tell = tell
        self._extended: Callable[[], int] = int
        self._most, self._began = 0, 0.0
        self._done, self._took = 0, 0.0

    @contextmanager
    def searching(self, extended: Callable[[], int], most: int) -> Iterator[None]:
        """Tell beside every sentence how many sets, of so many at most, are `extended` by now."""
        self._extended, self._most, self._began = extended, most, time.monotonic()
        self._done = 0
        try:
            yield
        finally:
            self._most = 0

    def __call__(self, sentence: str) -> None:
        """Tell what is being done."""
        done = self._extended()
        if not (self._most and done):
            self._tell(sentence)
            return
        if done < self._done:  # the search has begun again
            self._began, self._done = time.monotonic(), 0
        if done > self._done:  # time that the next set has taken is none of these
            self._done, self._took = done, time.monotonic() - self._began
        each = self._took / done
        took = f", about {each:.0f} s each" if each >= 1 else ""
        self._tell(
            Progress(f"{sentence}; {done} of at most {self._most} sets are extended{took}", done=done, total=self._most)
        )
