"""Tables in text files: separators, comments and headers found out, faults refused with their line."""

from __future__ import annotations

import re
import warnings
from collections import Counter
from collections.abc import Sequence
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from discovery.foundation.arrays import IntArray
from discovery.foundation.encoding import decoded
from discovery.foundation.errors import InputError
from discovery.foundation.table_cells import BLANKS, UNIT, cells_of, commented_names, is_either_number, is_number

#: Rows in which a decimal comma is looked for.
_LOOKED = 200
#: Numbers with the one decimal mark are rare where those with the other are so many times as many.
_RARE = 10
#: Characters of a row without anything in its cells, as spreadsheets write them.
_NOTHING = " \t,;\"'"
#: Lines of titles that a program may write above a table.
_TITLES = 5
#: What is done with a line that is no part of a table, and how many of its characters a message shows.
_AWAY, _SHOWN = "delete it or put # before it", 60
_COMMA = re.compile(r"[+-]?\d+,\d+(?:[eE][+-]?\d+)?")
#: May be a thousand or more as well as a number with three decimals.
_THOUSAND = re.compile(r"[+-]?[1-9]\d{0,2},\d{3}")
_OF_TIME = {"s", "ms", "us", "min", "sec", "msec", "second", "seconds"}


def parse_text(
    path: Path, text: str, header: Sequence[str] | None = None
) -> tuple[dict[str, npt.NDArray[Any]], IntArray]:
    """Read the columns of a text file: each by its name, shape (n,), and the line of each row in the file, from 1.

    Commas, semicolons, tabs or runs of blanks separate the columns; lines that begin with ``#`` or ``%`` are comments,
    and lines without anything in their cells are passed over.
    Where no comma separates columns, numbers may have a decimal comma. Where the first row holds numbers, the comment
    above it may name the columns, and so may `header`, from left to right. Lines of titles may stand above all of it,
    and a line of units, that of time among them, below the names.

    Raises InputError if the file is no table: empty, without names or with names given twice, or with rows that do not
    have the cells that the names ask for.
    """
    every = text.splitlines()
    stripped = ((number, line.strip()) for number, line in enumerate(every, 1))
    lines = np.array([n for n, line in stripped if line.strip(_NOTHING) and line[0] not in "#%"], np.int64)
    if lines.size == 0:
        raise InputError(f"{path} is empty but for comments. Export the recording again.")
    rows = [every[number - 1] for number in lines]
    _check_quotes(path, lines, rows)
    titles = _titles(rows, header)
    rows, lines = rows[titles:], lines[titles:]
    separator = _separator(rows, header)
    first = cells_of(rows[0], separator)
    told = commented_names(every[: int(lines[0]) - 1], separator, first) if header is None else []
    names = list(header) if header is not None else told or first
    below = [*map(is_either_number, cells_of(rows[1], separator))] if len(rows) > 1 else []
    _check_names(f"{path}, line {lines[0]}", rows[0], names, first, given=header is not None, below=below)
    top = ""
    if header is None and not told:
        top, rows, lines = rows[0], rows[1:], lines[1:]
        if units := _units_below(rows, separator, len(names)):
            named = zip(names, units, strict=True)
            names = [name if re.search(rf"\b{re.escape(unit)}\b", name) else f"{name} [{unit}]" for name, unit in named]
            rows, lines = rows[1:], lines[1:]
    if not rows:
        raise InputError(f"{path} has a header and no data rows: it is empty. Export the recording again.")
    _check_cells(path, lines, rows, separator, len(names), top)
    _check_marks(path, lines, rows, separator)
    return _read(path, rows, separator, names), lines


def unnamed_columns(path: Path) -> tuple[str, ...]:
    """Return names c1, c2, ... for the columns of a text file that begins with numbers; empty where names are given."""
    try:
        found = decoded(path.read_bytes())
    except (OSError, ValueError):  # told where the file is read
        return ()
    every = [] if found is None else [line.strip() for line in found[0].splitlines()]
    numbers = [number for number, line in enumerate(every) if line and line[0] not in "#%"][: _TITLES + 2]
    if not numbers:
        return ()
    titles = _titles([every[number] for number in numbers], None)
    rows = [every[number] for number in numbers[titles : titles + 2]]
    separator = _separator(rows, None)
    cells = cells_of(rows[0], separator)
    # There may be a mark behind the last column.
    numbered = all(map(is_either_number, cells[:-1] if cells[-1] == "" else cells))
    named = not numbered or commented_names(every[: numbers[titles]], separator, cells)
    return () if named else tuple(f"c{number}" for number in range(1, len(cells) + 1))


