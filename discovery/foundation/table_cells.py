"""The cells of a line of a table, and the names of columns that comments or a title above it hold."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from functools import partial
from itertools import takewhile

#: What parts columns that are set out with blanks.
BLANKS = r"\s+"
#: Units as headers have them below their names.
UNIT = re.compile(r"[\[(].*[\])]|-+")
#: What a column of times is called.
TIMES = ("t", "time", "tempo", "temps", "tiempo", "zeit")
#: How a line of names begins whose first column is the time.
_TIME = re.compile(rf"({'|'.join(TIMES)})\b", re.IGNORECASE)
#: The unit of a time, as names have it.
_TIMED = re.compile(r"[\[(](s|ms|us|min)[\])]")
#: Words of sentences, which name no column.
_SAID = {"a", "and", "at", "by", "for", "from", "in", "is", "of", "on", "the", "to", "was", "with"}


def cells_of(row: str, separator: str) -> list[str]:
    """Return the cells of a row."""
    if separator == BLANKS:
        return row.split()
    return [cell.strip() for cell in next(csv.reader([row], delimiter=separator))]


def commented_names(above: Sequence[str], separator: str, first: Sequence[str]) -> list[str]:
    """Return the names of columns in the comments right above a first row of numbers; none where they name others.

    A line of units may stand below them. A title right above may hold the names as well, that of the time among them,
    parted by another mark than the numbers are: by commas where those have tabs between them.
    """
    if not all(map(is_either_number, first)):
        return []
    title = next((line.strip() for line in reversed(above) if line.strip()), "#")
    for names in [cells_of(title, mark) for mark in ",;\t"] if title[0] not in "#%" else []:
        named = len(names) == len(first) > 1 and all(names) and not any(map(is_either_number, names))
        if named and any(_TIME.match(name) or _TIMED.search(name) for name in names):
            return names
    comments = list(takewhile(lambda line: line[:1] in ("#", "%"), map(str.strip, reversed(above))))
    lines = [comment.lstrip("#% \t") for comment in comments]
    # Columns may be set out with blanks in the comments alone, but a sentence names none.
    for cells in (partial(cells_of, separator=separator), _set_out):
        units: list[str] = []
        for names in map(cells, lines):
            if len(names) == len(first) and not any(map(is_either_number, names)):
                if units or names[0][:1] not in ("[", "(") or not all(map(UNIT.fullmatch, names)):
                    return [f"{name} {unit}" for name, unit in zip(names, units, strict=True)] if units else names
                units = names
        if units:
            return units
    return []


def _set_out(line: str) -> list[str]:
    """Return names that blanks part: several, or single ones where the first is the time; none of a sentence."""
    parts = re.split(r"\s{2,}", line)
    names = parts if len(parts) > 1 else line.split() if _TIME.match(line) else []
    words = {name.lower() for name in names}
    is_said = words & _SAID or any(name.endswith((".", ":")) or UNIT.fullmatch(name) for name in names)
    return [] if is_said else names


def is_either_number(text: str) -> bool:
    """Say whether a text is a number, with a point or a comma before its decimals."""
    return is_number(text.replace(",", "."))


def is_number(text: str) -> bool:
    """Say whether a text is a number as programs write one."""
    try:
        float(text)
    except ValueError:
        return False
    return True
