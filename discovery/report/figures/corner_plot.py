"""The posterior's pairs of parameters."""

from __future__ import annotations

import numpy as np

from discovery.report.mathml import GREEK
from discovery.report.numbers import unit_text
from discovery.report.results import Run
from discovery.report.style import BLUE, GREY, Picture, new_figure
from discovery.report.words import prose

__all__ = ["draw"]

_MOST = 8
_DRAWS = 20_000


def _label(name: str, unit: str) -> str:
    head, _, tail = name.partition("_")
    text = GREEK.get(head, head) + (f"$_{{\\mathrm{{{tail}}}}}$" if tail else "")
    return f"{text} [{unit}]" if unit else text


def draw(run: Run) -> Picture | None:
    """Return the corner plot of the physical parameters and the noise; initial states are left out."""
    dataset = run.open("posterior.nc")
    rows = (run.results.get("posterior") or {}).get("rows", [])
    shown = [r for r in rows if "[" not in r["name"]][:_MOST]
    if dataset is None or len(shown) < 2:
        return None
    import corner

    draws = np.stack([dataset[r["name"]].to_numpy().ravel() for r in shown], axis=1)
    draws = draws[:: max(1, len(draws) // _DRAWS)]
    labels = [_label(r["name"], unit_text(r["unit"], run.coordinate_unit)) for r in shown]
    figure = new_figure(1.35 * len(shown), 1.35 * len(shown), layout="none")
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
    for axis in figure.axes:
        axis.grid(visible=False)
        axis.tick_params(labelsize=7.5, colors=GREY)
    figure.subplots_adjust(left=0.13, bottom=0.14, right=0.99, top=0.985, wspace=0.06, hspace=0.06)
    names = ", ".join(prose(r["name"]) for r in shown)
    return Picture(
        "corner",
        figure,
        f"Posterior of {names}: pairs, and each alone with its median and its 90 % interval (dashed).",
        f"Corner plot of the posterior of {names}.",
        wide=True,
        raster=True,
    )
