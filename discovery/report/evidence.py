"""Tables of evidence: the discovered equation and its rivals, the residual, the loop's candidates."""

from __future__ import annotations

from collections import Counter

from markupsafe import Markup

from discovery.report.model_error_words import AS_NONE, share_words
from discovery.report.numbers import MISSING, chance, ratio, scale_for, significant, uncertain
from discovery.report.results import Run
from discovery.report.sentences import chances, probability_words
from discovery.report.story import blows_up, fate, searches
from discovery.report.tables import Table, term_cell
from discovery.report.words import effect_name, listed, prose

#: Equations of each size, and the most likely candidates of each search, that the page shows.
_EACH, _BEST = 3, 8


def terms_table(run: Run) -> Table | None:
    """Return the terms of the discovered equation."""
    if not run.results.get("discovery"):
        return None
    terms = run.results["discovery"]["terms"]
    cells = []
    for t in terms:
        values = [uncertain(t["coefficient"], t["sd"]), significant(t["inclusion_probability"], 2)]
        cells.append([term_cell(t["term"]), effect_name(t["effect"]) if t["effect"] else MISSING, *values])
    head = ("term", "stands for", "coefficient ± sd", "inclusion probability")
    keys = ("term", "effect", "coefficient", "sd", "inclusion_probability")
    caption = (
        "Terms of the discovered equation, SI units. The coefficients are those of the regression; trajectories decide "
        "below."
    )
    return Table("terms", caption, head, cells, keys, terms, text=(0, 1))


def equations_table(run: Run) -> Table | None:
    """Return the best equations of every size: terms, misfit, likelihood ratio, probability."""
    discovery = run.results.get("discovery") or {"terms": []}
    chosen = tuple(t["term"] for t in discovery["terms"])
    cells, raw, count = [], [], Counter[int]()
    for e in discovery.get("table", ()):
        size = len(e["terms"])
        raw.append([size, "; ".join(e["terms"]), e["unexplained"], e["likelihood_ratio"], e["probability"]])
        count[size] += 1
        if count[size] > _EACH:
            continue
        terms = Markup(", ").join(term_cell(t) for t in e["terms"])
        numbers = [significant(e["unexplained"], 2), ratio(e["likelihood_ratio"]), significant(e["probability"], 2)]
        cells.append([f"{size}", terms, *numbers, "chosen" if tuple(e["terms"]) == chosen else ""])
    if not cells:
        return None
    head = ("size", "terms", "unexplained share", "likelihood ratio", "probability", "")
    keys = ("size", "terms", "unexplained", "likelihood_ratio", "probability")
    caption = (
        "The trade-off: best equations of each size. Unexplained: share of the variance left. Likelihood ratio: "
        "of the best of the size over this one. Probability: share of resamples that prefer it among its size."
    )
    return Table("equations", caption, head, cells, keys, raw, text=(1, 5))


def radius_table(run: Run) -> Table | None:
    """Return the rival radius laws."""
    radius = run.results.get("radius")
    if not radius:
        return None
    keys = ("law", "parameters", "unexplained", "likelihood_ratio")
    cells = []
    for r in radius["rivals"]:
        values = [prose(r["parameters"]).replace("-", "−"), significant(r["unexplained"])]
        cells.append([term_cell(r["law"]), *values, ratio(r["likelihood_ratio"])])
    head = ("radius over length", "least squares", "unexplained share", "likelihood ratio")
    caption = "Radius laws that compete; a likelihood ratio under 10 means “cannot tell”."
    return Table("radius_laws", caption, head, cells, keys, radius["rivals"], text=(0, 1))


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
    cells = [
        [words, *((chance if k == "ljung_box_p" else significant)(residual[w][k]) for w in ("before", "after"))]
        for k, words in wanted.items()
    ]
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
        other = after.get(d["variable"], {"share": None, "p_value": None})
        both = [told for x in (d, other) for told in (significant(x["share"], 2), chance(x["p_value"]))]
        cells.append([run.state_name(d["variable"]), *both])
        raw.append([d["variable"], d["share"], d["p_value"], other["share"], other["p_value"]])
    head = ("sorted by", "before: share", "p value", "after: share", "p value")
    keys = ("variable", "before_share", "before_p_value", "after_share", "after_p_value")
    caption = (
        "Share of the residual’s variance that each state explains (means of 12 equally filled bins; p value of an "
        "F test that takes samples as independent)."
    )
    return Table("dependence", caption, head, cells, keys, raw)


