"""Tables of evidence: the discovered equation and its rivals, the residual, the loop's candidates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from markupsafe import Markup

from discovery.report.numbers import MISSING, scale_for, significant, uncertain
from discovery.report.results import Run
from discovery.report.story import searches
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


def ranking_table(run: Run, best: int = 8) -> Table | None:
    """Return the candidates of every search through the catalogue, and what became of them."""
    count = run.loop["model"]["after"]["n_data"]
    rivals = {e["id"]: e["ambiguous_with"] for e in run.loop["effects"]}
    cells, raw = [], []
    for i, search in enumerate(searches(run), 1):
        least = min(r["chi2"] for r in search.ranking)
        as_good = {r for e in search.added for r in rivals.get(e, ())}
        for place, r in enumerate(search.ranking):
            name, above = r["effect"], r["chi2"] - least
            raw.append([i, name, r["parameters"], r["score"], search.without - r["chi2"], r["chi2"]])
            if name in search.added:
                outcome = "added" if name in rivals else "added, later dropped"
            else:
                outcome = "tried, not enough" if name in search.refused else "as good" if name in as_good else ""
            if place < best or outcome:
                numbers = [significant(r["chi2"] / count), significant(round(above, 1))]
                cells.append([f"{i}", effect_name(name), outcome, *numbers, f"{r['parameters']}"])
    if not cells:
        return None
    head = (
        "search",
        "candidate",
        "outcome",
        "leaves [noise variances]",
        "chi-square above the best",
        "free parameters",
    )
    keys = ("search", "effect", "parameters", "linear_score", "chi2_removed", "chi2")
    caption = (
        f"Candidates of every search: the best {best} and all that were tried; the CSV file has all. Leaves: mean "
        "squared residual in training after a bounded refit of everything; 1 is noise alone. Candidates within a few "
        "chi-square of each other cannot be told apart."
    )
    return Table("candidates", caption, head, cells, keys, raw, (1, 2))


def effects_table(run: Run) -> Table | None:
    """Return the evidence for every effect that was added by a search through the catalogue, an effect a column."""
    from discovery.significance import REPLICATES

    shown = [e for e in run.loop["effects"] if "delta_chi2_train" in e["evidence"]]
    if not shown:
        return None
    unit = run.loop["errors"]["unit"]
    sizes = [e["evidence"]["effect_rms"] for e in shown if "effect_rms" in e["evidence"]]
    scale = scale_for(unit, min(sizes, default=0.0))
    alike = dict.fromkeys(k for e in shown for k in e["evidence"] if k.startswith("similarity_"))
    wanted = {
        "effect_rms": f"moves the prediction by, rms [{scale.symbol}]",
        "share_of_residual_power": "share of the residual’s power",
        "share_of_excess": "share of what exceeds the noise",
        "delta_chi2_train": "chi-square removed, training",
        "delta_chi2_holdout": "chi-square removed, held out",
        "chance_gain_99": "removed by chance, at most (99 %)",
        "p_value": "p value",
        "runner_up_delta_chi2": "removed by the runner-up",
        "largest_similarity": "largest similarity",
        **{k: f"similarity with {effect_name(k.removeprefix('similarity_'))}" for k in alike},
    }

    def printed(key: str, value: float | None) -> str:
        if key == "p_value" and value is not None and value * (REPLICATES + 1) < 1.5:
            return f"under {significant(1 / REPLICATES, 1)}"
        if key == "share_of_excess" and value is not None and value >= 1:
            return "all"
        if key.startswith("share") and value is not None:
            return f"{100 * value:.1f} %"
        return significant(value and value * scale.factor if key == "effect_rms" else value)

    rows = {k: words for k, words in wanted.items() if any(k in e["evidence"] for e in shown)}
    cells = [[words, *(printed(k, e["evidence"].get(k)) for e in shown)] for k, words in rows.items()]
    raw = [[k, *(e["evidence"].get(k) for e in shown)] for k in rows]
    caption = (
        "Evidence for each added effect: the final model against the best one without it, everything refitted. By "
        f"chance: what the best of the whole catalogue removes from noise as correlated as what is left ({REPLICATES} "
        "simulations, which also give the p value). Similarity: cosine between sensitivities, once the fitted "
        "parameters have absorbed what they can; at 1 two effects could not be told apart."
    )
    head = ("", *(effect_name(e["id"]) for e in shown))
    return Table("evidence", caption, head, cells, ("quantity", *(e["id"] for e in shown)), raw)


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
