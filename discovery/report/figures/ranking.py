"""Which candidate effects were tried, and how much of the misfit each leaves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from textwrap import fill
from typing import Any

import numpy as np

from discovery.report.results import Run
from discovery.report.story import Search, decisions, in_the_end, searches
from discovery.report.style import BLUE, GREY, ORANGE, RED, Picture, new_figure, plain_log
from discovery.report.words import effect_name, listed

__all__ = ["draw", "draw_steps"]

_MOST = 10
#: Searches that are drawn; the table has all.
_SEARCHES = 4
#: Characters of a step's name beyond which it takes another line.
_LABEL = 32
#: Factor by which an axis reaches beyond its values at least.
_MARGIN = 1.1
#: Mean squared residual from which the axis is logarithmic.
_WIDE = 3.0


def _ranking(search: Search, position: int, count: int) -> Picture:
    shown = search.ranking[:_MOST]
    refitted = np.array([r["chi2"] for r in shown]) / count
    # A score is linear: it may promise more than there is.
    linear = np.maximum(search.without - np.array([r["score"] for r in shown]), 0.5 * count) / count
    figure = new_figure(0.3 * len(shown) + 1.3)
    axes = figure.subplots()
    rows = np.arange(len(shown))
    axes.plot(
        linear, rows, "D", color=ORANGE, markersize=4, fillstyle="none", zorder=4, label="promised by the linear score"
    )
    for kind, colour, marker in (("added", BLUE, "o"), ("tried, not enough", RED, "X"), ("other", "#8FB8D4", "o")):
        chosen = [_kind(search, r["effect"]) == kind for r in shown]
        if any(chosen):
            words = "refitted" if kind == "other" else f"refitted: {kind}"
            axes.plot(refitted[chosen], rows[chosen], marker, color=colour, markersize=7, label=words)
    axes.axvline(1.0, color=GREY, linestyle=(0, (5, 2)), linewidth=1.0, label="noise alone")
    axes.axvline(search.without / count, color=GREY, linestyle=":", linewidth=1.2, label="without any of them")
    if search.without > _WIDE * count:
        axes.set_xscale("log")
        plain_log(axes.xaxis)
    axes.set_yticks(rows, [effect_name(r["effect"]) for r in shown])
    axes.set_ylim(len(shown) - 0.5, -0.5)
    axes.set_xlabel("left in training [noise variances]")
    figure.legend(loc="outside upper left", ncols=2, columnspacing=1.0)
    beside = f" beside {listed(effect_name(e) for e in search.beside)}" if search.beside else ""
    best = effect_name(shown[0]["effect"])
    outcome = listed(effect_name(e) for e in search.added) or "nothing"
    return Picture(
        f"ranking_{position}",
        figure,
        f"Search {position}{beside}: what the best {len(shown)} of {len(search.ranking)} candidates leave once "
        f"everything is refitted. Added: {outcome}.",
        f"Dots of the misfit that each candidate effect leaves; {best} leaves least. Added: {outcome}.",
    )


def _kind(search: Search, effect: str) -> str:
    return "added" if effect in search.added else "tried, not enough" if effect in search.refused else "other"


def draw(run: Run) -> list[Picture]:
    """Return one ranking for every search through the catalogue."""
    count = run.loop["model"]["after"]["n_data"]
    return [_ranking(s, i, count) for i, s in enumerate(searches(run)[:_SEARCHES], 1)]


def _held(numbers: Mapping[str, float]) -> tuple[float, float] | None:
    """Return the held-out misfits before and after a step; None without any, or where a motion blew up."""
    if "mean_chi2_holdout_after" in numbers:
        before, after = (numbers[f"mean_chi2_holdout_{k}"] for k in ("before", "after"))
    elif "chi2_holdout_after" in numbers:
        before, after = (numbers[f"chi2_holdout_{k}"] / numbers["n_holdout"] for k in ("before", "after"))
    else:
        return None
    return (before, after) if np.isfinite([before, after]).all() else None


def _round_limits(values: Sequence[float]) -> tuple[float, float]:
    """Return limits of a logarithmic axis beyond all values, the upper one with a tick."""
    low, high = min(values) / _MARGIN, max(values) * _MARGIN
    decades = 10.0 ** np.arange(np.floor(np.log10(low)), np.ceil(np.log10(high)) + 1)
    marks = np.outer(decades, (1.0, 2.0, 5.0)).ravel()
    left = marks[marks <= low].max()
    above = marks if high < 20 * left else decades
    return float(left), float(above[above >= high].min())


def draw_steps(run: Run) -> Picture | None:
    """Return the held-out misfit after every proposal of the loop; a set that was tried together is one."""
    found = []
    for group in decisions(run):
        held = _held(group[0]["numbers"])
        if held is not None:
            found.append((group[0], fill(_label(run, group), _LABEL), held))
    if not found:
        return None
    lines = max(name.count("\n") for _, name, _ in found)
    figure = new_figure((0.4 + 0.14 * lines) * len(found) + 1.2)
    axes = figure.subplots()
    for row, (step, _, (before, after)) in enumerate(found):
        # What was taken out again was there before.
        start, end = (after, before) if step["action"] == "remove" and step["accepted"] else (before, after)
        colour = BLUE if step["accepted"] else ORANGE
        axes.annotate("", (end, row), (start, row), arrowprops={"arrowstyle": "->", "color": colour, "linewidth": 1.2})
        axes.plot(start, row, "s", color=GREY, markersize=4)
        axes.plot(end, row, "o" if step["accepted"] else "X", color=colour, markersize=7)
    axes.axvline(1.0, color=GREY, linestyle=(0, (5, 2)), linewidth=1.0)
    axes.set_xscale("log")
    axes.set_xlim(*_round_limits([1.0, *(value for *_, both in found for value in both)]))
    plain_log(axes.xaxis)
    axes.set_yticks(range(len(found)), [name for _, name, _ in found])
    axes.set_ylim(len(found) - 0.5, -0.5)
    axes.grid(axis="y", visible=False)
    axes.set_xlabel("held-out misfit [noise variances]")
    kept = listed(effect_name(e["id"]) for e in run.loop["effects"]) or "nothing"
    return Picture(
        "steps",
        figure,
        "Held-out mean squared residual before (square) and after (circle: accepted, cross: not) each proposal; 1 is "
        f"noise alone. In the final model: {kept}.",
        f"Arrows from the held-out misfit before to the one after each proposal of the loop. Final: {kept}.",
    )


def _label(run: Run, group: Sequence[Mapping[str, Any]]) -> str:
    """Return what was proposed, and whether it was in vain."""
    first, names = group[0], listed(effect_name(s["effect"]) for s in group)
    if first["action"] == "refine":
        return "finer mechanics"
    if first["action"] in ("remove", "exchange"):
        return f"without {names}"
    kept = first["accepted"] or (first["action"] == "upgrade" and in_the_end(run, first["effect"]))
    return names if kept else f"not kept: {names}"
