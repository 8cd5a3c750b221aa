"""Tables and sentences of the posterior: convergence, priors, correlations, predictions, rivals."""

from __future__ import annotations

from discovery.foundation.start_names import start_words
from discovery.report.estimates import prior_words, symbol_of
from discovery.report.numbers import MISSING, fixed, interval, near_one, scale_for, significant
from discovery.report.results import Run
from discovery.report.tables import Cell, Table
from discovery.report.words import effect_name, error_scale, listed, prose

#: Diagnostics in words, and digits of those that need others.
_WORDS = {"r_hat": "R-hat", "ess": "samples", "ess_tail": "samples of the tails", "mcse": "error of the mean"}
_DIGITS = {"r_hat": 5, "mcse": 2}
#: R-hat up to which ensembles agree (Vehtari et al., Bayesian Analysis 16 (2021) 667).
_AGREE = 1.01


def pending_sentence(run: Run) -> str:
    """Return what of the posterior is not there, why, and how it comes; empty where all is."""
    pending = run.results.get("pending")
    if not pending or pending["because"] == "asked":
        said = "This run sampled no posterior." if run.is_whole else "A loop samples no posterior."
        return "" if run.posterior else said
    missing = listed(pending["left_out"])
    on = "The same command goes on from there."
    if pending["because"] == "running":
        return f"This was written before {missing} were there, which follow. Where the command was ended before: {on}"
    if pending["because"] != "time":
        return f"Left out: {missing}. {prose(pending['because'])}"
    reached = ""
    if pending.get("effective") is not None:
        reached = f" {significant(pending['effective'], 4)} of {pending['wanted']:.0f} effective samples were there."
    return f"The time limit left out {missing}.{reached} With more time, the same command goes on from there."


def priors_table(run: Run) -> Table | None:
    """Return prior against posterior, and what priors of other widths would do."""
    priors = run.posterior.get("priors")
    if not priors:
        return None
    factors = [w["factor"] for w in priors[0]["widths"]]
    cells, raw = [], []
    for p in priors:
        changes = [(fixed(w["shift"], 3), f"{fixed(100 * (w['sd_ratio'] - 1), 1)} %") for w in p["widths"]]
        about = [symbol_of(p["name"]), prior_words(p), near_one(p["contraction"])]
        cells.append([*about, *(cell for both in changes for cell in both), "yes" if p["sensitive"] else "no"])
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
    return Table("priors", caption, head, cells, keys, raw, text=(0, 1))


def prior_sentence(run: Run) -> str:
    """Return in one sentence whether the posterior leans on its priors; empty where it was not asked."""
    priors = run.posterior.get("priors")
    if not priors:
        return ""
    leaning = [prose(p["name"]) for p in priors if p["sensitive"]]
    if not leaning:
        return "No parameter leans on its prior: priors half and twice as wide give the same answer."
    return f"The recordings alone do not fix {listed(leaning)}: other priors would give another answer."


def profiles_table(run: Run) -> Table | None:
    """Return the intervals of the profile likelihood beside those of the posterior."""
    profiles = run.posterior.get("profiles")
    if not profiles:
        return None
    rows = {r["name"]: r for r in run.posterior["rows"]}
    cells, raw = [], []
    for p in profiles:
        r = rows[p["name"]]
        ends = [interval(*p["interval"]) if None not in p["interval"] else _open(p["interval"])]
        cells.append([symbol_of(p["name"]), *ends, interval(r["q05"], r["q95"])])
        raw.append([p["name"], *p["interval"], r["q05"], r["q95"]])
    head = ("", "profile likelihood", "posterior")
    keys = ("name", "profile_low", "profile_high", "q05", "q95")
    caption = (
        "90 % intervals of the profile likelihood, errors of the readings taken as independent, and of the posterior."
    )
    return Table("profiles", caption, head, cells, keys, raw)


def _open(ends: list[float | None]) -> str:
    low, high = ends
    if low is None and high is None:
        return MISSING
    return f"below {significant(high, 4)}" if low is None else f"above {significant(low, 4)}"


def correlation_sentences(run: Run) -> list[str]:
    """Return which parameters depend on each other, and how, the strongest pair first."""
    found = []
    for p in (run.posterior.get("correlations") or {}).get("pairs", ()):
        a, b = (prose(n) for n in p["pair"])
        how = "rise together" if p["correlation"] > 0 else "one rises where the other falls"
        found.append(f"{a} and {b}: {significant(p['correlation'], 2)}, {how}.")
    return found


def coverage_table(run: Run) -> Table | None:
    """Return how many readings lie within the 90 % predictive band."""
    rows = run.posterior.get("coverage")
    if not rows:
        return None
    cells = []
    keys = ("recording", "part", "channel", "readings", "share", "width", "unit")
    for r in rows:
        width = scale_for(r["unit"], r["width"]).quantity(r["width"])
        name = r["channel"].replace("_", " ")
        cells.append([r["recording"], r["part"], name, f"{r['readings']}", f"{100 * r['share']:.1f} %", width])
    head = ("recording", "part", "channel", "readings", "in the 90 % band", "width of the band")
    caption = (
        "Coverage: readings within the 90 % band of the posterior’s free-run predictions, noise included; about 90 % "
        "where model and noise are right. Of what is held out only the initial state was fitted."
    )
    return Table("coverage", caption, head, cells, keys, rows, text=(0, 1, 2))


