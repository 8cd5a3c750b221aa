"""Standard streams that are closed or full: what is computed and written does not suffer from it."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress

#: Why standard output could not be written, while there was more to do.
_LOST: list[OSError] = []


def open_streams() -> None:
    """Open standard streams that the caller has closed: the next file would take their place, and get their text."""
    for descriptor in range(3):
        try:
            os.fstat(descriptor)
        except OSError:
            # The lowest number that is free is given out.
            os.open(os.devnull, os.O_RDWR)
    for descriptor, name in ((1, "stdout"), (2, "stderr")):
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(descriptor, "w", encoding="utf-8"))


def is_of_output(error: OSError) -> bool:
    """Return whether an error arose where text was printed: the library of the command line writes nothing else."""
    place = error.__traceback__
    while place is not None and place.tb_next is not None:
        place = place.tb_next
    return place is not None and str(place.tb_frame.f_globals.get("__name__", "")).startswith("click.")


@contextmanager
def spoken() -> Iterator[None]:
    """Print before a command is done: without standard output it goes on, and `unwritten` tells why at its end."""
    try:
        yield
    except OSError as error:
        if not is_of_output(error):
            raise
        unwritten()
        _LOST.append(error)


def unwritten() -> OSError | None:
    """Return why standard output cannot be, or could not be written, if so; what waits for it is dropped then."""
    try:
        if sys.stdout is not None:
            sys.stdout.flush()
    except (OSError, ValueError) as error:
        # Else the interpreter would try again when it ends, and end with a status of its own.
        with suppress(OSError, ValueError):
            nothing = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nothing, sys.stdout.fileno())
            os.close(nothing)
        return error if isinstance(error, OSError) else OSError(str(error))
    return _LOST.pop() if _LOST else None
