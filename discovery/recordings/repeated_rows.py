"""Rows that a logger wrote twice: the time and all readings of the row before once more."""

from __future__ import annotations

import numpy as np

from discovery.recordings.file_signals import Signals
from discovery.recordings.flags import Flag


def without_repeats(found: Signals) -> list[Flag]:
    """Leave out rows whose time and other cells are those of the row before, and tell it.

    A stamp that repeats with another reading stays, to be refused: which of the two is right is not known.
    """
    if "time" not in found.names or found.time.size < 2:
        return []
    again = np.ones(found.time.size - 1, bool)
    for column in found.table.columns.values():
        same = column[1:] == column[:-1]
        # An empty cell twice is the same.
        again &= same | (column[1:] != column[1:]) & (column[:-1] != column[:-1])
    if not again.any():
        return []
    first = float(found.time[int(np.argmax(again))])
    found.keep(np.flatnonzero(np.append(True, ~again)))
    return [Flag("rows_repeated", numbers={"count": int(again.sum()), "start": first})]
