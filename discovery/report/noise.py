"""Which noise the readings have: that of the posterior on the page, and that which the evidence prefers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from discovery.declarations.registry import catalogue
from discovery.mechanics import base_names, get_base
from discovery.report.estimates import published, sampled_parameters, symbol_of, unit_of
from discovery.report.numbers import MISSING, interval, rounded, significant, uncertain
from discovery.report.results import Run
from discovery.report.tables import Cell, Table
from discovery.report.words import effect_name, listed, prose

#: Noise models that do not apply to every recording, and why not.
_NEEDS = {"input": "no recorded input moves what is read", "quantised": "readings do not come in steps"}
#: Log evidence [nats] by which one noise model must lead another to be preferred: odds of 20 to 1.
_PREFERRED = 3.0
#: Standard deviations in a 90 % interval of a Gaussian.
_WIDTH = 3.29
#: Manoeuvres up to which even intervals under correlated noise are not safe.
_FEW = {1: "one manoeuvre was", 2: "two manoeuvres were"}


def _physical(names: Iterable[str]) -> list[str]:
    """Return the names that are parameters of some effect or base, not of the noise nor of a start."""
    owners: list[Any] = [*catalogue().values(), *(get_base(b) for b in base_names())]
    declared = {p.name for owner in owners for p in owner.parameters()}
    return [n for n in names if n in declared]


def preferred_noise(run: Run) -> Mapping[str, Any] | None:
    """Return the noise model of largest evidence, where it leads that of the posterior by odds of 20 to 1."""
    weighed = run.results.get("noise") or {}
    models = {m["noise"]: m for m in weighed.get("models", ())}
    best, sampled = models.get(weighed.get("chosen")), models.get(run.noise_sampled)
    if best is None or best is sampled:
        return None
    leads = sampled is None or best["log_evidence"] - sampled["log_evidence"] > _PREFERRED
    return best if leads else None


def noise_differs(run: Run) -> list[str]:
    """Return what to know where the noise of the posterior is not the preferred one, in sentences; else nothing."""
    from discovery.posterior.noise import words_of

    best = preferred_noise(run)
    if best is None or not run.posterior:
        return []
    sampled, preferred = effect_name(run.noise_sampled), effect_name(best["noise"])
    others: Mapping[str, Any] = best["intervals"]
    rows = {r["name"]: r for r in run.quantities_sampled}
    apart = [
        prose(n)
        for n in _physical(rows)
        if n in others and (others[n][0] > rows[n]["q95"] or others[n][2] < rows[n]["q05"])
    ]
    elastica = " and the check against the elastica" if run.results.get("elastica") else ""
    found = [
        f"The evidence prefers {preferred} noise, and the table says what the parameters are under it. The draws take "
        f"errors of the readings as {words_of(run.noise_sampled)} ({sampled} noise): so do the corner plot, the "
        f"profiles{elastica}.",
        f"Under {preferred} noise the 90 % interval{'s' * (len(apart) > 1)} of {listed(apart)} "
        f"{'do' if len(apart) > 1 else 'does'} not overlap that of the draws."
        if apart
        else f"Under {preferred} noise the 90 % intervals overlap those of the draws.",
    ]
    few = _FEW.get(sum(r["role"] == "train" for r in run.results["recordings"]))
    if few:
        found.append(
            f"Nor are intervals under {preferred} noise safe where, as here, only {few} fitted: a parameter of an "
            "incomplete model depends on the manoeuvre."
        )
    return found


def noise_sentence(run: Run) -> str:
    """Return in one sentence which noise is chosen, and what it does to the intervals; empty where it was not asked."""
    noise = run.results.get("noise")
    if not noise:
        return ""
    wider = [noise["widening"][n] for n in _physical(noise.get("widening", ()))]
    if noise["chosen"] != run.noise_sampled and preferred_noise(run) is None:
        return (
            f"The evidence cannot tell {effect_name(noise['chosen'])} noise from {effect_name(run.noise_sampled)} "
            "noise: the odds are less than 20 to 1."
        )
    chosen = f"The evidence prefers {effect_name(noise['chosen'])} noise"
    if noise["chosen"] == "gaussian" or not wider:
        return f"{chosen}."
    span = " to ".join(dict.fromkeys(significant(w, 2) for w in (min(wider), max(wider))))
    return f"{chosen}: intervals are {span} times as wide as where errors count as independent and Gaussian."


def honest_table(run: Run) -> Table | None:
    """Return the parameters under the noise that the evidence prefers to that of the posterior; None without one."""
    best = preferred_noise(run)
    if best is None or not run.posterior:
        return None
    declared, paper = sampled_parameters(run), published(run).get("parameters", {})
    cells, raw = [], []
    for r in run.quantities_sampled:
        low, middle, high = best["intervals"].get(r["name"], (None, None, None))
        if low is None or r["name"] not in declared:
            continue
        name, width = r["name"], high - low
        about = [symbol_of(name), str(declared[name].meaning), unit_of(name, r["unit"], run)]
        ends = [rounded(end, width / _WIDTH) for end in (middle, low, high)]
        wider = significant(width / (r["q95"] - r["q05"]), 2) if r["q95"] > r["q05"] else MISSING
        beside = [significant(paper.get(name), 4)] if paper else []
        cells.append([*about, *ends, wider, uncertain(r["fit_value"], r["fit_sd"]), *beside])
        raw.append([r["name"], r["unit"], low, middle, high, r["q05"], r["q95"]])
    told = ["paper, least squares"] if paper else []
    head = ("", "meaning", "unit", "median", "5 %", "95 %", "times as wide as the draws", "fit ± sd", *told)
    caption = (
        f"Parameters. 5 to 95 %: 90 % credible interval under {effect_name(best['noise'])} noise, which the evidence "
        "prefers. Fit: least squares, with a standard deviation that counts residuals as correlated as they are."
    )
    keys = ("name", "unit", "q05", "q50", "q95", "sampled_q05", "sampled_q95")
    order = (0, 3, 2, 4, 5, 6, 7, *([8] if paper else []), 1)
    return Table("parameters", caption, head, cells, keys, raw, text=(0, 1, 2), narrow=order)


def noise_table(run: Run) -> Table | None:
    """Return the noise models side by side: evidence, and the interval of every parameter under each."""
    noise = run.results.get("noise")
    if not noise or not noise.get("models"):
        return None
    models = noise["models"]
    sampled = run.noise_sampled if run.posterior else None
    preferred = noise["chosen"] if preferred_noise(run) or noise["chosen"] == run.noise_sampled else None
    names = _physical(models[0]["intervals"])
    best = max(m["log_evidence"] for m in models)
    cells: list[list[Cell]] = []
    raw: list[list[Any]] = []
    for m in models:
        marks = [w for w, n in (("preferred", preferred), ("sampled", sampled)) if n == m["noise"]]
        name = effect_name(m["noise"]) + (f" ({', '.join(marks)})" if marks else "")
        unsure = "" if m["reliable"] else ", unreliable"
        weight = f"{significant(m['log_evidence'] - best, 4)} ± {significant(m['error'], 1)}"
        told = [interval(*(m["intervals"].get(n) or (None, None, None))[::2]) for n in names]
        cells.append([name, weight, significant(m["pareto_k"], 2) + unsure, *told])
        ends = [x for n in names for x in (m["intervals"].get(n) or (None,) * 3)]
        raw.append([m["noise"], m["log_evidence"], m["error"], m["pareto_k"], *ends])
    head = ("noise", "log evidence − best", "Pareto k", *(symbol_of(n) for n in names))
    keys = ("noise", "log_evidence", "error", "pareto_k", *(f"{n}_{q}" for n in names for q in ("q05", "q50", "q95")))
    caption = (
        "Models of the noise: log of the evidence against the best, with its error; Pareto k above 0.7 means that "
        "it cannot be trusted; then the 90 % interval of every parameter under that noise. Sampled: the noise of the "
        "posterior on this page."
    )
    absent = [f"{n} ({why})" for n, why in _NEEDS.items() if n not in {m["noise"] for m in models}]
    if absent:
        caption += f" Not asked, because it does not apply: {listed(absent)}."
    return Table("noise", caption, head, cells, keys, raw)
