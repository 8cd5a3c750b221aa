"""The parameters of a campaign, pooled over its cases."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from typing import Any

from discovery.posterior.pooled import pool

#: Cases that must have a parameter for it to be pooled: the spread of two is hardly known.
_FEWEST = 3


def pooled_parameters(rows: Iterable[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return what the cases of a campaign say of each parameter together, see `discovery.posterior.pooled.pool`.

    Rows are those of `discovery.runs.campaign.rows`. There is an entry for each parameter that at least three systems
    of one kind have in one unit, with a standard deviation; initial states, which belong to a recording, are left out.
    The most frequent come first; all is JSON-ready.
    """
    found: dict[tuple[str, str, str], list[tuple[str, str, float, float]]] = {}
    for row in rows:
        for entry in row.get("parameters") or ():
            # A parameter with brackets is of one recording.
            if entry.get("sd") and entry.get("value") is not None and "[" not in entry["parameter"]:
                unit = re.sub(r"\bq\b", row.get("coordinate_unit") or "q", entry.get("unit") or "")
                group = found.setdefault((row.get("kind") or "", entry["parameter"], unit), [])
                group.append((row["name"], entry.get("effect") or "", entry["value"], entry["sd"]))
    groups = sorted(found.items(), key=lambda item: -len(item[1]))
    return [_pooled(*key, estimates) for key, estimates in groups if len(estimates) >= _FEWEST]


def _pooled(kind: str, parameter: str, unit: str, estimates: list[tuple[str, str, float, float]]) -> dict[str, Any]:
    names, effects, values, sds = zip(*estimates, strict=True)
    said = pool(values, sds)
    return {
        "parameter": parameter,
        "effect": Counter(effects).most_common(1)[0][0],
        "kind": kind,
        "unit": unit,
        "mean": asdict(said.mean),
        "spread": asdict(said.spread),
        "following": asdict(said.following),
        "cases": [
            {"name": name, "value": value, "sd": sd, "shrunk": asdict(shrunk), "shrinkage": share}
            for name, value, sd, shrunk, share in zip(names, values, sds, said.specimens, said.shrinkage, strict=True)
        ],
    }
