"""Times as a clock shows them, of a day or with its date, in seconds."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import numpy.typing as npt

from discovery.foundation.arrays import FloatArray

_SECONDS = r"[0-5]\d(?:[.,]\d+)?"
_DATED = re.compile(rf"\d{{4}}-\d{{2}}-\d{{2}}[T ]\d{{1,2}}:[0-5]\d:{_SECONDS}(?P<zone>Z|[+-]\d{{2}}:?\d{{2}})?")
#: With hours, or without them; both begin anew after this many seconds.
_PLAIN = {86400.0: re.compile(rf"\d+:[0-5]\d:{_SECONDS}"), 3600.0: re.compile(r"[0-5]?\d:[0-5]\d[.,]\d+")}


def seconds_of(cells: npt.NDArray[Any]) -> FloatArray | None:
    """Return the seconds since the first of clock times (n,), NaN for empty cells; None unless all others are such.

    All have a date and a zone, or none has. Without dates midnight, without hours an hour may end between two of them.

    Examples
    --------
    >>> seconds_of(np.array(["23:59:59.5", "", "00:00:01"], object)).tolist()
    [0.0, nan, 1.5]
    >>> seconds_of(np.array(["2024-05-01 10:00:00", "2024-05-01T10:00:00,250"], object)).tolist()
    [0.0, 0.25]
    >>> seconds_of(np.array(["10:00:00", "soon"], object))
    """
    import pandas as pd

    plain = pd.Series(cells, dtype=object).map(lambda cell: "" if pd.isna(cell) else str(cell).strip())
    texts = plain[plain != ""]
    if texts.empty:
        return None
    period = next((p for p, form in _PLAIN.items() if form.fullmatch(texts.iloc[0])), None)
    form = _DATED if period is None else _PLAIN[period]
    found = [form.fullmatch(text) for text in texts] if form.fullmatch(texts.iloc[0]) else [None]
    if not all(found) or (period is None and len({told and told["zone"] is None for told in found}) > 1):
        return None
    texts = texts.str.replace(",", ".")
    moments: pd.Series[Any]
    if period is None:
        moments = pd.to_datetime(texts, format="ISO8601", utc=True, errors="coerce")
    else:
        moments = pd.to_timedelta(("00:" if period == 3600.0 else "") + texts, errors="coerce")
    if moments.isna().any():  # what looks like a time and is none, as the 25th hour of a date
        return None
    steps = moments.diff().dt.total_seconds().fillna(0.0).to_numpy(np.float64, copy=True)
    if period is not None:
        steps[steps < -0.5 * period] += period
    seconds = np.full(len(cells), np.nan)
    seconds[(plain != "").to_numpy()] = np.cumsum(steps)
    return seconds
