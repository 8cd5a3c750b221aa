"""The columns of a table that hold numbers."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from discovery.drafting.names import meaning_of
from discovery.foundation.arrays import FloatArray
from discovery.foundation.errors import InputError
from discovery.foundation.io import Table

#: Share of the cells, of at least so many, that are numbers in a column of numbers.
_MOSTLY, _LOOKED = 0.8, 500


def numbers_of(table: Table, used: set[str] | None) -> dict[str, FloatArray]:
    """Return the columns that hold numbers.

    One of numbers with a cell that is none is refused, unless others are used, and so is a table without any.
    """
    found, refused = {}, []
    for name in table.columns:
        try:
            clock = meaning_of(name).role == "time" or name in (used or ())
            values = table.times(name) if clock else table.numbers(name)
        except InputError as error:
            if (used is None or name in used) and _mostly_numbers(table.columns[name]):
                raise
            refused.append(error)
            continue
        if np.isfinite(values).any():
            found[name] = values
    if refused and not found:
        raise refused[0]
    return found


def _mostly_numbers(column: NDArray[Any]) -> bool:
    """Whether a column that does not hold numbers only holds them nearly everywhere, with either decimal mark."""
    cells = column[:: max(1, column.size // _LOOKED)]

    def is_number(cell: Any) -> bool:
        try:
            return bool(np.isfinite(float(str(cell).replace(",", "."))))
        except (TypeError, ValueError):
            return False

    return sum(map(is_number, cells)) > _MOSTLY * cells.size