def ranking_table(run: Run) -> Table | None:
    """Return the candidates of every search through the catalogue, and what became of them."""
    keys = ("train", "held", "size", "model_error", "chi2", "parameters")
    cells, raw = [], []
    for i, search in enumerate(searches(run), 1):
        for place, c in enumerate(search.candidates):
            outcome = search.outcome(c["effects"])
            if outcome == "added":
                outcome += fate(run, c["effects"])
            raw.append([i, "; ".join(c["effects"]), outcome, *(c[k] for k in keys)])
            if place < _BEST or search.kind(c["effects"]) != "other":
                told = (None if blows_up(c) else c[k] for k in ("train", "held", "size", "model_error"))
                numbers = [significant(v) for v in told]
                cells.append([f"{i}", listed(map(effect_name, c["effects"])), outcome, *numbers, f"{c['parameters']}"])
    if not cells:
        return None
    sizes = ("training [nats]", "held out [nats]", "size", "model error left [noise sds]")
    head = ("search", "candidate", "outcome", *sizes, "free parameters")
    caption = (
        f"The {_BEST} most likely candidates of every search and all that were tried; the CSV file has every one that "
        "was weighed. Training: log evidence gained over the model of the search. Held out: log predictive score "
        "gained. Size: movement of the prediction over the model error that is left."
    )
    return Table("candidates", caption, head, cells, ("search", "effects", "outcome", *keys), raw, text=(1, 2))


def effects_table(run: Run) -> Table | None:
    """Return the evidence for every effect that was added by a search through the catalogue, an effect a column."""
    shown = [e for e in run.loop["effects"] if e["evidence"]]
    if not shown:
        return None
    rows = {
        "train": "log evidence gained, training [nats]",
        "held": "log predictive score gained, held out [nats]",
        "against_error": "log odds against being model error [nats]",
        "odds": "odds",
        "size": "size, over the model error that is left",
        "gain": "chi-square removed, training",
        "probability": "probability",
        "group_probability": "probability with those that serve as well",
    }
    words = {
        "odds": lambda v: chances(v).removeprefix("odds of "),
        "probability": probability_words,
        "group_probability": probability_words,
    }
    values = {key: [{**e["evidence"], **e}.get(key) for e in shown] for key in rows}
    cells = [[text, *(words.get(key, significant)(v) for v in values[key])] for key, text in rows.items()]
    caption = (
        "Evidence for each added effect: the final model against the best one without it, everything refitted. The "
        "odds are the smallest of three: training alone, training and held out together, against being model error."
    )
    head = ("", *(effect_name(e["id"]) for e in shown))
    raw = [[key, *values[key]] for key in rows]
    return Table("evidence", caption, head, cells, ("quantity", *(e["id"] for e in shown)), raw)


def model_error_table(run: Run) -> Table:
    """Return the model error before and after, and the size up to which it counts as none."""
    error = run.told["model_error"]
    sizes = {"before": "declared model", "after": "final model", "held": "held out", "least": "counts as none, up to"}
    scale = scale_for(error["unit"], max((error[k] or 0.0 for k in sizes), default=0.0))
    cells = [[text, scale.text(error[key]), scale.symbol] for key, text in sizes.items()]
    cells.append(["part that is left", share_words(error) or MISSING, ""])
    if run.loop["verdict"] not in AS_NONE:
        cells.append(["depends on", listed(map(effect_name, error["depends_on"])) or "nothing that was recorded", ""])
    raw = [[key, error[key], error["unit"]] for key in sizes]
    raw += [["share", error["share"], "1"], ["depends_on", "; ".join(error["depends_on"]), ""]]
    caption = (
        "The model error: what a model leaves beside the noise, correlated over the natural time. Its size is fitted "
        "with the parameters, and is one standard deviation."
    )
    return Table("model_error", caption, ("", "size", "unit"), cells, ("quantity", "value", "unit"), raw, text=(0, 2))
