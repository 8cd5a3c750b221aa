"""What a caller passes by mistake is refused with a sentence at the door, not by an exception from inside."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from discovery.foundation.errors import InputError

__all__ = ["as_path", "as_paths", "check_callable", "check_seed", "expect"]


def expect(given: object, kind: type, name: str, remedy: str) -> None:
    """Refuse an argument of another kind.

    Parameters
    ----------
    given : object
        What the caller passed.
    kind : type
        What it must be.
    name : str
        Name of the argument.
    remedy : str
        How the right one is made, as a sentence.

    Raises
    ------
    InputError
        For anything else.
    """
    if not isinstance(given, kind):
        article = "an" if kind.__name__[0] in "AEIO" else "a"
        raise _refused(given, name, f"{article} {kind.__name__}", remedy)


def _refused(given: object, name: str, wanted: str, remedy: str) -> InputError:
    shown = " ".join(repr(given).split())
    return InputError(f"`{name}` is {wanted}, but {shown:.60} is of type {type(given).__name__}. {remedy}")


def as_path(given: Any, name: str, remedy: str) -> Path:
    """Return a path that was given as one or as text."""
    if not isinstance(given, (str, os.PathLike)):
        raise _refused(given, name, "a path", remedy)
    return Path(given)


def as_paths(given: Any, name: str, remedy: str) -> list[Path]:
    """Return paths: one alone is taken as a list of one."""
    listed = given if isinstance(given, Iterable) and not isinstance(given, (str, os.PathLike)) else (given,)
    return [as_path(path, name, remedy) for path in listed]


def check_seed(seed: object) -> None:
    """Refuse what is no seed of random numbers: an integer that is not negative."""
    integer = hasattr(seed, "__index__") and not isinstance(seed, bool)
    if not integer or seed.__index__() < 0:  # type: ignore[attr-defined]
        raise InputError(f"`seed` is an integer from 0 on, but it is {seed!r:.60}.")


def check_callable(given: object, name: str) -> None:
    """Refuse what cannot be called with a sentence on the progress; None means nobody is told."""
    if given is not None and not callable(given):
        raise InputError(f"`{name}` is a function of one sentence, such as print, but it is {given!r:.60}.")
