"""Initial states as a table of their own, apart from what is physics."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from discovery.foundation.start_names import start_of, start_word

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    import pandas as pd


def starts_table(told: Iterable[tuple[str, Mapping[str, Any]]], value: str) -> pd.DataFrame:
    """Return a row for every recording: deflection and rate at its first time, their standard deviations and units.

    Of each name there are `value`, ``"sd"`` and ``"unit"``; those of physics are passed over.
    """
    import pandas as pd

    rows: dict[str, dict[str, Any]] = {}
    for name, entry in told:
        if found := start_of(name):
            what = start_word(found[0])
            rows.setdefault(found[1], {}).update(
                {what: entry[value], f"{what}_sd": entry["sd"], f"{what}_unit": entry["unit"]}
            )
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("recording")
