"""The chains: where every ensemble was, step by step, and how soon it forgot."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from discovery.foundation.arrays import FloatArray
from discovery.report.numbers import significant, unit_text
from discovery.report.results import Run
from discovery.report.style import BLUE, DASHED, GREEN, GREY, ORANGE, PURPLE, Picture, new_figure, quantity_label

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_BAND = "#E3E3E3"
_COLOURS = (BLUE, ORANGE, GREEN, PURPLE)
_MOST = 8
#: Steps that a trace shows.
_STEPS = 400


def draw(run: Run) -> Picture | None:
    """Return traces and autocorrelation functions of the parameters and the noise, one line an ensemble."""
    found = run.posterior.get("autocorrelation")
    shown = [r for r in run.quantities_sampled if r["name"] in run.draws][:_MOST]
    if not found or not shown:
        return None
    lags = np.array(found["lags"])
    thin = lags[1] - lags[0]
    single = run.sampling.get("method") == "independence"
    what = "chain" if single else "ensemble"
    figure = new_figure(1.05 * len(shown) + 0.9)
    axes = figure.subplots(len(shown), 2, sharex="col", squeeze=False, width_ratios=(3, 2))
    for (trace, memory), r in zip(axes, shown, strict=True):
        name = r["name"]
        draws = run.draws[name]
        _trace(trace, draws, thin, single=single)
        for e, function in enumerate(found["functions"][name]):
            memory.plot(lags, function, ".-", color=_COLOURS[e % len(_COLOURS)], linewidth=0.8, markersize=3)
        tau = found["tau"][name]
        memory.axvline(tau, color=GREY, linestyle=DASHED, linewidth=1.0)
        memory.set_title(f"τ = {significant(tau)} steps", fontsize=8.5, color=GREY)
        trace.set_ylabel(quantity_label(name, unit_text(r["unit"], run.coordinate_unit)))
        trace.locator_params(axis="y", nbins=3)
        memory.set_yticks((0, 0.5, 1))
    axes[-1, 0].set_xlabel("step after burn-in")
    axes[-1, 1].set_xlabel("lag [steps]")
    figure.align_ylabels(axes[:, 0])
    handles, names = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles[: len(_COLOURS) + 1], names[: len(_COLOURS) + 1], loc="outside upper left", ncols=2)
    return Picture(
        "chains",
        figure,
        f"Left: {'every chain' if single else 'median over the walkers of every ensemble'}, step by step; {what}s "
        f"that agree lie on each other. Right: autocorrelation [–] of every {what}, with the autocorrelation time τ "
        "(dashed).",
        f"Traces and autocorrelation functions of the sampled quantities, one line for each {what}.",
        raster=True,
    )


def _trace(axis: Axes, draws: FloatArray, thin: float, *, single: bool) -> None:
    """Draw the walkers' median of each ensemble (ensembles, draws, walkers), or single chains, over 90 % of all."""
    keep = slice(None, None, max(1, draws.shape[1] // _STEPS))
    steps = thin * np.arange(draws.shape[1])[keep]
    if single:
        low, high = (np.full(steps.size, q) for q in np.quantile(draws, (0.05, 0.95)))
    else:
        low, high = np.quantile(draws[:, keep], (0.05, 0.95), axis=(0, 2))
    what, all_of = ("chain", "draws") if single else ("ensemble", "walkers")
    axis.fill_between(steps, low, high, color=_BAND, linewidth=0, label=f"90 % of all {all_of}")
    for e, chain in enumerate(draws[:, keep]):
        colour = _COLOURS[e % len(_COLOURS)]
        axis.plot(steps, np.median(chain, axis=1), color=colour, linewidth=0.8, label=f"{what} {e + 1}")
