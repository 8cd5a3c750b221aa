"""A rig file as it is written: the lines of its keys, and the places that are still marked FILL IN."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

_MARKED = re.compile(r"(?:\s*(?P<key>[\w.]+)\s*=[^#]*#.*?|\s*#\s*)\bFILL IN:?\s*(?P<what>[^;]*)")


@dataclass(frozen=True)
class RigText:
    """Path and text of a rig file; as a string it is the beginning of a message.

    Examples
    --------
    >>> file = RigText(Path("rig.toml"), "mass = 1.0   # FILL IN what you weigh; a guess")
    >>> file.at("mass"), file.unfilled
    ('The rig file rig.toml, line 1', ('line 1, mass: what you weigh',))
    """

    path: Path
    text: str

    def __str__(self) -> str:
        return f"The rig file {self.path}"

    def at(self, *keys: str) -> str:
        """Name the file and the line of the innermost of nested keys that can be found, else the line ``?``."""
        lines = self.text.splitlines()
        position, found = 0, 0
        for key in keys:
            pattern = re.compile(
                rf"(?:\A\s*\[+\s*(?:\w+\.)*|\A\s*|[{{,.]\s*)[\"']?{re.escape(key)}[\"']?\s*(?:=|\]|\.)"
            )
            for number in range(position, len(lines)):
                if pattern.search(lines[number].split("#", 1)[0]):
                    position, found = number, number + 1
                    break
        return f"{self}, line {found or '?'}"

    @property
    def unfilled(self) -> tuple[str, ...]:
        """What is marked with FILL IN: its line, key, and what is to be written there."""
        lines = ((number, _MARKED.match(line)) for number, line in enumerate(self.text.splitlines(), 1))
        return tuple(f"line {number}{_words(marked)}" for number, marked in lines if marked)


def _words(marked: re.Match[str]) -> str:
    what = marked["what"].strip()
    return (f", {marked['key']}" if marked["key"] else "") + (f": {what}" if what else "")
