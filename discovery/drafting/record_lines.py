"""The lines of a drafted rig file that name its recordings, and the trials in them."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from discovery.drafting.signals import Signals, open_table
from discovery.foundation.arrays import FloatArray
from discovery.foundation.errors import InputError
from discovery.foundation.io import Table


def quoted_text(value: str) -> str:
    """Return a text as it is written in a rig file."""
    return json.dumps(value, ensure_ascii=False)


def record_lines(
    files: Sequence[Path], holdout: Sequence[Path], folder: Path, which: Sequence[str] = ()
) -> Iterator[str]:
    """Yield the table of recordings; of a single file, `which` picks the rows of each trial."""

    def parts(paths: Sequence[Path], rows: Sequence[str]) -> str:
        return ", ".join(f"{{ file = {quoted_text(_from(folder, path))}{part} }}" for path in paths for part in rows)

    yield "[records]"
    kept = which[-1:] if which and not holdout else []
    if which:
        yield "# guessed: the times begin again with each trial" + (", and the last one judges" if kept else "")
    yield f"train = [{parts(files, which[: len(which) - len(kept)] or [''])}]"
    if holdout or kept:
        yield f"holdout = [{parts(holdout or files, kept or [''])}]   # never fitted"
    else:
        yield "# Without a hold-out the last third of each is kept out of the fit. Another motion judges better:"
        yield '# holdout = [{ file = "another.csv" }]'


def trial_rows(found: Signals) -> list[str]:
    """Return how the rows of each trial of a file are picked."""
    column, values = _trials(open_table(found.path)[0], found.seconds, found.unused)
    said = (quoted_text(value) if isinstance(value, str) else f"{value:.12g}" for value in values)
    return [f", where = {{ {_key(column)} = {value} }}" for value in said]


def trial_column(found: Signals) -> str:
    """Return the column that tells the trials of a file apart; empty where none does."""
    return _trials(open_table(found.path)[0], found.seconds, found.unused)[0]


def _key(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else quoted_text(name)


def _from(folder: Path, path: Path) -> str:
    """Name a file as seen from a folder."""
    return Path(os.path.relpath(path.resolve(), folder.resolve())).as_posix()


def _trials(table: Table, time: FloatArray, names: Sequence[str]) -> tuple[str, list[str | float]]:
    """Return the column that tells the trials of a file apart, and its values in their order; none of them otherwise.

    Its times [s] (n,) begin again with every trial. Of the columns `names`, one may hold for each a value of its own.
    """
    begins = np.flatnonzero(np.diff(time) <= 0.0) + 1
    if not begins.size:
        return "", []
    for name in names:
        try:
            cells: list[str | float] = table.numbers(name).tolist()
        except InputError:
            cells = [str(cell).strip() for cell in table.columns[name]]
        parts = [set(cells[part[0] : part[-1] + 1]) for part in np.split(np.arange(len(cells)), begins)]
        values = [value for part in parts for value in part]
        if all(len(part) == 1 for part in parts) and len(set(values)) == len(values):
            return name, values
    return "", []
