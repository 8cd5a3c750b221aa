"""Prior, likelihood and posterior of every parameter in one panel."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from discovery.report.numbers import near_one, unit_text
from discovery.report.results import Run
from discovery.report.style import BLUE, DASHED, DOTTED, GREY, ORANGE, Picture, new_figure, quantity_label
from discovery.report.words import prose

_BINS = 25


def _draw_curves(axis: Any, p: Mapping[str, Any], draws: Any) -> None:
    values = np.array(p["values"])
    density, edges = np.histogram(draws, _BINS, (p["prior_values"][0], p["prior_values"][-1]))
    axis.stairs(density / max(1, density.max()), edges, fill=True, color=BLUE, alpha=0.35, label="posterior")
    # The logarithm is what a few held values follow smoothly.
    statistic = np.array([np.nan if x is None else x for x in p["statistic"]])
    known = np.isfinite(statistic)
    fine = np.linspace(values[0], values[-1], 200)
    root = np.interp(fine, values[known], (np.sign(values - p["best"]) * np.sqrt(statistic))[known])
    axis.plot(fine, np.exp(-0.5 * root**2), color=ORANGE, linewidth=1.4, label="profile likelihood")
    axis.plot(p["prior_values"], p["prior_density"], color=GREY, linestyle=DASHED, label="prior")
    axis.axhline(np.exp(-0.5 * p["cut"]), color="black", linestyle=DOTTED, linewidth=0.9, label="90 % cut")


def draw(run: Run) -> Picture | None:
    """Return one panel a parameter: the posterior's histogram, the profile likelihood and the prior, to height 1."""
    posterior = run.posterior
    profiles = [p for p in posterior.get("profiles", ()) if p["name"] in run.draws]
    if not profiles:
        return None
    units = {r["name"]: r["unit"] for r in posterior["rows"]}
    contraction = {p["name"]: p["contraction"] for p in posterior.get("priors", ())}
    columns = min(2, len(profiles))
    rows = -(-len(profiles) // columns)
    figure = new_figure(1.75 * rows + 0.7)
    axes = np.atleast_1d(figure.subplots(rows, columns)).ravel()
    for axis in axes[len(profiles) :]:
        axis.set_visible(False)
    for axis, p in zip(axes, profiles, strict=False):
        _draw_curves(axis, p, run.draws[p["name"]])
        axis.set_xlabel(quantity_label(p["name"], unit_text(units[p["name"]], run.coordinate_unit)))
        axis.set_ylim(0, 1.08)
        axis.locator_params(axis="x", nbins=3)
        if p["name"] in contraction:
            axis.set_title(f"contraction {near_one(contraction[p['name']])}", fontsize=8.5, color=GREY)
    for axis in axes[:: columns or 1]:
        axis.set_ylabel("over its largest [–]")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper left", ncols=2)
    shown = ", ".join(prose(p["name"]) for p in profiles)
    return Picture(
        "marginals",
        figure,
        "Each parameter alone, every curve over its largest value in this range. The profile likelihood refits all "
        "others for each held value and knows no prior; where it crosses the dotted line its 90 % interval ends. A "
        "level prior says nothing here.",
        f"Posterior histogram, profile likelihood and prior of {shown}.",
    )
