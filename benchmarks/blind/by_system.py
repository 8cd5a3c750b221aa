"""Scores by world and kind of system: what was named, what was invented, what is left of the hold-out."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from benchmarks.blind.score import NINETY, brief, proportion, quartiles

#: An effect is plain that is so many times as large as the errors of the model, and as the noise.
PLAIN = 4.0
#: A hold-out error is as good as the true model's below so many times that.
AS_GOOD = 2.0


def _plain(part: pd.DataFrame) -> pd.Series:
    return part["size"] >= PLAIN * np.maximum(part["model_error"].astype(float), 1.0)


def _shares(part: pd.DataFrame, intervals: pd.DataFrame) -> dict[str, Any]:
    """Shares that the cases of a system are judged by; in `part` no case failed."""
    single, clean = part[part["kind"].isin(["single", "pair"])], part[part["kind"] == "none"]
    outside, inside = part[part["kind"] == "outside"], part[part["kind"] != "outside"]
    known = inside[inside["truth_mm"].notna()]
    own = intervals[intervals["case"].isin(part["case"])]
    near = known["after_mm"] <= AS_GOOD * np.maximum(known["truth_mm"].astype(float), 0.5 * known["noise_mm"])
    return {
        "named in the set or its group": proportion(single["in_set"]),
        "the same, plain effects": proportion(single["in_set"][_plain(single)]),
        "named itself": proportion(single["alone"]),
        "nothing invented": proportion(inside["invented"] == ""),
        "nothing unlike a model error": proportion(inside["unlike"] == ""),
        "clean: nothing named": proportion(clean["named"] == "none"),
        "outsiders never explained": proportion(outside["verdict"] != "explained"),
        "outsiders: nothing named": proportion(outside["named"] == "none"),
        "hold-out not made worse": proportion(part["after_mm"] <= 1.05 * part["bare_mm"]),
        "hold-out as good as the truth's": proportion(near),
        "90 % intervals cover": proportion(own["z"].abs() <= NINETY),
    }


def _errors(part: pd.DataFrame) -> dict[str, Any]:
    """Quartiles of the hold-out's error over that before, over the noise, and over that of the true model."""
    single = part[part["kind"].isin(["single", "pair"])]
    known = single[single["truth_mm"].notna()]
    ratios = {
        "after over before": single["after_mm"] / single["before_mm"],
        "after over noise": single["after_over_noise"],
        "after over truth": known["after_mm"] / known["truth_mm"].astype(float),
    }
    return {name: quartiles(r.astype(float)) for name, r in ratios.items() if len(r)}


def _believed(part: pd.DataFrame) -> dict[str, Any]:
    """Mean of the least stated probability of what is named, and how often all of it is right."""
    told = part[part["probability"].notna() & (part["kind"] != "outside")]
    mean = float(told["probability"].astype(float).mean()) if len(told) else None
    return {"mean probability": mean, "all right": proportion(told["invented"] == "")}


def _figures(part: pd.DataFrame, intervals: pd.DataFrame) -> dict[str, Any]:
    """All figures of one system; cases that failed are counted and left out of the rest."""
    ran = part[part["error"].isna()]
    counts = pd.crosstab(ran["kind"], ran["verdict"])
    return {
        "failed": proportion(part["error"].notna()),
        "shares": _shares(ran, intervals),
        "errors": _errors(ran),
        "verdicts": {kind: {v: int(n) for v, n in row.items()} for kind, row in counts.iterrows()},
        "believed": _believed(ran),
    }


def all_systems(table: pd.DataFrame, intervals: pd.DataFrame) -> dict[str, Any]:
    """Figures by world, and within it by system and of all.

    Parameters
    ----------
    table : DataFrame
        A row a case, see `benchmarks.blind.score.collect`.
    intervals : DataFrame
        A row a parameter.
    """
    found: dict[str, Any] = {}
    for world, part in table.groupby("world"):
        systems = dict(list(part.groupby("system")))
        parts = {**systems, "all": part} if len(systems) > 1 else systems
        found[str(world)] = {str(s): _figures(own, intervals) for s, own in parts.items()}
    return found


def misses(table: pd.DataFrame) -> pd.DataFrame:
    """Rough cases that failed, whose plain effect was missed, that got an invented one, or explained an outsider."""
    inside = table["kind"] != "outside"
    wrong = (
        table["error"].notna()
        | (_plain(table) & inside & (table["in_set"] == False))  # noqa: E712
        | (inside & (table["invented"].fillna("") != ""))
        | (~inside & (table["verdict"] == "explained"))
    )
    return table[wrong]


def _quartile(q: Mapping[str, float]) -> str:
    return f"{q['median']:.3g} ({q['low']:.3g} to {q['high']:.3g})"


def tables(found: Mapping[str, Any]) -> str:
    """Everything as plain text."""
    lines: list[str] = []
    for world, systems in found.items():
        shares = {
            s: {n: brief(p) for n, p in {"failed": f["failed"], **f["shares"]}.items()} for s, f in systems.items()
        }
        errors = {s: {n: _quartile(q) for n, q in f["errors"].items()} for s, f in systems.items()}
        verdicts = {(s, k): row for s, f in systems.items() for k, row in f["verdicts"].items()}
        believed = systems.get("all", next(iter(systems.values())))["believed"]
        lines += ["", f"world {world}: cases (95 % interval of the share in %)", pd.DataFrame(shares).to_string()]
        lines += ["", "hold-out error of single effects, median (quartiles)", pd.DataFrame(errors).T.to_string()]
        lines += ["", "verdicts", pd.DataFrame(verdicts).T.fillna(0).astype(int).to_string()]
        if believed["mean probability"] is not None:
            share = brief(believed["all right"])
            lines.append(f"stated probability of what is named: {believed['mean probability']:.3f}; right: {share}")
    return "\n".join(lines)
