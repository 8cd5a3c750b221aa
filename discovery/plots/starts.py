"""Initial states as a table of their own, apart from what is physics."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    import pandas as pd

__all__ = ["is_start", "starts_table"]

_START = re.compile(r"(\w+)_0_init\[(.*)\]", re.DOTALL)
_WORDS = {"delta": "deflection", "rate": "rate"}


def is_start(name: str) -> bool:
    """Say whether a fitted or sampled number is the initial state of a recording."""
    return _START.fullmatch(name) is not None


def starts_table(told: Iterable[tuple[str, Mapping[str, Any]]], value: str) -> pd.DataFrame:
    """Return a row for every recording: deflection and rate at its first time, their standard deviations and units.

    Parameters
    ----------
    told : iterable of (name, mapping)
        Entries with `value`, ``"sd"`` and ``"unit"``; those of physics are passed over.
    value : str
        Key of the value.
    """
    import pandas as pd

    rows: dict[str, dict[str, Any]] = {}
    for name, entry in told:
        if found := _START.fullmatch(name):
            what = _WORDS.get(found[1], found[1])
            rows.setdefault(found[2], {}).update(
                {what: entry[value], f"{what}_sd": entry["sd"], f"{what}_unit": entry["unit"]}
            )
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("recording")
