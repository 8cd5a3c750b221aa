"""Score the runs against the sealed truth: ``python -m benchmarks.blind.score OUT``.

Writes summary.csv (a row a case), scores.json (every figure with its binomial 95 % interval, Clopper and Pearson,
Biometrika 26 (1934) 404), misses.csv and the figures, and prints the tables.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from discovery_datasets.hidden import FAMILIES
from scipy import stats

from benchmarks.blind.peers import nameable
from benchmarks.blind.rough.refit import at_times
from benchmarks.blind.truth import catalogue_values
from discovery.results.provenance import read_json, write_json

#: The arm's own mechanics: a clean arm is one where nothing else is added. A mode that another body has is an effect.
GEOMETRY = frozenset(
    {
        "elastica_geometry", "radius_inertia", "centrifugal_stiffening", "coriolis_coupling", "radial_inertia",
        "distributed_mass", "second_mode", "radius_quartic", "radius_tension",
    }
)  # fmt: skip
PAPER_NOISE, PLAIN = 3e-4, 4.0  # m; size over noise from which the goals count
BINS = (0.0, 1.0, 2.0, 4.0, 8.0, 16.0, np.inf)
#: Predictions of the hold-out: of the declared model, of the exact arm with nothing added, of the loop's answer.
WHEN = ("before", "bare", "after")
#: Verdicts that say that only noise is left.
SETTLED = ("explained", "nothing_missing")
#: Columns of the cases to look at.
SHOWN = ["case", "true", "sizes", "noise_mm", "verdict", "named", "ambiguous", "invented", "after_over_noise", "error"]
#: Two-sided normal quantile of a 90 % interval.
NINETY = float(stats.norm.ppf(0.95))


def proportion(hits: Any) -> dict[str, Any]:
    """Share of hits with its exact 95 % interval."""
    hits = np.asarray(list(hits), bool)
    n, k = hits.size, int(hits.sum())
    if n == 0:
        return {"k": 0, "n": 0, "share": None, "low": None, "high": None}
    interval = stats.binomtest(k, n).proportion_ci(0.95, method="exact")
    return {"k": k, "n": n, "share": k / n, "low": float(interval.low), "high": float(interval.high)}


def detection_limit(size: Any, named: Any) -> dict[str, float | None]:
    """Size over noise at which half are named: logistic regression on its logarithm, 95 % likelihood interval."""
    x, y = np.log(np.asarray(size, float)), np.asarray(named, bool)
    if y.all() or not y.any():
        return {"half": None, "low": None, "high": None}
    centre, steep = np.meshgrid(np.linspace(np.log(0.03), np.log(300), 400), np.geomspace(0.3, 8, 40), indexing="ij")
    argument = steep[..., None] * (x - centre[..., None])
    likelihood = np.where(y, -np.logaddexp(0, -argument), -np.logaddexp(0, argument)).sum(axis=2).max(axis=1)
    inside = np.flatnonzero(likelihood > likelihood.max() - stats.chi2.ppf(0.95, 1) / 2)
    grid = np.exp(centre[:, 0])
    return {"half": float(grid[likelihood.argmax()]), "low": float(grid[inside[0]]), "high": float(grid[inside[-1]])}


def root_mean_square(distances: Any) -> float:
    """Of distances, infinite if the motion blew up and they are no numbers."""
    rms = float(np.sqrt(np.mean(np.square(distances))))
    return np.inf if np.isnan(rms) else rms


def distance(prediction: pd.DataFrame, clean: pd.DataFrame, when: str) -> float:
    """Rms distance between predicted and noise-free reading of the hold-out, infinite if the motion blew up."""
    if "output" in clean:
        away = prediction[f"output_{when}"].to_numpy() - at_times(clean, prediction["time_s"].to_numpy())[:, 0]
        # Where readings pass a filter, most of them are left out.
        return root_mean_square(away[np.isfinite(away)] if clean["output"].isna().any() else away)
    x, y = ((prediction[f"tip_{a}_{when}_m"] - clean[f"tip_{a}_m"]).to_numpy() for a in "xy")
    return root_mean_square(np.hypot(x, y))


def coverage(truth: Mapping[str, Any], estimates: Mapping[str, Any], rig: Mapping[str, float]) -> list[dict[str, Any]]:
    """For each parameter of a rightly named effect, how far the estimate is from the truth in standard deviations.

    Those of the fit: what a camera's scale owes to the rig file's length is not tested here, for that is exact.
    """
    rows = []
    known = truth["catalogue"] if "catalogue" in truth else catalogue_values(truth["id"], truth["parameters"], rig)
    for name, value in known.items():
        estimate = estimates.get(name)
        if estimate is not None and estimate["sd"]:
            z = (estimate["value"] - value) / estimate["sd"]
            rows.append(
                {"effect": truth["id"], "parameter": name, "truth": value, "estimate": estimate["value"], "z": z}
            )
    return rows


def judge(named: list[str], groups: Mapping[str, set[str]], truth: list[Mapping[str, Any]]) -> dict[str, Any]:
    """Compare named effects, each with its ambiguity group, with the true ones."""
    accepted = [set(t["accepted"]) for t in truth]
    return {
        "in_set": [any(groups[n] & a for n in named) for a in accepted],
        "alone": [any(n in a for n in named) for a in accepted],
        "first": bool(named) and any(named[0] in a for a in accepted),
        "invented": [n for n in named if not any(groups[n] & a for a in accepted)],
    }


def described(truth: Mapping[str, Any]) -> dict[str, Any]:
    """What a row says of the case itself; lengths in mm are thousandths of the output's unit for other systems."""
    sizes = [t["unabsorbed_over_noise"] for t in truth["effects"]]
    reach = truth["reach"] if "reach" in truth else truth["deflection"]
    return {
        "case": truth["case"],
        "world": truth.get("world", "exact"),
        "system": truth.get("system", "arm"),
        "kind": truth["kind"],
        "true": " + ".join(t["id"] for t in truth["effects"]) or "none",
        "family": " + ".join(t["family"] for t in truth["effects"]) or "none",
        "size": min(sizes, default=0.0),
        "sizes": " + ".join(f"{s:.3g}" for s in sizes),
        "model_error": truth.get("model_error_over_noise", 0.0),
        "noise_mm": 1e3 * truth["noise"],
        "truth_mm": None if truth.get("truth_error") is None else 1e3 * truth["truth_error"],
        "deflection": max(v for k, v in reach.items() if k != "holdout"),
        "holdout_deflection": reach["holdout"],
    }


