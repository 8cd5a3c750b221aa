"""The two tables that set the paper's numbers beside ours."""

from __future__ import annotations

from collections.abc import Mapping
from math import pi
from typing import Any

from benchmarks.paper.items import Item
from benchmarks.paper.stand import POSITION_NOISE
from discovery.report.numbers import significant
from discovery.report.references import paper_numbers
from discovery.report.tables import Table


def item_table(name: str, caption: str, items: list[Item]) -> Table:
    """Return rows of the paper's items."""
    rows = [(i.key, i.what, i.paper, i.ours, i.difference, i.reason) for i in items]
    head = ("", "item", "paper", "here", "difference", "reason")
    return Table(
        name, caption, head, rows, ("key", "item", "paper", "here", "difference", "reason"), rows, (0, 1, 2, 3, 5)
    )


def calibration_table(comparison: Mapping[str, Any]) -> Table:
    """Return P11 to P15: paper, twin with the paper's models on both calibrations, after the loop, first principles."""
    paper = paper_numbers()
    errors, parameters, move = paper["errors"], paper["parameters"], paper["manoeuvre"]
    twins = [comparison["printed"], comparison["calibrated"]]
    rows: list[tuple[str, ...]] = []
    raw: list[tuple[Any, ...]] = []

    def add(what: str, unit: str, printed: float | None, ours: list[Any], after: Any = None, first: Any = None) -> None:
        factor = 1e3 if unit in ("mm", "mrad") else 1.0
        numbers = [None if v is None else factor * v for v in (printed, *ours, after, first)]
        rows.append((what, unit, *(significant(v, 4) for v in numbers)))
        raw.append((what, unit, *numbers))

    loop, first = twins[0]["loop"]["values"], twins[0]["first_principles"]
    rod = first["rod_counted"]
    add("largest deflection", "rad", move["deflection"], [t["excursion"]["deflection"] for t in twins])
    add("variation of the radius", "mm", move["radius_variation"], [t["excursion"]["radius_variation"] for t in twins])
    add("linear: ξ", "s⁻¹", paper["linear"]["xi"], [t["linear"]["values"]["xi"] for t in twins])
    add(
        "linear: ω²",
        "s⁻²",
        paper["linear"]["omega2"],
        [t["linear"]["values"]["alpha"] for t in twins],
        first=rod["alpha"],
    )
    add(
        "cubic: ξ",
        "s⁻¹",
        parameters["xi"],
        [t["cubic"]["values"]["xi"] for t in twins],
        loop["xi"],
        first["xi"]["value"],
    )
    add(
        "cubic: α",
        "s⁻²",
        parameters["alpha"],
        [t["cubic"]["values"]["alpha"] for t in twins],
        loop["alpha"],
        rod["alpha"],
    )
    add("cubic: β", "s⁻²", parameters["beta"], [t["cubic"]["values"]["beta"] for t in twins], first=rod["beta"])
    add("radius law: γ", "", parameters["gamma"], [t["gamma"]["value"] for t in twins], first=rod["gamma"])
    listed = (
        ("angle, mean: linear", "mrad", "linear", "linear", "angle", "mean"),
        ("angle, mean: cubic", "mrad", "constant_radius", "cubic", "angle", "mean"),
        ("position, mean: linear", "mm", "linear", "linear", "position", "mean"),
        ("position, mean: cubic spring", "mm", "constant_radius", "cubic", "position", "mean"),
        ("position, mean: with radius law", "mm", "declared", "with_radius", "position", "mean"),
        ("position, peak: linear", "mm", "linear", "linear", "position", "peak"),
        ("position, peak: with radius law", "mm", "declared", "with_radius", "position", "peak"),
        ("radius, maximum: constant", "mm", "linear", "linear", "radius", "peak"),
        ("radius, mean: constant", "mm", None, "linear", "radius", "mean"),
    )
    for what, unit, theirs, model, kind, size in listed:
        printed = None if theirs is None else errors[theirs].get(f"{kind}_{size}")
        add(what, unit, printed, [t["errors"][model][kind][size] for t in twins])
    law = errors["declared"]["radius_peak"]
    add("radius, maximum: law (16)", "mm", law, [t["law_on_recorded_deflection"]["peak"] for t in twins])
    for what, unit, kind, size in (
        ("angle, mean: exact arm", "mrad", "angle", "mean"),
        ("position, mean: exact arm", "mm", "position", "mean"),
        ("position, peak: exact arm", "mm", "position", "peak"),
        ("position, mean, from the noise-free tip: exact arm", "mm", "noise_free", "mean"),
    ):
        own = [twins[0]["errors"][n][kind][size] for n in ("after_loop", "first_principles")]
        add(what, unit, None, [None] * len(twins), *own)
    head = ("", "unit", "paper", "twin, rig as printed", "twin, α adjusted", "after the loop", "first principles")
    keys = ("quantity", "unit", "paper", "twin_printed", "twin_calibrated", "after_loop", "first_principles")
    camera = 1e3 * POSITION_NOISE * (pi / 2) ** 0.5
    caption = (
        "P11 to P15. The twin columns hold the paper’s models on the rig of Tables I and II, and with its stiffness adjusted so "
        "that α is the paper’s. After the loop (ξ, α and, within its uncertainty, the rod’s mass fitted to this recording) and "
        "first principles (rig file, only ξ fitted) are the exact arm on the rig as printed; β and γ beside it are those of the "
        f"static elastica. Errors against the camera, whose own noise leaves {camera:.3f} mm mean."
    )
    return Table("calibrations", caption, head, rows, keys, raw, (0, 1))
