"""Notes on several recordings that tell of the same fault."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import TypeVar

__all__ = ["by_fault"]

_Detail = TypeVar("_Detail")


def by_fault(
    notes: Mapping[str, Iterable[str]], told: Callable[[str], tuple[str, _Detail] | None]
) -> dict[str, list[tuple[str, _Detail]]]:
    """Return who has a fault, by fault: names of recordings, with what each note says besides.

    Parameters
    ----------
    notes : mapping of str to iterable of str
        By name of the recording.
    told : callable
        Returns the fault that a note tells of and what it says besides; None if it tells of another matter.
    """
    faults: dict[str, list[tuple[str, _Detail]]] = {}
    for name, its in notes.items():
        for found in filter(None, map(told, its)):
            faults.setdefault(found[0], []).append((name, found[1]))
    return faults
