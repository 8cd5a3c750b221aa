"""Whether the sampler converged: one sentence, and the diagnostics of every quantity."""

from __future__ import annotations

from discovery.report.estimates import start_words, symbol_of
from discovery.report.numbers import significant
from discovery.report.results import Run
from discovery.report.tables import Table
from discovery.report.words import effect_name, listed, prose

_WORDS = {
    "r_hat": "R-hat",
    "ess": "samples",
    "ess_tail": "samples of the tails",
    "mcse": "error of the mean",
}
_DIGITS = {"r_hat": 5, "mcse": 2}
#: R-hat up to which ensembles agree (Vehtari et al., Bayesian Analysis 16 (2021) 667).
_AGREE = 1.01


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
        shown = start_words(name) if "[" in name else symbol_of(name)
        cells.append([shown, *(significant(r.get(k), _DIGITS.get(k, 4)) for k in keys), *times])
        raw.append([name, *(r.get(k) for k in keys), *([tau.get(name)] if tau else [])])
    head = ("", *(_WORDS[k] for k in keys), *(["τ [steps]"] if tau else []))
    caption = (
        "How well the draws fix the posterior. R-hat: between independent ensembles. Samples: effective number, of the "
        "bulk and of the 5 and 95 % quantiles. Error of the mean: Monte Carlo standard error, in the unit of the "
        "parameter. τ: autocorrelation time."
    )
    return Table("diagnostics", caption, head, cells, ("name", *keys, *(["tau"] if tau else [])), raw)
