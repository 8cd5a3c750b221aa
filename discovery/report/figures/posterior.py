"""The posterior: pairs of parameters, each alone, their correlations, and the chains."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from discovery.foundation.arrays import FloatArray
from discovery.report import style
from discovery.report.numbers import fixed, near_one, significant, ten_to, unit_text
from discovery.report.results import Run
from discovery.report.style import Picture, new_figure, quantity_label
from discovery.report.words import prose

if TYPE_CHECKING:
    from matplotlib.axes import Axes

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
        color=style.BLUE,
        bins=30,
        max_n_ticks=3,
        labelpad=0.22,
        label_kwargs={"fontsize": 9},
        plot_datapoints=False,
        hist_kwargs={"linewidth": 1.0},
        smooth=0.8,
    )
    corner.overplot_lines(figure, fitted, color=style.ORANGE, linewidth=0.9)
    for axis in figure.axes:
        axis.grid(visible=False)
        axis.tick_params(labelsize=7.5, colors=style.GREY)
        for one in (axis.xaxis, axis.yaxis):
            one.set_ticks(_inner(one.get_majorticklocs(), *one.get_view_interval()))


def draw_corner(run: Run) -> Picture | None:
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
            look: Any = {"color": style.GREY, "linestyle": style.DASHED, "linewidth": 1.0}
            axis.plot(scale[i] * np.array(prior["prior_values"]), height, **look)
            axis.set_xlim(range_)
    figure.subplots_adjust(left=0.13, bottom=0.14, right=0.99, top=0.985, wspace=0.06, hspace=0.06)
    names = ", ".join(prose(r["name"]) for r in shown)
    prior_words = " Grey: the prior, to a scale of its own." if priors else ""
    caption = (
        f"Posterior of {names}: pairs, and each alone with its median and its 90 % interval (dashed). "
        f"Orange: the fit.{prior_words}"
    )
    alt = f"Corner plot of the posterior of {names}, with the fit{' and the priors' if priors else ''}."
    return Picture("corner", figure, caption, alt, wide=True, raster=True)


_BINS = 25


def _draw_curves(axis: Any, p: Mapping[str, Any], draws: Any) -> None:
    values = np.array(p["values"])
    density, edges = np.histogram(draws, _BINS, (p["prior_values"][0], p["prior_values"][-1]))
    axis.stairs(density / max(1, density.max()), edges, fill=True, color=style.BLUE, alpha=0.35, label="posterior")
    # The logarithm is what a few held values follow smoothly.
    statistic = np.array([np.nan if x is None else x for x in p["statistic"]])
    known = np.isfinite(statistic)
    fine = np.linspace(values[0], values[-1], 200)
    root = np.interp(fine, values[known], (np.sign(values - p["best"]) * np.sqrt(statistic))[known])
    axis.plot(fine, np.exp(-0.5 * root**2), color=style.ORANGE, linewidth=1.4, label="profile likelihood")
    axis.plot(p["prior_values"], p["prior_density"], color=style.GREY, linestyle=style.DASHED, label="prior")
    axis.axhline(np.exp(-0.5 * p["cut"]), color="black", linestyle=style.DOTTED, linewidth=0.9, label="90 % cut")


def draw_marginals(run: Run) -> Picture | None:
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
        axis.set(xlabel=quantity_label(p["name"], unit_text(units[p["name"]], run.coordinate_unit)), ylim=(0, 1.08))
        axis.locator_params(axis="x", nbins=3)
        if p["name"] in contraction:
            axis.set_title(f"contraction {near_one(contraction[p['name']])}", fontsize=8.5, color=style.GREY)
    for axis in axes[:: columns or 1]:
        axis.set_ylabel("over its largest [–]")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper left", ncols=2)
    shown = ", ".join(prose(p["name"]) for p in profiles)
    caption = (
        "Each parameter alone, every curve over its largest value in this range. The profile likelihood refits all "
        "others for each held value and knows no prior; where it crosses the dotted line its 90 % interval ends. A "
        "level prior says nothing here."
    )
    return Picture("marginals", figure, caption, f"Posterior histogram, profile likelihood and prior of {shown}.")


def draw_correlations(run: Run) -> Picture | None:
    """Return the matrix of correlation coefficients, each written in its cell."""
    found = run.posterior.get("correlations")
    if not found or len(found["names"]) < 2:
        return None
    names, matrix = found["names"], np.array(found["matrix"])
    size = len(names)
    figure = new_figure(min(4.6, 0.5 * size + 1.3))
    axes = figure.subplots()
    image = axes.imshow(matrix, vmin=-1, vmax=1, cmap="PuOr_r")
    ticks = [quantity_label(n) for n in names]
    axes.set_xticks(range(size), ticks)
    axes.set_yticks(range(size), ticks)
    axes.grid(visible=False)
    axes.spines[:].set_visible(False)
    for (i, j), value in np.ndenumerate(matrix):
        text = fixed(value, 2) if i != j else ""
        axes.text(j, i, text, ha="center", va="center", fontsize=8, color="white" if abs(value) > 0.7 else "black")
    figure.colorbar(image, ax=axes, label="correlation [–]", shrink=0.9)
    caption = "Correlation coefficients of the posterior’s draws, initial states left out."
    alt = f"Map of the correlations between {', '.join(prose(n) for n in names)}."
    return Picture("correlations", figure, caption, alt)


_BAND = "#E3E3E3"
_COLOURS = (style.BLUE, style.ORANGE, style.GREEN, style.PURPLE)
#: Steps that a trace shows.
_STEPS = 400


def draw_chains(run: Run) -> Picture | None:
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
        memory.axvline(tau, color=style.GREY, linestyle=style.DASHED, linewidth=1.0)
        memory.set_title(f"τ = {significant(tau)} steps", fontsize=8.5, color=style.GREY)
        trace.set_ylabel(quantity_label(name, unit_text(r["unit"], run.coordinate_unit)))
        trace.locator_params(axis="y", nbins=3)
        memory.set_yticks((0, 0.5, 1))
    axes[-1, 0].set_xlabel("step after burn-in")
    axes[-1, 1].set_xlabel("lag [steps]")
    figure.align_ylabels(axes[:, 0])
    handles, names = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles[: len(_COLOURS) + 1], names[: len(_COLOURS) + 1], loc="outside upper left", ncols=2)
    caption = (
        f"Left: {'every chain' if single else 'median over the walkers of every ensemble'}, step by step; {what}s "
        f"that agree lie on each other. Right: autocorrelation [–] of every {what}, with the autocorrelation time τ "
        "(dashed)."
    )
    alt = f"Traces and autocorrelation functions of the sampled quantities, one line for each {what}."
    return Picture("chains", figure, caption, alt, raster=True)


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
