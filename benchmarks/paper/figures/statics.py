"""The elastica: shapes under a force across the tip's radius, and the force and radius against the deflection."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from benchmarks.paper.theory.elastica.beam import shape_under_load
from benchmarks.paper.theory.elastica.small_deflection import small_deflection_shape
from discovery.report.references import paper_numbers
from discovery.report.style import BLUE, GREY, ORANGE, RED, Picture, new_figure
from discovery.theory.elastica.static_law import SMALL_DEFLECTION, perpendicular_law

_DEFLECTIONS = np.array([0.2, 0.4, 0.6, 0.85, 1.2, 1.5])
_EXACT: dict[str, Any] = {"color": BLUE, "linewidth": 1.4, "label": "elastica"}
_SERIES: dict[str, Any] = {"color": ORANGE, "linestyle": (0, (4, 1.6)), "linewidth": 1.2}
_PAPER: dict[str, Any] = {"color": RED, "linestyle": (0, (1, 1.2)), "linewidth": 1.4}


def draw_shapes(numbers: Mapping[str, Any], curves: Mapping[str, Any]) -> list[Picture]:
    """Return the rod under a growing force, by (3), with its small-deflection shape by (2)."""
    force, _ = perpendicular_law(_DEFLECTIONS)
    shape, small = shape_under_load(force, _DEFLECTIONS + np.pi / 2), small_deflection_shape(force)
    figure = new_figure(4.4)
    axes = figure.subplots()
    for height, x, y, delta in zip(small.y, shape.x, shape.y, _DEFLECTIONS, strict=True):
        first = delta == _DEFLECTIONS[0]
        axes.plot(small.arc, height, **_SERIES, label="small deflection (2)" if first else None)
        axes.plot(x, y, **{**_EXACT, "label": "elastica (3)" if first else None})
        axes.annotate(f"{delta:g} rad", (x[-1], y[-1]), (4, 3), textcoords="offset points", fontsize=8)
    tips = np.linspace(0.0, _DEFLECTIONS[-1], 101)
    rho = np.cos(paper_numbers()["parameters"]["gamma"] * tips)
    axes.plot(rho * np.cos(tips), rho * np.sin(tips), **_PAPER, label="tip by the radius law (16)")
    axes.plot(np.cos(tips), np.sin(tips), color=GREY, linewidth=0.8, label="tip at constant radius")
    axes.set_aspect("equal")
    axes.set_xlim(0.0, 1.12)
    axes.set_ylim(0.0, 1.12)
    axes.set_xlabel("x / l [–]")
    axes.set_ylabel("y / l [–]")
    figure.legend(loc="outside upper left", ncols=2)
    words = ", ".join(f"{f:.2f}" for f in force)
    return [
        Picture(
            "shapes",
            figure,
            f"The rod under a force across its tip’s radius, Fₙ = {words}, with the shape of small deflection under "
            f"the same force. The paper’s radius law follows the tip.",
            f"Bent shapes of the rod for tip deflections from {_DEFLECTIONS[0]:g} to {_DEFLECTIONS[-1]:g} rad. The "
            f"small-deflection shapes stretch beyond the rod’s length.",
        )
    ]


def draw_laws(numbers: Mapping[str, Any], curves: Mapping[str, Any]) -> list[Picture]:
    """Return force, over its linear part, and radius against the deflection, with series and the paper's laws."""
    paper = paper_numbers()
    given = paper["parameters"]
    ratio, gamma = given["beta"] / given["alpha"], given["gamma"]
    delta = np.linspace(0.005, np.pi / 2, 300)
    force, rho = perpendicular_law(delta)
    figure = new_figure(4.6)
    top, bottom = figure.subplots(2, 1, sharex=True)
    top.plot(delta, force / (3 * delta), **_EXACT)
    top.plot(delta, 1 + SMALL_DEFLECTION.cubic * delta**2, **_SERIES, label="series")
    top.plot(delta, 1 + ratio * delta**2, **_PAPER, label="paper’s fits, (14) and (16)")
    bottom.plot(delta, rho, **_EXACT)
    bottom.plot(delta, 1 - delta**2 / 10, **_SERIES)
    bottom.plot(delta, np.cos(gamma * delta), **_PAPER)
    for axes in (top, bottom):
        axes.axvspan(paper["manoeuvre"]["deflection"], delta[-1], color="#EEEEEE", zorder=0)
    top.set_ylabel("Fₙ / 3δ [–]")
    bottom.set_ylabel("ρₜ / l [–]")
    bottom.set_xlabel("deflection δ [rad]")
    bottom.set_xlim(0.0, delta[-1])
    figure.legend(*top.get_legend_handles_labels(), loc="outside upper left", ncols=2)
    figure.align_ylabels()
    ours, fitted = f"{SMALL_DEFLECTION.cubic:.4f}", f"{ratio:.4f}"
    words = (
        f"the cubic part is {ours} of the linear one by the elastica and {fitted} in the paper’s fit, γ is "
        f"{SMALL_DEFLECTION.gamma:.4f} and {gamma:.4f}"
    )
    return [
        Picture(
            "force_map",
            figure,
            f"Force across the tip’s radius and radius, against the deflection: elastica, series Fₙ = 3δ + (13/70)δ³, "
            f"ρₜ/l = 1 − δ²/10, and the paper’s fits. At small deflection {words}. Grey: beyond the paper’s largest "
            f"deflection.",
            f"Two panels: force over 3δ and radius against deflection; {words}.",
        )
    ]
