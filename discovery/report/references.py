"""What to cite: the sources of exactly the effects and methods that a run used, and the source paper's own numbers."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from typing import Any

from discovery.declarations.registry import get_effect
from discovery.mechanics.upgrades import UPGRADES
from discovery.report.effect_formulas import effect_formula
from discovery.report.mathml import inline
from discovery.report.results import Run
from discovery.report.tables import Table
from discovery.report.words import effect_name, effect_title, in_catalogue


def _effects_used(run: Run) -> list[tuple[str, str, str, str, str]]:
    """Return name, role, title, formula and source of the declared effects, then of those that the loop added."""
    found = []
    system = run.results["rig"]["kind"]
    added = [e["id"] for e in run.loop["effects"]]
    for role, effects in (("declared", run.loop["declared"]), ("added", added)):
        for effect_id in effects:
            known = get_effect(effect_id) if in_catalogue(effect_id) else None
            law = "" if known is None else effect_formula(known, system)
            source = known or UPGRADES.get(effect_id)
            cite = _named(source.cite if source else "", run)
            found.append((effect_name(effect_id), role, effect_title(effect_id), law, cite))
    return found


def _named(cite: str, run: Run) -> str:
    """Return a source with the name of the arm's paper; a system without a rod has its laws from elsewhere."""
    if run.system.has_rod:
        return cite.replace("source paper", paper_numbers()["source"])
    parts = [part for part in cite.split("; ") if "source paper" not in part]
    return "; ".join(parts) or "elementary mechanics"


def sources_table(run: Run) -> Table:
    """Return the effects of the final model with their formulas and sources."""
    cells, raw = [], []
    for name, role, title, law, cite in _effects_used(run):
        cells.append([name + (" (added)" if role == "added" else ""), title, inline(law) if law else "", cite])
        raw.append([name, role, title, law, cite])
    head = ("effect", "what it is", "formula", "source")
    keys = ("effect", "role", "what_it_is", "formula_latex", "source")
    caption = "Effects of the declared model, and those that were added."
    return Table("sources", caption, head, cells, keys, raw, text=(0, 1, 2, 3))


def methods_used(run: Run) -> list[Mapping[str, str]]:
    """Return text and BibTeX of the methods whose results the run holds."""
    text = files("discovery.report").joinpath("templates/references.toml").read_text(encoding="utf-8")
    return [m for m in tomllib.loads(text)["method"] if _there(run.results, m["when"])]


def _there(results: Any, part: str) -> bool:
    """Return whether the results hold something under a name, or under names joined by dots."""
    for name in part.split("."):
        results = (results or {}).get(name)
    return bool(results)


@cache
def paper_numbers() -> dict[str, Any]:
    """Return rig, parameters, manoeuvre and errors that the paper prints, in SI units; see ``published.toml``."""
    text = files("discovery.report").joinpath("templates/published.toml").read_text(encoding="utf-8")
    return tomllib.loads(text)
