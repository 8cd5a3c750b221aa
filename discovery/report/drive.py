"""What drives a system, and what the symbols of it on the right of its equation mean."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from markupsafe import Markup

from discovery.equations.equation import MOVING_INPUT, equation_terms
from discovery.equations.model import Model
from discovery.mechanics import get_base
from discovery.report.equations import undriven
from discovery.report.numbers import unit_text
from discovery.report.results import Run
from discovery.report.style import label
from discovery.report.tables import name_cell


def drive_symbols(model: Mapping[str, Any]) -> dict[str, str]:
    """Return what stands for the input of a system on a line, by symbol: its gains, and u; nothing without an input.

    The model is what `discovery.equations.model.Model.to_dict` gave.
    """
    base = get_base(model["base"])
    if base.system.has_rod or base.places() or undriven(model):
        return {}
    free = equation_terms(Model(model["base"], tuple(model["effects"]))).drive.free_symbols
    if not free & set(MOVING_INPUT):
        return {}
    names = {symbol.name for symbol in free}
    return {**{p.name: p.meaning for p in base.parameters() if p.name in names}, "u": "recorded input"}


def drive_words(run: Run) -> Markup:
    """Return what the symbols of the input mean, as part of a sentence; empty without one."""
    name, unit = run.input_name, unit_text(run.input_unit)
    found = [
        Markup("{} is the {}").format(name_cell(symbol), label(f"recorded {name}", unit) if symbol == "u" else meaning)
        for symbol, meaning in drive_symbols(run.loop["model"]["before"]["model"]).items()
    ]
    return Markup(", ").join(found)