def models_table(run: Run) -> Table | None:
    """Return candidate sets of effects by evidence, beside their errors on what was held out."""
    found = run.results.get("evidence")
    if not found:
        return None
    scale = error_scale(run.loop["errors"])
    cells: list[list[Cell]] = []
    keys = ("name", "noise", "behind", "error", "pareto_k", "free", "held_out")
    for m in found["models"]:
        unsure = "" if m["reliable"] else ", unreliable"
        about = [effect_name(m["name"]), ", ".join(effect_name(e) for e in m["effects"]), f"{m['free']}"]
        weight = f"{significant(-m['behind'], 4)} ± {significant(m['error'], 1)}"
        cells.append([*about, weight, significant(m["pareto_k"], 2) + unsure, scale.text(m["held_out"])])
    head = ("candidate", "effects", "free", "log evidence − best", "Pareto k", f"held out, rms [{scale.symbol}]")
    noise = listed(dict.fromkeys(effect_name(m["noise"]) for m in found["models"]))
    caption = (
        f"Candidates by evidence, which counts priors and noise: {noise} noise for all, because what the smaller model "
        "lacks is correlated."
    )
    if found.get("held_out_prefers"):
        caption += (
            " Beside it their free-run errors on what was held out, smaller is better; held out, "
            f"{effect_name(found['held_out_prefers'])} is best."
        )
    return Table("model_evidence", caption, head, cells, keys, found["models"], text=(0, 1))


def convergence_sentence(run: Run) -> str:
    """Return whether the sampler converged and by what numbers; empty without a posterior."""
    from discovery.posterior.diagnostics import LENGTH_IN_TAU
    from discovery.posterior.independence import LARGEST_K

    rows = run.posterior.get("rows")
    if not rows:
        return ""
    worst, fewest = max(rows, key=lambda r: r["r_hat"]), min(rows, key=lambda r: r["ess"])
    good = worst["r_hat"] <= _AGREE
    told = [
        f"the worst R-hat is {significant(worst['r_hat'], 5)} ({_called(worst['name'])}; limit {_AGREE})",
        f"the fewest effective samples are {significant(fewest['ess'], 3)} ({_called(fewest['name'])})",
    ]
    sampling = run.sampling
    if sampling:
        tau, steps = max(sampling["tau"].values()), sampling["steps"] - sampling["burn_in"]
        good = good and steps >= LENGTH_IN_TAU * tau
        ensembles = len(next(iter(run.draws.values())))
        made = f"{ensembles} independent ensembles of {sampling['walkers']} walkers each"
        if sampling.get("method") == "independence":
            k = f"Pareto k of their weights {significant(sampling['pareto_k'], 2)} (limit {LARGEST_K:g})"
            made = f"{ensembles} independent chains by Metropolis’s rule from draws around the fit, {k}"
        told.insert(0, made)
        told.append(
            f"{steps} steps after burn-in are {significant(steps / tau, 2)} times the longest autocorrelation time, "
            f"{significant(tau)} steps (limit {LENGTH_IN_TAU} times)"
        )
        moves = [f"{effect_name(move)} {100 * share:.0f} %" for move, share in sampling["acceptance"].items()]
        told.append(f"accepted proposals by move: {listed(moves)}")
    return f"{'Yes' if good else 'Not yet'}: {'; '.join(told)}."


def _called(name: str) -> str:
    return start_words(name) if "[" in name else prose(name)


def diagnostics_table(run: Run) -> Table | None:
    """Return R-hat, effective samples, Monte Carlo errors and autocorrelation times of what was sampled."""
    rows = run.quantities_sampled
    keys = [k for k in _WORDS if any(k in r for r in rows)]
    if not keys:
        return None
    tau = (run.posterior.get("autocorrelation") or {}).get("tau") or run.sampling.get("tau", {})
    cells, raw = [], []
    for r in rows:
        name = r["name"]
        times = [significant(tau.get(name))] if tau else []
        shown = symbol_of(name)
        cells.append([shown, *(significant(r.get(k), _DIGITS.get(k, 4)) for k in keys), *times])
        raw.append([name, *(r.get(k) for k in keys), *([tau.get(name)] if tau else [])])
    head = ("", *(_WORDS[k] for k in keys), *(["τ [steps]"] if tau else []))
    caption = (
        "How well the draws fix the posterior. R-hat: between independent ensembles. Samples: effective number, of the "
        "bulk and of the 5 and 95 % quantiles. Error of the mean: Monte Carlo standard error, in the unit of the "
        "parameter. τ: autocorrelation time."
    )
    return Table("diagnostics", caption, head, cells, ("name", *keys, *(["tau"] if tau else [])), raw)