def _separator(rows: Sequence[str], header: Sequence[str] | None) -> str:
    """Return a comma, a semicolon, a tab or the pattern of blanks."""
    first = rows[0]
    for separator in (";", "\t", BLANKS):
        # In a row of numbers with decimal commas, commas are the most frequent mark.
        cells = cells_of(first, separator)
        if len(cells) > 1 and any(map(_COMMA.fullmatch, cells)) and all(map(is_either_number, cells)):
            return separator
    separator = max(",;\t", key=first.count)
    wanted = len(header) if header is not None else len(rows[min(1, len(rows) - 1)].split())
    found = first.count(separator) + 1
    alone = found == wanted if header is not None else found > 1
    return BLANKS if not alone and 1 < wanted == len(first.split()) else separator


def _titles(rows: Sequence[str], header: Sequence[str] | None) -> int:
    """Return how many lines of titles stand above a first row of numbers, or above the names of its columns."""
    for above in range(min(_TITLES, len(rows) - 2) + 1):
        separator = _separator(rows[above : above + 2], header)
        *titles, names, first = (cells_of(row, separator) for row in rows[: above + 2])
        # There may be a mark behind the last column.
        names, first = (cells[:-1] if cells[-1:] == [""] else cells for cells in (names, first))
        if len(names) == len(first) > 1 and all(map(is_either_number, first)):
            if not any(map(is_either_number, names)):
                return above if all(sum(map(bool, title)) < len(names) for title in titles) else 0
            unnamed = all(map(is_either_number, names))
            return above if unnamed and all(_is_title(title, len(names), separator) for title in titles) else 0
    return 0


def _is_title(cells: Sequence[str], columns: int, separator: str) -> bool:
    """Say whether cells are a title above unnamed numbers: a single one, else words between blanks.

    What has marks between its cells may be names of columns, or a row with decimal commas; numbers alone are a row.
    """
    numbers, size = sum(map(is_either_number, cells)), len(cells)
    return size == 1 or (separator == BLANKS and (numbers < size < columns or (numbers == 0 and size > columns)))


def _units_below(rows: Sequence[str], separator: str, columns: int) -> list[str]:
    """Return the units in a line between the names of columns and a first row of numbers, one of them that of time."""
    words, first = (cells_of(row, separator) for row in rows[:2]) if len(rows) > 1 else ([], [])
    units = [word[1:-1] if UNIT.fullmatch(word) and len(word) > 2 else word for word in words]
    told = len(units) == columns > 1 and all(units) and any(unit.lower() in _OF_TIME for unit in units)
    return units if told and not any(map(is_either_number, units)) and all(map(is_either_number, first)) else []


def _decimal(rows: Sequence[str], separator: str) -> str:
    """Return the mark before the decimals: a comma where it stands in numbers that have no point, and no thousands."""
    if separator == ",":
        return "."
    pointed, marked = _marked(rows, separator)
    return "," if marked and not pointed else "."


def _marked(rows: Sequence[str], separator: str) -> tuple[list[tuple[int, str]], list[str]]:
    """Return numbers with a decimal point, each with its row, and those with a comma that marks no thousand."""
    cells = [(k, cell) for k, row in enumerate(rows[:_LOOKED]) for cell in cells_of(row, separator)]
    pointed = [(k, cell) for k, cell in cells if "." in cell and is_number(cell)]
    return pointed, [cell for _, cell in cells if _COMMA.fullmatch(cell) and not _THOUSAND.fullmatch(cell)]


def _check_marks(path: Path, lines: IntArray, rows: Sequence[str], separator: str) -> None:
    """Refuse the rare number with a decimal point among decimal commas."""
    if separator == ",":
        return
    pointed, marked = _marked(rows, separator)
    if pointed and _RARE * len(pointed) < len(marked):
        row, cell = pointed[0]
        raise InputError(
            f"{path}, line {lines[row]}: {cell!r} has a decimal point, and nearly all other numbers have a decimal "
            "comma. Write the same mark in all of them."
        )


def _check_quotes(path: Path, lines: IntArray, rows: Sequence[str]) -> None:
    """Refuse rows each of which stands between quotation marks as a whole: several numbers are one cell there."""
    last = rows[-1].strip()
    inside = last[1:-1]
    cells = re.split(r"[\t;,]", inside)
    single = last == f'"{inside}"' and '"' not in inside and not is_either_number(inside)
    if single and len(cells) > 1 and all(map(is_either_number, cells)):
        raise InputError(
            f"{path}, line {lines[-1]}: the whole line stands between quotation marks, which makes it a single cell: "
            f"{_quoted(last)}. Delete all quotation marks in an editor, or export the table again without them."
        )


