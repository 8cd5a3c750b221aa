"""Trials that one file holds one after the other, as a column tells them apart."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from discovery.foundation.errors import InputError
from discovery.foundation.io import Table


def trials(table: Table, time: npt.NDArray[np.float64], names: Sequence[str]) -> tuple[str, list[str | float]]:
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
