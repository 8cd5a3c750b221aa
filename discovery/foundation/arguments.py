"""What a caller passes by mistake is refused with a sentence at the door, not by an exception from inside."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Mapping
from dataclasses import fields
from numbers import Integral, Real
from pathlib import Path
from typing import TYPE_CHECKING, Any, SupportsFloat

from discovery.foundation.errors import InputError, suggestion

if TYPE_CHECKING:
    from numpy.random import Generator


def expect(given: object, kind: type, name: str, remedy: str) -> None:
    """Refuse an argument of another kind; the remedy says how the right one is made, as a sentence."""
    if not isinstance(given, kind):
        article = "an" if kind.__name__[0] in "AEIO" else "a"
        raise _refused(given, name, _KINDS.get(kind, f"{article} {kind.__name__}"), remedy)


#: Kinds of Python in words.
_KINDS: dict[type, str] = {str: "text", bool: "True or False", Mapping: "a mapping"}


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


def as_folder(given: Any, name: str, remedy: str) -> Path:
    """Return a folder that was given by its path, and is made if need be."""
    folder = as_path(given, name, remedy)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"`{name}` is a folder, but {folder} cannot be one: {error.strerror}. {remedy}") from None
    return folder


def as_words(given: Any, name: str, remedy: str) -> tuple[str, ...]:
    """Return names: one alone is taken as a list of one; what is no name and no list of them is refused."""
    found = tuple(given) if isinstance(given, Iterable) and not isinstance(given, str) else (given,)
    for word in found:
        if not isinstance(word, str):
            raise _refused(word, name, "a list of names", remedy)
    return found


def check_names(given: Iterable[object], known: Iterable[str], owner: str, what: str) -> None:
    """Refuse names that nothing has: a slip of the pen would be passed over.

    `owner` has those that are known, as in "The model", and `what` says what they are, as in "parameter". The message
    has those that there are, and the nearest one.
    """
    there = list(known)
    strangers = [str(name) for name in given if name not in there]
    if strangers:
        listed = f"it has {', '.join(there)}" if there else "it has none"
        near = suggestion(strangers[0], there)
        raise InputError(f"{owner} has no {what} {', '.join(sorted(strangers))}; {listed}.{near}")


def check_keys(given: object, wanted: Iterable[str], name: str, remedy: str) -> None:
    """Refuse what is no mapping with all of these keys."""
    expect(given, Mapping, name, remedy)
    missing = [key for key in wanted if key not in given]  # type: ignore[operator]
    if missing:
        raise InputError(f"`{name}` lacks {', '.join(missing)}. {remedy}")


def check_number(
    given: Any, name: str, least: float = -math.inf, most: float = math.inf, *, above: float = -math.inf
) -> float:
    """Return a finite number from `least` to `most`, larger than `above`; anything else is refused."""
    scalar = isinstance(given, Real) or (isinstance(given, SupportsFloat) and not isinstance(given, str))
    fits = scalar and not isinstance(given, bool) and getattr(given, "ndim", 0) == 0
    if not fits or not math.isfinite(number := float(given)) or not least <= number <= most or number <= above:
        raise InputError(f"`{name}` is a number{_range(least, most, above)}, but it is {given!r:.60}.")
    return number


def check_whole(given: Any, name: str, least: float = -math.inf, most: float = math.inf) -> int:
    """Return a whole number within a range; anything else is refused."""
    if not isinstance(given, Integral) or isinstance(given, bool) or not least <= int(given) <= most:
        raise InputError(f"`{name}` is a whole number{_range(least, most)}, but it is {given!r:.60}.")
    return int(given)


def _range(least: float, most: float, above: float = -math.inf) -> str:
    """Say the range of a number."""
    if math.isfinite(above):
        return f" above {above:g}" + (f" and at most {most:g}" if math.isfinite(most) else "")
    if math.isfinite(most):
        return f" from {least:g} to {most:g}" if math.isfinite(least) else f" of at most {most:g}"
    return f" from {least:g} on" if math.isfinite(least) else ""


def check_pair(given: Any, name: str, what: str) -> tuple[float, float]:
    """Return two finite numbers, such as a deflection and a rate; anything else is refused."""
    try:
        first, second = given
        return check_number(first, name), check_number(second, name)
    except (TypeError, ValueError, InputError):
        raise InputError(f"`{name}` is a pair of numbers, {what}, but it is {given!r:.60}.") from None


def check_seed(seed: object) -> None:
    """Refuse what is no seed of random numbers: an integer that is not negative."""
    integer = hasattr(seed, "__index__") and not isinstance(seed, bool)
    if not integer or seed.__index__() < 0:  # type: ignore[attr-defined]
        raise InputError(f"`seed` is an integer from 0 on, but it is {seed!r:.60}.")


def as_generator(seed: Any) -> Generator:
    """Return the source of random numbers of a seed; one that is given is used as it is."""
    import numpy as np

    if isinstance(seed, np.random.Generator):
        return seed
    check_seed(seed)
    return np.random.default_rng(seed)


def check_callable(given: object, name: str) -> None:
    """Refuse what cannot be called with a sentence on the progress; None means nobody is told."""
    if given is not None and not callable(given):
        raise InputError(f"`{name}` is a function of one sentence, such as print, but it is {given!r:.60}.")


def check_fields(settings: Any) -> None:
    """Refuse a field of a dataclass that is unlike its default, negative, or beyond the ``range`` of its metadata.

    ``range`` is (least, most) and may be followed by what the number is larger than. Every field has a default.
    """
    for known in fields(settings):
        given, default = getattr(settings, known.name), known.default
        if isinstance(default, float):
            least, most, *above = known.metadata.get("range", (0.0, float("inf")))
            check_number(given, known.name, least, most, **({"above": above[0]} if above else {}))
        elif isinstance(default, int) and not isinstance(default, bool):
            check_seed(given) if known.name == "seed" else check_whole(given, known.name, 0)
        else:
            expect(given, type(default), known.name, f"Give one, such as {default!r:.60}.")
