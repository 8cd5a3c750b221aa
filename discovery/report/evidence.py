"""Tables of evidence: the discovered equation and its rivals, the residual, the loop's candidates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from markupsafe import Markup

from discovery.report.numbers import MISSING, scale_for, significant, uncertain
from discovery.report.results import Run
from discovery.report.tables import Table, term_cell
from discovery.report.words import effect_name, prose

__all__ = [
    "dependence_table",
    "distortion_table",
    "effects_table",
    "equations_table",
    "radius_table",
    "ranking_table",
    "residual_table",
    "terms_table",
]


def terms_table(run: Run) -> Table:
    """Return the terms of the discovered equation."""
    terms = run.results["discovery"]["terms"]
    cells = [
        [
            term_cell(t["term"]),
            effect_name(t["effect"]) if t["effect"] else MISSING,
            uncertain(t["coefficient"], t["sd"]),
            significant(t["inclusion_probability"], 2),
        ]
        for t in terms
    ]
    head = ("term", "stands for", "coefficient ± sd", "inclusion probability")
    keys = ("term", "effect", "coefficient", "sd", "inclusion_probability")
    caption = (
        "Terms of the discovered equation, SI units. The coefficients are those of the regression; trajectories decide "
        "below."
    )
    return Table("terms", caption, head, cells, keys, [[t[k] for k in keys] for t in terms], (0, 1))


def equations_table(run: Run, each: int = 3) -> Table | None:
    """Return the best equations of every size: terms, misfit, likelihood ratio, probability."""
    table: Sequence[Mapping[str, Any]] = run.results["discovery"].get("table", [])
    chosen = tuple(t["term"] for t in run.results["discovery"]["terms"])
    cells, raw, count = [], [], {}  # type: ignore[var-annotated]
    for e in table:
        size = len(e["terms"])
        raw.append([size, "; ".join(e["terms"]), e["unexplained"], e["likelihood_ratio"], e["probability"]])
        count[size] = count.get(size, 0) + 1
        if count[size] > each:
            continue
        terms = Markup(", ").join(term_cell(t) for t in e["terms"])
        mark = "chosen" if tuple(e["terms"]) == chosen else ""
        cells.append(
            [
                f"{size}",
                terms,
                significant(e["unexplained"], 2),
                significant(min(e["likelihood_ratio"], 1e300), 2),
                significant(e["probability"], 2),
                mark,
            ]
        )
    if not cells:
        return None
    head = ("size", "terms", "unexplained share", "likelihood ratio", "probability", "")
    keys = ("size", "terms", "unexplained", "likelihood_ratio", "probability")
    caption = (
        "The trade-off: best equations of each size. Unexplained: share of the variance left. Likelihood ratio: "
        "of the best of the size over this one. Probability: share of resamples that prefer it among its size."
    )
    return Table("equations", caption, head, cells, keys, raw, (1, 5))


def radius_table(run: Run) -> Table | None:
    """Return the rival radius laws."""
    radius = run.results.get("radius")
    if not radius:
        return None
    keys = ("law", "parameters", "unexplained", "likelihood_ratio")
    cells = [
        [
            term_cell(r["law"]),
            prose(r["parameters"]).replace("-", "−"),
            significant(r["unexplained"]),
            significant(r["likelihood_ratio"], 2),
        ]
        for r in radius["rivals"]
    ]
    head = ("radius over length", "least squares", "unexplained share", "likelihood ratio")
    raw = [[r[k] for k in keys] for r in radius["rivals"]]
    return Table(
        "radius_laws",
        "Radius laws that compete; a likelihood ratio under 10 means “cannot tell”.",
        head,
        cells,
        keys,
        raw,
        (0, 1),
    )


def residual_table(run: Run) -> Table | None:
    """Return the residual in numbers, before and after."""
    residual = run.loop.get("residual")
    if not residual:
        return None
    wanted = {
        "rms": "rms [noise sds]",
        "systematic": "systematic part, rms [noise sds]",
        "autocorrelation": "autocorrelation at lag one",
        "ljung_box_p": "probability under white noise (Ljung-Box)",
    }
    cells = [[words, *(significant(residual[w][k]) for w in ("before", "after"))] for k, words in wanted.items()]
    cells.append(["white at 1 %", *("yes" if residual[w]["white"] else "no" for w in ("before", "after"))])
    raw = [[k, *(residual[w][k] for w in ("before", "after"))] for k in (*wanted, "white")]
    caption = "The residual on the training recordings, in units of the stated noise."
    return Table("residual", caption, ("", "before", "after"), cells, ("quantity", "before", "after"), raw)


def dependence_table(run: Run) -> Table | None:
    """Return what the residual depends on, before and after."""
    residual = run.loop.get("residual")
    if not residual:
        return None
    after = {d["variable"]: d for d in residual["after"]["dependence"]}
    cells, raw = [], []
    for d in residual["before"]["dependence"]:
        if d["variable"] == "angle" and not run.is_arm:
            continue  # the output itself, once more
        other = after.get(d["variable"], {"share": None, "p_value": None})
        cells.append(
            [d["variable"], *(significant(x, 2) for x in (d["share"], d["p_value"], other["share"], other["p_value"]))]
        )
        raw.append([d["variable"], d["share"], d["p_value"], other["share"], other["p_value"]])
    head = ("sorted by", "before: share", "p value", "after: share", "p value")
    keys = ("variable", "before_share", "before_p_value", "after_share", "after_p_value")
    caption = (
        "Share of the residual’s variance that each state explains (means of 12 equally filled bins; p value of an "
        "F test that takes samples as independent)."
    )
    return Table("dependence", caption, head, cells, keys, raw)


def ranking_table(run: Run) -> Table | None:
    """Return every candidate of every search through the catalogue."""
    cells, raw = [], []
    for i, step in enumerate(s for s in run.loop["steps"] if s["ranking"]):
        before = step["numbers"]["chi2_before"]
        for place, r in enumerate(step["ranking"]):
            raw.append([i + 1, r["effect"], r["parameters"], r["score"], before - r["chi2"], r["chi2"]])
            if place < 8:
                taken = "added" if step["accepted"] and r["effect"] == step["effect"] else ""
                removed = significant(max(0.0, round(before - r["chi2"], 1)))
                cells.append(
                    [
                        f"{i + 1}",
                        effect_name(r["effect"]),
                        f"{r['parameters']}",
                        significant(r["score"]),
                        removed,
                        taken,
                    ]
                )
    if not cells:
        return None
    head = ("search", "candidate", "free parameters", "linear score", "chi-square removed", "")
    keys = ("search", "effect", "parameters", "linear_score", "chi2_removed", "chi2")
    caption = "Candidates of every search, best eight; the CSV file has all. Scores rank, bounded refits decide."
    return Table("candidates", caption, head, cells, keys, raw, (1, 5))


def effects_table(run: Run) -> Table | None:
    """Return the evidence for every effect that was added by a search through the catalogue."""
    wanted = {
        "delta_chi2_train": "chi-square removed, training",
        "delta_chi2_holdout": "held out",
        "share_of_excess": "share of the excess",
        "runner_up_delta_chi2": "runner-up removes",
        "largest_similarity": "largest similarity",
    }
    shown = [e for e in run.loop["effects"] if e["evidence"]]
    if not shown:
        return None
    cells = [[effect_name(e["id"]), *(significant(e["evidence"].get(k)) for k in wanted)] for e in shown]
    raw = [[e["id"], *(e["evidence"].get(k) for k in wanted)] for e in shown]
    caption = (
        "Evidence for what was added. Similarity: cosine between its sensitivity and that of the candidate most like "
        "it, once the fitted parameters have absorbed what they can; at 1 the two could not be told apart."
    )
    return Table("evidence", caption, ("effect", *wanted.values()), cells, ("effect", *wanted), raw)


def distortion_table(run: Run) -> Table | None:
    """Return what a multisine's unexcited lines say."""
    multisine = run.results.get("multisine")
    if not multisine or not multisine.get("distortions"):
        return None
    unit = multisine["unit"]
    keys = ("parity", "basis", "lines", "level", "noise", "ratio_db", "limit_db", "peak", "detected")
    cells = []
    for d in multisine["distortions"]:
        scale = scale_for(unit, d["level"] or d["noise"] or 0.0)
        verdict = {True: "yes", False: "no"}.get(d["detected"], "cannot be judged")
        levels = [significant(x and x * scale.factor) for x in (d["level"], d["noise"])]
        ratios = [significant(d["ratio_db"]), significant(d["limit_db"])]
        cells.append([d["parity"], d["basis"], f"{d['lines']}", *levels, scale.symbol, *ratios, verdict])
    head = (
        "nonlinearity",
        "seen on",
        "lines",
        "level, rms",
        "noise, rms",
        "unit",
        "over noise [dB]",
        "limit [dB]",
        "detected",
    )
    caption = f"Nonlinear distortion of the {multisine['kind']} multisine, before any term is proposed."
    return Table(
        "distortion", caption, head, cells, keys, [[d[k] for k in keys] for d in multisine["distortions"]], (0, 1, 5, 8)
    )