def _check_names(
    where: str, row: str, names: Sequence[str], first: Sequence[str], *, given: bool, below: Sequence[bool]
) -> None:
    """Refuse a line that holds no names, as the row `below` it, of which cells are numbers, or names twice."""
    if not given and any(told := [*map(is_either_number, names)]) and (all(told) or told == below):
        raise InputError(
            f"{where}: the first line holds numbers, not column names. Add a header such as "
            "'time_s,motor_angle_rad,tip_x_m,tip_y_m', or for another system name the columns in the rig file, "
            'header = ["t", "y"] in [columns].'
        )
    if given and not any(map(is_either_number, first)):
        raise InputError(
            f"{where}: the first line holds names, not numbers, but the rig file gives a header: {_quoted(row)}. "
            f"Remove header from its [columns]; if it is a title, {_AWAY}."
        )
    duplicate = [name for name, count in Counter(names).items() if count > 1]
    if duplicate:
        raise InputError(f"{where}: two columns are named {duplicate[0]!r}. Rename or remove one of them.")


def _check_cells(path: Path, lines: IntArray, rows: Sequence[str], separator: str, columns: int, top: str) -> None:
    """Refuse rows of other cells than the names ask for; `top` is the line that was taken for them, if one was."""
    blanks = separator == BLANKS
    twice = bool(top) and not any(map(is_either_number, cells_of(rows[0], separator)))
    taken = f" Line {_quoted(top)} was taken for the names of the columns: if it is a title, {_AWAY}." if top else ""
    sizes = [len(row.split()) if blanks else row.count(separator) + 1 for row in rows]
    wide = sizes[: _TITLES + 1].count(columns)
    if 0 < wide <= _TITLES < len(sizes) - wide and {*sizes[wide:]} == {1} and not blanks:
        raise InputError(
            f"{path}, line {lines[wide]}: 1 cell in a table of {columns} columns, and so in all below. Where the lines "
            "above are settings, delete them or put # before them, and write the column's name above its first cell."
        )
    for line, row, cells in zip(lines, rows, sizes, strict=True):
        wrong = f"{path}, line {line}: {cells} cells in a table of {columns} columns."
        if twice and cells != columns:
            raise InputError(f"{wrong}{taken} Line {lines[0]} holds no numbers either.")
        if blanks and cells < columns:
            raise InputError(
                f"{wrong} Between blanks no cell can be left empty: write nan where there is no reading.{taken}"
            )
        if cells > columns and '"' not in row:
            point = (
                f" Use a decimal point in numbers, and {'blanks' if blanks else repr(separator)} only between columns."
            )
            if top and columns > 1 and not blanks and set(sizes) == {cells}:
                # Several names, and as many cells in every row: a line of names that is too short, and no title.
                point = point if separator == "," and not any("." in row for row in rows[:_LOOKED]) else ""
                taken = f" {'Else line' if point else 'Line'} {_missing(top, cells - columns)}"
            raise InputError(f"{wrong}{point}{taken}")


def _missing(top: str, count: int) -> str:
    """Return a line of names that lacks some, and what is done about it."""
    names = "the name of 1 column" if count == 1 else f"the names of {count} columns"
    return f"{_quoted(top)} lacks {names}: add what is missing, in the order of the columns."


def _quoted(row: str) -> str:
    """Return a line as a message shows it, cut where it is long."""
    row = row.strip()
    return repr(row if len(row) <= _SHOWN else row[: _SHOWN - 3] + "...")


def _read(path: Path, rows: Sequence[str], separator: str, names: Sequence[str]) -> dict[str, npt.NDArray[Any]]:
    import pandas as pd

    with warnings.catch_warnings():
        # A column of mixed types is reported by Table.numbers, with its row.
        warnings.simplefilter("ignore", pd.errors.DtypeWarning)
        try:
            frame = pd.read_csv(
                StringIO("\n".join(rows)),
                sep=separator,
                decimal=_decimal(rows, separator),
                header=None,
                names=list(names),
                index_col=False,
                skipinitialspace=True,
                skip_blank_lines=False,
            )
        except pd.errors.ParserError as error:
            raise InputError(f"{path} is not a table: {error}. Give every row as many cells as the header.") from error
    return {name: frame[name].to_numpy() for name in names}
