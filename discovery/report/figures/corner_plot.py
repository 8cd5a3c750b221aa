"""The posterior's pairs of parameters."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable
from typing import Any

import numpy as np

from discovery.report.numbers import ten_to, unit_text
from discovery.report.results import Run
from discovery.report.style import BLUE, DASHED, GREY, ORANGE, Picture, new_figure, quantity_label
from discovery.report.words import prose

_MOST = 8
_DRAWS = 20_000
#: Share of a panel at each end that bears no tick.
_EDGE = 0.1
#: Powers of ten of values whose numbers are short.
_SHORT = (-2, 4)


def _tens(values: np.ndarray) -> int:
    """Return the power of ten in which values are drawn: zero where their numbers are short without one."""
    largest = float(np.abs(values).max())
    power = math.floor(math.log10(largest)) if largest > 0 else 0
    return 0 if _SHORT[0] <= power <= _SHORT[1] else power


def _inner(ticks: Iterable[float], low: float, high: float) -> list[float]:
    """Return the ticks whose labels neither meet those of the next panel nor leave the figure."""
    return [tick for tick in ticks if low + _EDGE * (high - low) < tick < high - _EDGE * (high - low)]


def _draw_pairs(figure: Any, draws: Any, labels: list[str], fitted: list[float]) -> None:
    with warnings.catch_warnings():
        # Where ArviZ is installed, corner imports it, and ArviZ announces its next version once a day.
        warnings.simplefilter("ignore", FutureWarning)
        import corner

    corner.corner(
        draws,
        fig=figure,
        labels=labels,
        quantiles=(0.05, 0.5, 0.95),
        color=BLUE,
        bins=30,
        max_n_ticks=3,
        labelpad=0.22,
        label_kwargs={"fontsize": 9},
        plot_datapoints=False,
        hist_kwargs={"linewidth": 1.0},
        smooth=0.8,
    )
    corner.overplot_lines(figure, fitted, color=ORANGE, linewidth=0.9)
    for axis in figure.axes:
        axis.grid(visible=False)
        axis.tick_params(labelsize=7.5, colors=GREY)
        for one in (axis.xaxis, axis.yaxis):
            one.set_ticks(_inner(one.get_majorticklocs(), *one.get_view_interval()))


def draw(run: Run) -> Picture | None:
    """Return the corner plot of the physical parameters and the noise; initial states are left out."""
    shown = [r for r in run.quantities_sampled if r["name"] in run.draws][:_MOST]
    if len(shown) < 2:
        return None
    draws = np.stack([run.draws[r["name"]].ravel() for r in shown], axis=1)
    draws = draws[:: max(1, len(draws) // _DRAWS)]
    tens = [_tens(column) for column in draws.T]
    scale = 10.0 ** -np.array(tens)
    units = [unit_text(r["unit"], run.coordinate_unit) for r in shown]
    # A factor at an axis would stand on the panel above it.
    units = [f"{ten_to(k)} {unit}".rstrip() if k else unit for k, unit in zip(tens, units, strict=True)]
    labels = [quantity_label(r["name"], unit) for r, unit in zip(shown, units, strict=True)]
    figure = new_figure(1.35 * len(shown), 1.35 * len(shown), layout="none")
    _draw_pairs(figure, draws * scale, labels, [r["fit_value"] * k for r, k in zip(shown, scale, strict=True)])
    priors = {p["name"]: p for p in run.posterior.get("profiles", ())}
    for i, r in enumerate(shown):
        if r["name"] in priors:
            axis, prior = figure.axes[i * (len(shown) + 1)], priors[r["name"]]
            height = 0.95 * axis.get_ylim()[1] * np.array(prior["prior_density"])
            range_ = axis.get_xlim()
            axis.plot(scale[i] * np.array(prior["prior_values"]), height, color=GREY, linestyle=DASHED, linewidth=1.0)
            axis.set_xlim(range_)
    figure.subplots_adjust(left=0.13, bottom=0.14, right=0.99, top=0.985, wspace=0.06, hspace=0.06)
    names = ", ".join(prose(r["name"]) for r in shown)
    prior_words = " Grey: the prior, to a scale of its own." if priors else ""
    return Picture(
        "corner",
        figure,
        f"Posterior of {names}: pairs, and each alone with its median and its 90 % interval (dashed). "
        f"Orange: the fit.{prior_words}",
        f"Corner plot of the posterior of {names}, with the fit{' and the priors' if priors else ''}.",
        wide=True,
        raster=True,
    )
