"""Tables and sentences of the posterior: its priors, what its parameters share, how well it predicts, which noise."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from discovery.mechanics import base_names, get_base
from discovery.registry import catalogue
from discovery.report.estimates import prior_words, symbol_of
from discovery.report.numbers import MISSING, fixed, interval, near_one, scale_for, significant
from discovery.report.results import Run
from discovery.report.tables import Cell, Table
from discovery.report.words import effect_name, listed, prose

__all__ = [
    "correlation_sentences",
    "coverage_table",
    "models_table",
    "noise_sentence",
    "noise_table",
    "prior_sentence",
    "priors_table",
    "profiles_table",
]


def _posterior(run: Run) -> Mapping[str, Any]:
    return run.results.get("posterior") or {}


def priors_table(run: Run) -> Table | None:
    """Return prior against posterior, and what priors of other widths would do."""
    priors = _posterior(run).get("priors")
    if not priors:
        return None
    factors = [w["factor"] for w in priors[0]["widths"]]
    cells, raw = [], []
    for p in priors:
        changes = [(fixed(w["shift"], 3), f"{fixed(100 * (w['sd_ratio'] - 1), 1)} %") for w in p["widths"]]
        cells.append(
            [
                symbol_of(p["name"]),
                prior_words(p),
                near_one(p["contraction"]),
                *(cell for both in changes for cell in both),
                "yes" if p["sensitive"] else "no",
            ]
        )
        numbers = [x for w in p["widths"] for x in (w["shift"], w["sd_ratio"], w["effective"])]
        raw.append([p["name"], p["law"], p["prior_sd"], p["contraction"], *numbers, p["sensitive"]])
    widths = [f"widths × {f:g}" for f in factors]
    head = ("", "prior", "contraction", *(f"{w}: {x}" for w in widths for x in ("shift [sd]", "change of sd")), "leans")
    keys = (
        "name", "law", "prior_sd", "contraction",
        *(f"{x}_{f:g}" for f in factors for x in ("shift", "sd_ratio", "effective")), "sensitive",
    )  # fmt: skip
    caption = (
        "Prior against posterior. Contraction: 1 − variance after / variance before; 1 where the recordings say all. "
        "Then the draws reweighted to priors that are all half and twice as wide: how far the mean moves, in posterior "
        "standard deviations, and how the standard deviation changes. Leans: either by more than 0.2."
    )
    return Table("priors", caption, head, cells, keys, raw, (0, 1))


def prior_sentence(run: Run) -> str:
    """Return in one sentence whether the posterior leans on its priors; empty where it was not asked."""
    priors = _posterior(run).get("priors")
    if not priors:
        return ""
    leaning = [prose(p["name"]) for p in priors if p["sensitive"]]
    if not leaning:
        return "No parameter leans on its prior: priors half and twice as wide give the same answer."
    return f"The recordings alone do not fix {listed(leaning)}: other priors would give another answer."


def profiles_table(run: Run) -> Table | None:
    """Return the intervals of the profile likelihood beside those of the posterior."""
    profiles = _posterior(run).get("profiles")
    if not profiles:
        return None
    rows = {r["name"]: r for r in _posterior(run)["rows"]}
    cells, raw = [], []
    for p in profiles:
        r = rows[p["name"]]
        ends = [interval(*p["interval"]) if None not in p["interval"] else _open(p["interval"])]
        cells.append([symbol_of(p["name"]), *ends, interval(r["q05"], r["q95"])])
        raw.append([p["name"], *p["interval"], r["q05"], r["q95"]])
    return Table(
        "profiles",
        "90 % intervals of the profile likelihood, errors of the readings taken as independent, and of the posterior.",
        ("", "profile likelihood", "posterior"),
        cells,
        ("name", "profile_low", "profile_high", "q05", "q95"),
        raw,
    )


def _open(ends: list[float | None]) -> str:
    low, high = ends
    if low is None and high is None:
        return MISSING
    return f"below {significant(high, 4)}" if low is None else f"above {significant(low, 4)}"


def correlation_sentences(run: Run) -> list[str]:
    """Return what the parameters that depend on each other share, the strongest pair first."""
    found = []
    for p in (_posterior(run).get("correlations") or {}).get("pairs", ()):
        a, b = (prose(n) for n in p["pair"])
        how = "rise together" if p["correlation"] > 0 else "one rises where the other falls"
        found.append(f"{a} and {b} ({significant(p['correlation'], 2)}, {how}): {prose(p['meaning'])}.")
    return found


def coverage_table(run: Run) -> Table | None:
    """Return how many readings lie within the 90 % predictive band."""
    rows = _posterior(run).get("coverage")
    if not rows:
        return None
    cells, raw = [], []
    keys = ("recording", "part", "channel", "readings", "share", "width", "unit")
    for r in rows:
        scale = scale_for(r["unit"], r["width"])
        width = f"{significant(r['width'] * scale.factor)} {scale.symbol}".strip()
        name = r["channel"].replace("_", " ")
        cells.append([r["recording"], r["part"], name, f"{r['readings']}", f"{100 * r['share']:.1f} %", width])
        raw.append([r[k] for k in keys])
    head = ("recording", "part", "channel", "readings", "in the 90 % band", "width of the band")
    caption = (
        "Coverage: readings within the 90 % band of the posterior’s free-run predictions, noise included; about 90 % "
        "where model and noise are right. Of what is held out only the initial state was fitted."
    )
    return Table("coverage", caption, head, cells, keys, raw, (0, 1, 2))


def _physical(names: Iterable[str]) -> list[str]:
    """Return the names that are parameters of some effect or base, not of the noise nor of a start."""
    owners: list[Any] = [*catalogue().values(), *(get_base(b) for b in base_names())]
    declared = {p.name for owner in owners for p in owner.parameters()}
    return [n for n in names if n in declared]


def noise_sentence(run: Run) -> str:
    """Return in one sentence which noise is chosen, and what it does to the intervals; empty where it was not asked."""
    noise = run.results.get("noise")
    if not noise:
        return ""
    wider = [noise["widening"][n] for n in _physical(noise.get("widening", ()))]
    chosen = f"The evidence prefers {effect_name(noise['chosen'])} noise"
    if noise["chosen"] == "gaussian" or not wider:
        return f"{chosen}."
    span = " to ".join(dict.fromkeys(significant(w, 2) for w in (min(wider), max(wider))))
    return f"{chosen}: intervals are {span} times as wide as where errors count as independent and Gaussian."


def models_table(run: Run) -> Table | None:
    """Return candidate sets of effects by evidence, beside their errors on what was held out."""
    found = run.results.get("evidence")
    if not found:
        return None
    cells: list[list[Cell]] = []
    keys = ("name", "behind", "error", "pareto_k", "free", "held_out")
    for m in found["models"]:
        unsure = "" if m["reliable"] else ", unreliable"
        cells.append(
            [
                effect_name(m["name"]),
                ", ".join(effect_name(e) for e in m["effects"]),
                f"{m['free']}",
                f"{significant(-m['behind'], 4)} ± {significant(m['error'], 1)}",
                significant(m["pareto_k"], 2) + unsure,
                significant(m["held_out"], 4),
            ]
        )
    head = ("candidate", "effects", "free", "log evidence − best", "Pareto k", "held out")
    caption = (
        "Candidates by evidence, which counts priors and noise, beside their errors on what was held out, smaller is "
        f"better; held out, {effect_name(found['held_out_prefers'])} is best."
        if found.get("held_out_prefers")
        else "Candidates by evidence."
    )
    raw = [[m[k] for k in keys] for m in found["models"]]
    return Table("model_evidence", caption, head, cells, keys, raw, (0, 1))


def noise_table(run: Run) -> Table | None:
    """Return the noise models side by side: evidence, and the interval of every parameter under each."""
    noise = run.results.get("noise")
    if not noise or not noise.get("models"):
        return None
    models = noise["models"]
    names = _physical(models[0]["intervals"])
    best = max(m["log_evidence"] for m in models)
    cells: list[list[Cell]] = []
    raw: list[list[Any]] = []
    for m in models:
        name = effect_name(m["noise"]) + (" (chosen)" if m["noise"] == noise["chosen"] else "")
        unsure = "" if m["reliable"] else ", unreliable"
        cells.append(
            [
                name,
                f"{significant(m['log_evidence'] - best, 4)} ± {significant(m['error'], 1)}",
                significant(m["pareto_k"], 2) + unsure,
                *(interval(*(m["intervals"].get(n) or (None, None, None))[::2]) for n in names),
            ]
        )
        ends = [x for n in names for x in (m["intervals"].get(n) or (None,) * 3)]
        raw.append([m["noise"], m["log_evidence"], m["error"], m["pareto_k"], *ends])
    head = ("noise", "log evidence − best", "Pareto k", *(symbol_of(n) for n in names))
    keys = ("noise", "log_evidence", "error", "pareto_k", *(f"{n}_{q}" for n in names for q in ("q05", "q50", "q95")))
    caption = (
        "Models of the noise: log of the evidence against the best, with its error; Pareto k above 0.7 means that "
        "it cannot be trusted; then the 90 % interval of every parameter under that noise."
    )
    return Table("noise", caption, head, cells, keys, raw)
