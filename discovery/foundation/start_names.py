"""Names of the numbers that a fit has of every recording: ``delta_0_init[RECORDING]``, ``rate_0_init[RECORDING]``."""

from __future__ import annotations

import re

_START = re.compile(r"(\w+)_0_init\[(.*)\]", re.DOTALL)
_WORDS = {"delta": "deflection", "rate": "rate"}


def start_name(quantity: str, recording: str) -> str:
    """Return the name of what a recording begins with: "delta", "rate", or a parameter that is its own."""
    return f"{quantity}_0_init[{recording}]"


def start_of(name: str) -> tuple[str, str] | None:
    """Return quantity and recording of such a name; None of another one.

    Examples
    --------
    >>> start_of(start_name("rate", "high")), start_of("alpha")
    (('rate', 'high'), None)
    """
    found = _START.fullmatch(name)
    return (found[1], found[2]) if found else None


def is_start(name: str) -> bool:
    """Return whether a fitted or sampled number belongs to the start of a recording."""
    return _START.fullmatch(name) is not None


def start_word(quantity: str) -> str:
    """Return what users call the quantity of such a name."""
    return _WORDS.get(quantity, quantity)


def is_state(quantity: str) -> bool:
    """Return whether such a quantity is what a recording begins with, and no parameter that is its own."""
    return quantity in _WORDS


def start_words(name: str) -> str:
    """Return an initial state, or what else a recording has of its own, in words; another name as it is.

    Examples
    --------
    >>> start_words("rate_0_init[high]"), start_words("psi_0_init[high]"), start_words("alpha")
    ('rate at the start of high', 'psi of high', 'alpha')
    """
    if not (found := start_of(name)):
        return name
    quantity, recording = found
    return f"{start_word(quantity)} {'at the start of' if is_state(quantity) else 'of'} {recording}"