def beside_mechanics(loop: Mapping[str, Any], truth: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Effects that a loop names beside the mechanics of what is recorded."""
    own = GEOMETRY if truth.get("system", "arm") == "arm" else ()
    return [e for e in loop["effects"] if e["id"] not in own]


def beliefs(loop: Mapping[str, Any], effects: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Least probability of what is named, and the model's error, where the loop states them."""
    stated = [p for e in effects if (p := e.get("group_probability", e.get("probability"))) is not None]
    error = loop.get("model_error")
    return {"probability": min(stated, default=None), "stated_error": None if error is None else json.dumps(error)}


def peer_columns(results: Path, truth: Mapping[str, Any]) -> dict[str, Any]:
    """What the peers made of a case, where they were run."""
    compared = results / "peers.json"
    found: dict[str, Any] = {}
    for peer, names in json.loads(compared.read_text()).items() if compared.exists() else ():
        own = judge(names, {n: {n} for n in names}, truth["effects"])
        found |= {
            f"{peer}_in_set": all(own["in_set"]) if truth["effects"] else None,
            f"{peer}_first": own["first"] if truth["effects"] else None,
            f"{peer}_invented": " + ".join(own["invented"]),
        }
    return found


def score_case(folder: Path, truth: Mapping[str, Any]) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """Row of a case, and a row for each parameter with an interval."""
    name, results = truth["case"], folder / "results" / truth["case"]
    row = described(truth)
    done = json.loads((results / "done.json").read_text())
    if "error" in done:
        return {**row, "error": done["error"]}, []
    loop = read_json(results / "loop.json")
    effects = beside_mechanics(loop, truth)
    groups = {e["id"]: {e["id"], *e.get("ambiguous_with", ())} for e in effects}
    verdict = judge(list(groups), groups, truth["effects"])
    clean = pd.read_csv(folder / "truth" / f"{name}_holdout_clean.csv")
    prediction = pd.read_csv(results / "prediction.csv")
    rms = {when: distance(prediction, clean, when) for when in WHEN}
    # Effects that describe an error of the model without being right.
    like = {r for e in truth.get("model_errors", ()) for r in e["resembles"]}
    row |= {
        "verdict": loop["verdict"],
        "named": " + ".join(groups) or "none",
        "ambiguous": " + ".join(sorted({a for n, group in groups.items() for a in group - {n}})),
        "in_set": all(verdict["in_set"]) if truth["effects"] else None,
        "alone": all(verdict["alone"]) if truth["effects"] else None,
        "first": verdict["first"] if truth["effects"] else None,
        "invented": " + ".join(verdict["invented"]),
        "unlike": " + ".join(n for n in verdict["invented"] if n not in like),
        "base": loop["model"]["after"]["model"]["base"],
        "seconds": done["seconds"],
        **{f"{when}_mm": 1e3 * v for when, v in rms.items()},
        "after_over_noise": rms["after"] / truth["noise"],
        **beliefs(loop, effects),
        **peer_columns(results, truth),
    }
    if truth["effects"]:
        row["nameable"] = all(nameable(t["accepted"]) for t in truth["effects"])
    estimates = loop["model"]["after"].get("parameters", {})
    right = [t for t in truth["effects"] if t["id"] in groups]
    rows = [{"case": name, **r} for t in right for r in coverage(t, estimates, truth.get("rig", {}))]
    return row, rows


def headline(table: pd.DataFrame, intervals: pd.DataFrame) -> dict[str, Any]:
    """Figures that the goals are stated in."""
    ran = table[table["error"].isna()]
    paper = ran[np.isclose(ran["noise_mm"], 1e3 * PAPER_NOISE)]
    scores: dict[str, Any] = {"failed": proportion(table["error"].notna())}
    for label, part in (("0.3 mm", paper), ("all noise levels", ran)):
        plain = part[(part["size"] >= PLAIN) & part["kind"].isin(["single", "pair"])]
        single, pair = plain[plain["kind"] == "single"], plain[plain["kind"] == "pair"]
        clean, inside = part[part["kind"] == "none"], part[part["kind"] != "outside"]
        outside = part[(part["kind"] == "outside") & (part["size"] >= PLAIN)]
        settled = inside[inside["verdict"].isin(SETTLED)]
        scores[label] = {
            "single effect in the set or its group": proportion(single["in_set"]),
            "single effect named": proportion(single["alone"]),
            "single effect named first": proportion(single["first"]),
            "one of two named first": proportion(pair["first"]),
            "both of two in the set or groups": proportion(pair["in_set"]),
            "nothing invented, all but outside": proportion(inside["invented"] == ""),
            "nothing invented, clean": proportion(clean["invented"] == ""),
            "clean: not called unexplained": proportion(clean["verdict"] != "unexplained"),
            "outside flagged unexplained": proportion(outside["verdict"] == "unexplained"),
            # Where nothing is named, nothing is corrected.
            "outside not made worse": proportion(
                (outside["named"] == "none") | (outside["after_mm"] <= 1.05 * outside["bare_mm"])
            ),
            "explained: hold-out within the noise": proportion(settled["after_over_noise"] <= 1),
            "explained: hold-out within twice the noise": proportion(settled["after_over_noise"] <= 2),
            "clean: bare exact arm within the noise": proportion(clean["bare_mm"] <= clean["noise_mm"]),
        }
        for peer in ("pysindy", "lasso"):
            if f"{peer}_in_set" in part:
                compared = single[single[f"{peer}_in_set"].notna()]
                known = compared[compared["nameable"].astype(bool)]
                scores[label] |= {
                    f"{peer}: single effect in the set": proportion(compared[f"{peer}_in_set"]),
                    f"{peer}: in the set, of those with a column": proportion(known[f"{peer}_in_set"]),
                    f"{peer}: single effect first": proportion(compared[f"{peer}_first"]),
                    f"{peer}: first, of those with a column": proportion(known[f"{peer}_first"]),
                    f"{peer}: nothing invented": proportion(inside[f"{peer}_invented"].dropna() == ""),
                }
    scores["coverage of 90 % intervals"] = {
        "all": proportion(intervals["z"].abs() <= NINETY),
        **{p: proportion(g["z"].abs() <= NINETY) for p, g in intervals.groupby("effect")},
    }
    return scores


def binned(sizes: pd.Series) -> pd.Series:
    """Bin of each size, by its name."""
    return pd.cut(sizes, BINS, right=False, labels=[f"{low:g} to {high:g}" for low, high in pairwise(BINS)])


def by_size(table: pd.DataFrame) -> dict[str, Any]:
    """Named shares by family and size, and the detection limits, over cases with one effect at any noise."""
    single = table[table["error"].isna() & (table["kind"] == "single")]
    found: dict[str, Any] = {}
    for family in (*FAMILIES, "all"):
        part = single if family == "all" else single[single["family"] == family]
        if part.empty:
            continue
        found[family] = {
            "bins": {b: proportion(g["in_set"]) for b, g in part.groupby(binned(part["size"]), observed=True)},
            "limit": detection_limit(part["size"].clip(lower=1e-2), part["in_set"].astype(bool)),
        }
    return found


def quartiles(values: pd.Series) -> dict[str, float]:
    """Median and quartiles, each one of the values: between infinite ones there is nothing."""
    low, median, high = np.quantile(values, (0.25, 0.5, 0.75), method="inverted_cdf")
    return {"low": float(low), "median": float(median), "high": float(high)}


def figures_of(part: pd.DataFrame, intervals: pd.DataFrame) -> dict[str, Any]:
    """All figures of cases that have one effect each, or none."""
    own = intervals[intervals["case"].isin(part["case"])]
    return {
        "median size": float(part["size"].median()),
        "shares": {
            "named first": proportion(part["first"].dropna()),
            "in the set or its group": proportion(part["in_set"].dropna()),
            "nothing invented": proportion(part["invented"] == ""),
            "90 % intervals cover": proportion(own["z"].abs() <= NINETY),
            "hold-out within the noise": proportion(part["after_over_noise"] <= 1),
            "within twice the noise": proportion(part["after_over_noise"] <= 2),
        },
        "hold-out over noise": {when: quartiles(part[f"{when}_mm"] / part["noise_mm"]) for when in WHEN},
    }


def all_by_size(table: pd.DataFrame, intervals: pd.DataFrame) -> dict[str, Any]:
    """Figures of the clean cases, and of those with one effect by its size over noise; any camera, any verdict."""
    ran = table[table["error"].isna()]
    clean, single = ran[ran["kind"] == "none"], ran[ran["kind"] == "single"]
    parts = [("clean", clean)] * (not clean.empty) + list(single.groupby(binned(single["size"]), observed=True))
    return {label: figures_of(part, intervals) for label, part in parts}


def verdicts_by_size(table: pd.DataFrame) -> pd.DataFrame:
    """Cases with each verdict by kind and size over noise, of a pair that of its weaker effect."""
    ran = table[table["error"].isna()]
    return pd.crosstab([ran["kind"], binned(ran["size"])], ran["verdict"])


def brief(p: Mapping[str, Any]) -> str:
    """Cell of a table."""
    return f"{p['k']}/{p['n']} ({100 * p['low']:.0f} to {100 * p['high']:.0f})" if p["n"] else "-"


def size_tables(found: Mapping[str, Any]) -> list[str]:
    """Figures by size as plain text."""
    shares, errors = {}, {}
    for size, own in found.items():
        shares[size] = {name: brief(p) for name, p in own["shares"].items()}
        errors[size] = {
            when: f"{q['median']:.3g} ({q['low']:.3g} to {q['high']:.3g})"
            for when, q in own["hold-out over noise"].items()
        }
    return [
        "",
        "single effects by size over noise, any camera: cases (95 % interval of the share in %)",
        pd.DataFrame.from_dict(shares, orient="index").to_string(),
        "",
        "hold-out error over noise, median (quartiles): declared model, bare exact arm, after the loop",
        pd.DataFrame.from_dict(errors, orient="index").to_string(),
    ]


def say(label: str, p: Mapping[str, Any]) -> str:
    """One line of a table."""
    if not p["n"]:
        return f"  {label:50s}   no case"
    share, low, high = (100 * p[k] for k in ("share", "low", "high"))
    return f"  {label:50s} {p['k']:4d} of {p['n']:4d}  {share:5.1f} %  ({low:.0f} to {high:.0f})"


def report(scores: Mapping[str, Any], sizes: Mapping[str, Any], found: Mapping[str, Any], table: pd.DataFrame) -> str:
    """Everything as plain text."""
    lines = [say("failed", scores["failed"])]
    for block in ("0.3 mm", "all noise levels", "coverage of 90 % intervals"):
        lines += ["", block, *(say(k, v) for k, v in scores[block].items())]
    lines += ["", "single effects by size over noise, in the set or its group"]
    for family, part in sizes.items():
        limit = part["limit"]
        half = (
            f"half at {limit['half']:.2g} ({limit['low']:.2g} to {limit['high']:.2g})"
            if limit["half"]
            else "no limit seen"
        )
        shares = ", ".join(f"{b}: {p['k']}/{p['n']}" for b, p in part["bins"].items())
        lines.append(f"  {family:16s} {shares}; {half}")
    lines += size_tables(found)
    ran = table[table["error"].isna()]
    lines += ["", "verdicts", pd.crosstab(ran["kind"], ran["verdict"]).to_string()]
    lines += ["", "verdicts by size", verdicts_by_size(table).to_string()]
    return "\n".join(lines)


def missed(table: pd.DataFrame) -> pd.DataFrame:
    """Cases that failed, were missed though plain, got an invented effect, or whose trouble was explained away."""
    inside = table["kind"].isin(["single", "pair"])
    wrong = (
        table["error"].notna()
        | (inside & (table["size"] >= PLAIN) & (table["in_set"] == False))  # noqa: E712
        | ((table["kind"] != "outside") & (table["invented"].fillna("") != ""))
        | ((table["kind"] == "outside") & (table["size"] >= PLAIN) & (table["verdict"] != "unexplained"))
        | ((table["kind"] != "outside") & (table["after_over_noise"] > 2))
    )
    return table[wrong]


def collect(folder: Path) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Rows of all cases that were run, and of their intervals."""
    rows: list[dict[str, Any]] = []
    intervals: list[dict[str, Any]] = []
    for sealed in sorted((folder / "truth").glob("*.json")):
        if (folder / "results" / sealed.stem / "done.json").exists():
            row, own = score_case(folder, json.loads(sealed.read_text()))
            rows.append({"error": None, **row})
            intervals += own
    table = pd.DataFrame(rows)
    judged = (
        "nameable",
        "verdict",
        "in_set",
        "alone",
        "first",
        "invented",
        "after_over_noise",
        *(f"{when}_mm" for when in WHEN),
    )
    for column in judged:
        if column not in table:
            table[column] = None
    return table, pd.DataFrame(intervals, columns=["case", "effect", "parameter", "truth", "estimate", "z"])


def score_exact(folder: Path, table: pd.DataFrame, intervals: pd.DataFrame) -> dict[str, Any]:
    """Score the cases of the exact world: print their tables, draw their figures, and return what is saved."""
    from benchmarks.blind.figures import draw

    scores, sizes, found = headline(table, intervals), by_size(table), all_by_size(table, intervals)
    misses = missed(table)
    misses.to_csv(folder / "misses.csv", index=False, float_format="%.4g")
    print(report(scores, sizes, found, table))
    print("\nto look at\n" + misses[SHOWN].to_string(index=False, max_colwidth=44))
    draw(folder, table, intervals, sizes, found)
    verdicts = verdicts_by_size(table).reset_index().to_dict("records")
    return {"goals": scores, "sizes": sizes, "by_size": found, "verdicts": verdicts}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path)
    folder = parser.parse_args().out
    table, intervals = collect(folder)
    table.to_csv(folder / "summary.csv", index=False, float_format="%.5g")
    table.astype({c: str for c in table.columns if table[c].dtype == object}).to_parquet(folder / "summary.parquet")
    intervals.to_csv(folder / "intervals.csv", index=False, float_format="%.5g")
    content: dict[str, Any] = {}
    exact = table["world"] == "exact"
    if exact.any():
        own = intervals["case"].isin(table["case"][exact])
        content = score_exact(folder, table[exact], intervals[own])
    from benchmarks.blind.by_system import all_systems, misses, tables

    by_system = all_systems(table, intervals)
    print(tables(by_system))
    if not exact.all():
        odd = misses(table[~exact])
        odd.to_csv(folder / "misses_rough.csv", index=False, float_format="%.4g")
        print("\nto look at\n" + odd[["system", *SHOWN]].to_string(index=False, max_colwidth=44))
    write_json(folder / "scores.json", {**content, "by_system": by_system})


if __name__ == "__main__":
    main()
