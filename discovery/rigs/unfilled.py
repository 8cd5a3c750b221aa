"""Places of a drafted rig file that are still marked FILL IN."""

from __future__ import annotations

import re

__all__ = ["unfilled"]

_MARKED = re.compile(r"(?:\s*(?P<key>[\w.]+)\s*=[^#]*#.*?|\s*#\s*)\bFILL IN:?\s*(?P<what>[^;]*)")


def unfilled(text: str) -> tuple[str, ...]:
    """Return what a rig file marks with FILL IN: its line, key, and what is to be written there.

    Examples
    --------
    >>> unfilled("mass = 1.0   # FILL IN what you weigh; a guess")
    ('line 1, mass: what you weigh',)
    """
    lines = ((number, _MARKED.match(line)) for number, line in enumerate(text.splitlines(), 1))
    return tuple(f"line {number}{_words(marked)}" for number, marked in lines if marked)


def _words(marked: re.Match[str]) -> str:
    what = marked["what"].strip()
    return (f", {marked['key']}" if marked["key"] else "") + (f": {what}" if what else "")
