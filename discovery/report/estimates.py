"""Tables of parameters: posterior, fits, the final model, and the check against the elastica."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from markupsafe import Markup

from discovery.declarations.registry import get_effect
from discovery.foundation.start_names import is_state, start_of, start_words
from discovery.mechanics import get_base
from discovery.report.numbers import MISSING, in_newtons, interval, rounded, significant, uncertain, unit_text
from discovery.report.references import paper_numbers
from discovery.report.results import Run
from discovery.report.tables import Cell, Table, name_cell
from discovery.report.words import LAWS, MASSES, effect_name

#: Columns of a summary that tell how well the mean and the quantiles are known from the draws.
_DIAGNOSTICS = ("r_hat", "ess", "mcse", "ess_tail")
_ORDER = ("alpha", "beta", "beta/alpha", "gamma")
#: Columns of the final model on a narrow screen: values before words.
_NARROW = (0, 3, 2, 4, 1, 5)
#: The same with a column in newtons and kilograms before the last one.
_NARROW_TOLD = (0, 3, 2, 5, 4, 1, 6)


def published(run: Run) -> Mapping[str, Any]:
    """Return the source paper's numbers where the run's rig is the paper's, else nothing."""
    paper = paper_numbers()
    quantities = run.results["rig"].get("quantities", {})
    same = run.system.has_rod and all(
        name in quantities and abs(quantities[name]["value"] - value) < 1e-3 * value
        for name, value in paper["rig"].items()
    )
    return paper if same else {}


def declared_parameters(model: Mapping[str, Any]) -> dict[str, Any]:
    """Return the declarations of a model's parameters by name."""
    owners: list[Any] = [get_base(model["base"]), *(get_effect(e) for e in model["effects"])]
    return {p.name: p for owner in owners for p in owner.parameters()}


def _meaning(name: str, declared: Mapping[str, Any], otherwise: str = "noise, sd") -> str:
    return str(declared[name].meaning) if name in declared else otherwise


def _noise_words(row: Mapping[str, Any], run: Run) -> str:
    """Return what the size of the noise is: in its unit, or a multiple of what was stated or estimated."""
    words = str(row.get("meaning", "noise, sd"))
    if unit_text(row["unit"]) or words != "noise, sd":
        return words
    estimated = any(r.get("noise_estimated") for r in run.results["recordings"])
    return f"noise, sd over the {'estimated' if estimated else 'stated'} one"


def unit_of(name: str, unit: str, run: Run) -> str:
    """Return the unit of a parameter as a reader writes it; that of the gain of an input has the input's unit below."""
    printed, given = unit_text(unit, run.coordinate_unit), unit_text(run.input_unit)
    return f"{printed} per {given}" if name == "g" and given and not run.system.has_rod else printed


def symbol_of(name: str) -> Markup | str:
    """Return the symbol of a parameter as mathematics, or the words for what is one of a recording."""
    start = start_of(name)
    if start and not is_state(start[0]):
        return Markup("{} of {}").format(name_cell(start[0]), start[1])
    return start_words(name) if start else name_cell(name)


def sampled_parameters(run: Run) -> dict[str, Any]:
    """Return the declarations of the parameters of the model that the posterior is of, by name."""
    which = "after" if run.posterior.get("subject") == "after" else "before"
    return declared_parameters(run.loop["model"][which]["model"])


def posterior_table(run: Run) -> Table | None:
    """Return the sampled parameters and noise beside the fit and, on the paper's rig, the paper."""
    from discovery.posterior.noise import is_independent

    if not run.posterior:
        return None
    rows = run.quantities_sampled
    declared, paper = sampled_parameters(run), published(run).get("parameters", {})
    cells = []
    for r in rows:
        name, sd = r["name"], r["sd"]
        about = [symbol_of(name), _meaning(name, declared, _noise_words(r, run)), unit_of(name, r["unit"], run)]
        draws = [uncertain(r["mean"], sd), *(rounded(r[q], sd) for q in ("q05", "q50", "q95"))]
        beside = [significant(paper.get(name), 4)] if paper else []
        cells.append([*about, *draws, uncertain(r["fit_value"], r["fit_sd"]), *beside])
    known = [k for k in _DIAGNOSTICS if any(k in r for r in rows)]
    head = (
        "", "meaning", "unit", "mean ± sd", "5 %", "50 %", "95 %", "fit ± sd",
        *(["paper, least squares"] if paper else []),
    )  # fmt: skip
    keys = ("name", "unit", "mean", "sd", "q05", "q50", "q95", "fit_value", "fit_sd", *known)
    kind = rows[0]["interval"] if rows else "90 % interval"
    caption = f"Parameters. 5 to 95 %: {kind}. Fit: least squares, with a standard deviation that counts residuals as "
    caption += f"correlated as they are; that of the posterior ({effect_name(run.noise_sampled)} noise) " + (
        "does not." if is_independent(run.noise_sampled) else "is that of its own noise."
    )
    order = (0, 3, 2, 4, 5, 6, 7, *([8] if paper else []), 1)
    return Table("posterior", caption, head, cells, keys, rows, text=(0, 1, 2), narrow=order)


