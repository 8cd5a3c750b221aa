"""What a drafted rig file says of its recordings: their lines, their trials, and the columns that it leaves out."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Collection, Iterator, Sequence
from pathlib import Path

import numpy as np

from discovery.drafting.names import meaning_of
from discovery.drafting.signals import Signals, open_table
from discovery.foundation.arrays import FloatArray
from discovery.foundation.errors import InputError
from discovery.foundation.io import Table

#: What is said of a column, or of several, with one number in each recording.
DIFFERS = "is held, and differs between recordings", "are held, and differ between recordings"
#: Of a step, by which the steps of a counter may differ.
_EVEN = 0.05
#: Readings before anything drives it that tell whether it moves; standard errors of a rate, and of the largest one what
#: is none.
_STILL, _SURE, _LITTLE = 10, 2.0, 0.05


def quoted_text(value: str) -> str:
    """Return a text as it is written in a rig file."""
    return json.dumps(value, ensure_ascii=False)


def begins_at_rest(found: Signals) -> bool:
    """Whether nothing moves where a recording begins, for as long as its input does not either, or friction holds it.

    A rate that the first readings leave open must be little beside those of the motion that follows.
    """
    if found.input is None:
        return False
    given, read, time = found.input.values, found.output.values, found.seconds
    changed = np.flatnonzero(given != given[0])
    count = int(changed[0]) if changed.size else 0
    if abs(given[0]) <= _LITTLE * np.nanmax(np.abs(given)):
        left_where = np.flatnonzero(read != read[0])  # equal readings, in steps of an encoder, outlast a first push
        count = max(count, int(left_where[0]) if left_where.size else 0)
    if count < _STILL or not np.isfinite(first := read[:count]).all():
        return False
    lasts = float(time[count - 1] - time[0])
    fresh = count if found.renewed is None else min(count, int(lasts * found.renewed.rate))
    if fresh < _STILL:
        return False
    noise, step = found.noise
    if found.reads == "speed":
        return bool(abs(first.mean()) + _SURE * noise / np.sqrt(fresh) <= _LITTLE * np.nanmax(np.abs(read)))
    slope = abs(np.polyfit(time[:count] - time[0], first, 1)[0])
    left = max(_SURE * noise * np.sqrt(12.0 / fresh), step) / lasts
    fastest = np.nanmax(np.abs(read[count:] - read[:-count]), initial=0.0) / (lasts * count / (count - 1))
    return bool(slope + left <= _LITTLE * fastest)


def record_lines(
    files: Sequence[Path],
    holdout: Sequence[Path],
    folder: Path,
    which: Sequence[str] = (),
    rests: Collection[Path] = (),
) -> Iterator[str]:
    """Yield the table of recordings; of a single file, `which` picks the rows of each trial; some begin at rest."""

    def seen(path: Path) -> str:
        return Path(os.path.relpath(path.resolve(), folder.resolve())).as_posix()

    def parts(paths: Sequence[Path], rows: Sequence[str]) -> str:
        still = {path: ", at_rest = true" if path in rests and not which else "" for path in paths}
        return ", ".join(f"{{ file = {quoted_text(seen(p))}{still[p]}{part} }}" for p in paths for part in rows)

    yield "[records]"
    if rests and not which:
        yield "# at_rest is guessed: before its input changes nothing moves. Remove it where that is wrong"
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
    key = column if re.fullmatch(r"[A-Za-z0-9_-]+", column) else quoted_text(column)
    return [f", where = {{ {key} = {value} }}" for value in said]


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


def unused_words(found: Signals, named: Collection[str] = ()) -> str:
    """Name the columns that are left, and of which ones nothing but the user can tell whether they have a role.

    Of the roles ``"input"`` and ``"output"``, the user `named` the columns of some: those are no longer asked for.
    """
    loose = [] if {"input", "output"} <= {*named} else _varying(found)
    said = [", ".join(name for name in found.unused if name.strip() and name not in {*found.still, *loose})[:300]]
    if loose:
        said.append(f"{', '.join(loose)[:300]} ({_roles(len(loose) == 1, named)})")
    return ", ".join(filter(None, [*said, *_held(found)]))


def _roles(alone: bool, named: Collection[str]) -> str:
    """Say with which options columns that vary are given a role."""
    options = {"input": "with --input if it drives", "output": "with --output if it is the motion"}
    asked = ", or ".join(text for role, text in options.items() if role not in named)
    return f"{'varies: name it' if alone else 'vary: name one'} {asked}"


def _held(found: Signals) -> Iterator[str]:
    """Yield what is said of the columns that never change in a recording."""
    for differs, one, several in ((False, "never changes", "never change"), (True, *DIFFERS)):
        names = [name for name in found.still if (name in found.differ) is differs]
        if names:
            say = f"{one}: name it" if len(names) == 1 else f"{several}: name one"
            yield f"{', '.join(names)[:300]} ({say} with --input if it drives)"


def _varying(found: Signals) -> list[str]:
    """Return the columns left that may be an input or an output: numbers that change, no times, counters or trials."""
    table = open_table(found.path)[0]
    trial = _trials(table, found.seconds, found.unused)[0]
    names = []
    for name in found.unused:
        meaning = meaning_of(name)
        role = meaning.role
        if (role in ("time", "other") and not meaning.lasts) or name in found.still or name == trial:
            continue
        try:
            values = table.numbers(name)
        except InputError:
            continue
        steps = np.diff(values)
        if meaning.lasts and (steps > 0.0).all():  # a clock; a pulse lasts now longer, now shorter
            continue
        counts = role == "" and steps.size > 0 and bool((np.abs(steps - steps[0]) <= _EVEN * abs(steps[0])).all())
        if np.isfinite(values).any() and not counts:
            names.append(name)
    return names