def prior_words(prior: Mapping[str, Any] | None) -> str:
    """Return a prior in short, in the unit of its parameter."""
    if prior is None:
        return MISSING
    law = prior["law"]
    if law == "normal":
        return f"normal, {uncertain(prior['mean'], prior['sd'])}"
    if law in ("half-t", "t"):
        return f"{law}, scale {significant(prior['scale'], 2)}"
    if law == "log-uniform":
        return f"log-uniform, within a factor of {significant(prior['factor'], 2)} of {significant(prior['size'], 2)}"
    if law == "log-normal":
        return f"log-normal, median {significant(prior['median'], 2)}, log sd {significant(prior['log_sd'], 2)}"
    return str(law)


def nuisance_table(run: Run) -> Table | None:
    """Return the sampled initial states."""
    shown = {r["name"] for r in run.quantities_sampled}
    rows = [r for r in run.posterior.get("rows", ()) if r["name"] not in shown]
    if not rows:
        return None
    cells: list[list[Cell]] = []
    for r in rows:
        values = [uncertain(r["mean"], r["sd"]), interval(r["q05"], r["q95"])]
        cells.append([start_words(r["name"]), unit_text(r["unit"], run.coordinate_unit), *values])
    keys = ("name", "unit", "mean", "sd", "q05", "q50", "q95")
    head = ("", "unit", "mean ± sd", "90 % interval")
    caption = "Initial states, sampled with the parameters."
    return Table("initial_states", caption, head, cells, keys, rows, text=(0, 1))


def final_table(run: Run) -> Table:
    """Return the parameters of the final model, with the reason where an interval is missing."""
    after, before = run.loop["model"]["after"], run.loop["model"]["before"]["parameters"]
    declared, physical = declared_parameters(after["model"]), after.get("physical", {})
    cells, raw = [], []
    for name, p in after["parameters"].items():
        if "[" in name:
            continue
        old = before.get(name)
        about = [symbol_of(name), _meaning(name, declared), unit_of(name, p["unit"], run)]
        both = [uncertain(p["value"], p["sd"]), uncertain(old["value"], old["sd"]) if old else MISSING]
        forces = [in_newtons(physical.get(name)) or MISSING] if physical else []
        cells.append([*about, *both, *forces, p.get("reason", "")])
        raw.append([name, p["unit"], p["value"], p["sd"], p.get("reason", "")])
    told = ["in newtons and kilograms"] if physical else []
    unsure = any(row[-1] for row in cells)
    if not unsure:
        cells = [row[:-1] for row in cells]
    head = ("", "meaning", "unit", "final ± sd", "before ± sd", *told, *(["why no interval"] if unsure else []))
    caption = "Parameters of the final model, least squares, one standard deviation; initial states are not listed."
    keys = ("name", "unit", "value", "sd", "reason")
    text = (0, 1, 2, *([len(head) - 1] if unsure else []))
    narrow = tuple(i for i in (_NARROW_TOLD if physical else _NARROW) if i < len(head))
    return Table("final_model", caption, head, cells, keys, raw, text=text, narrow=narrow)


def _alike(comparison: Sequence[Mapping[str, Any]]) -> Iterable[list[Mapping[str, Any]]]:
    """Return the rows of the comparison in groups of the same prediction, in the order of the page."""
    merged: dict[tuple[Any, ...], list[Mapping[str, Any]]] = {}
    for row in sorted(
        comparison, key=lambda r: _ORDER.index(r["parameter"]) if r["parameter"] in _ORDER else len(_ORDER)
    ):
        key = (row["parameter"], f"{row['predicted_mean']:.9e}", f"{row['predicted_sd']:.6e}")
        merged.setdefault(key, []).append(row)
    return merged.values()


def elastica_table(run: Run) -> Table | None:
    """Return posterior against prediction; variants that predict the same number share a row."""
    comparison = (run.results.get("elastica") or {}).get("comparison")
    if not comparison:
        return None
    cells = []
    for rows in _alike(comparison):
        r = rows[0]
        masses = dict.fromkeys(MASSES.get(x["mass"], x["mass"]) for x in rows)
        laws = dict.fromkeys(LAWS.get(x["law"], x["law"]) for x in rows)
        about = [name_cell(r["parameter"]), unit_text(r["unit"]), "either" if len(masses) > 1 else next(iter(masses))]
        both = [uncertain(r[f"{of}_mean"], r[f"{of}_sd"]) for of in ("posterior", "predicted")]
        apart = significant(r["discrepancy"], 2) if r["discrepancy"] is not None else "∞"
        cells.append([*about, "; ".join(laws), *both, apart])
    head = ("", "unit", "rod’s mass", "law", "posterior ± sd", "elastica ± sd", "difference [sd]")
    means = ("posterior_mean", "posterior_sd", "predicted_mean", "predicted_sd")
    keys = ("mass", "law", "parameter", "unit", *means, "difference", "discrepancy")
    caption = (
        "Posterior against what the elastica predicts from the rig file; the difference is in standard deviations of "
        "both together. Massless and counted: the rod’s own mass left out, or added to the tip as 33/140 of it. "
        f"Standard deviations of the posterior are those under {effect_name(run.noise_sampled)} noise."
    )
    return Table("elastica", caption, head, cells, keys, comparison, text=(0, 1, 2, 3))
