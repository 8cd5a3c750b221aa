"""Which candidate effects were tried, and how much of the misfit each could remove."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from discovery.report.results import Run
from discovery.report.style import BLUE, GREY, ORANGE, Picture, new_figure, plain_log
from discovery.report.words import effect_name, listed

__all__ = ["draw", "draw_steps"]

_MOST = 10


def _ranking(step: Mapping[str, Any], position: int) -> Picture:
    before = step["numbers"]["chi2_before"]
    shown = step["ranking"][:_MOST]
    names = [r["effect"] for r in shown]
    refitted = np.array([max(before - r["chi2"], 0.0) for r in shown])
    linear = np.array([max(r["score"], 0.0) for r in shown])
    figure = new_figure(0.3 * len(shown) + 1.15)
    axes = figure.subplots()
    rows = np.arange(len(shown))
    kept = [step["accepted"] and n == step["effect"] for n in names]
    axes.barh(
        rows, refitted, height=0.62, color=[BLUE if k else "#B8D4E8" for k in kept], label="removed by a bounded refit"
    )
    axes.plot(
        linear, rows, marker="D", color=ORANGE, markersize=4.5, linestyle="none", label="predicted by the linear score"
    )
    largest = max(refitted.max(), linear.max(), 1.0)
    if largest > 1e3:
        axes.set_xscale("symlog", linthresh=10.0)
    axes.set_xlim(0, largest * (2.0 if largest > 1e3 else 1.05))
    axes.set_yticks(rows, [effect_name(n) for n in names])
    axes.invert_yaxis()
    axes.grid(axis="y", visible=False)
    axes.set_xlabel("chi-square removed, training")
    figure.legend(loc="outside upper left", ncols=1)
    verdict = "added" if step["accepted"] else "the best, but not enough"
    return Picture(
        f"ranking_{position}",
        figure,
        f"Candidate effects at step {position}, best first: {effect_name(step['effect'])} ({verdict}).",
        f"Bars of the chi-square that each candidate effect removes; {step['effect']} removes most ({verdict}).",
    )


def draw(run: Run) -> list[Picture]:
    """Return one ranking for every search through the catalogue."""
    steps = [s for s in run.loop["steps"] if s["ranking"] and "chi2_before" in s["numbers"]]
    return [_ranking(s, i + 1) for i, s in enumerate(steps)]


def _held(numbers: Mapping[str, float]) -> tuple[float, float] | None:
    if "mean_chi2_holdout_after" in numbers:
        return numbers["mean_chi2_holdout_before"], numbers["mean_chi2_holdout_after"]
    if "chi2_holdout_after" in numbers:
        return tuple(numbers[f"chi2_holdout_{k}"] / numbers["n_holdout"] for k in ("before", "after"))  # type: ignore[return-value]
    return None


def draw_steps(run: Run) -> Picture | None:
    """Return the held-out misfit after every proposal of the loop."""
    found = [(s, held) for s in run.loop["steps"] if (held := _held(s["numbers"])) is not None]
    if not found:
        return None
    figure = new_figure(0.4 * len(found) + 1.2)
    axes = figure.subplots()
    for row, (step, (before, after)) in enumerate(found):
        colour = BLUE if step["accepted"] else ORANGE
        axes.annotate(
            "", (after, row), (before, row), arrowprops={"arrowstyle": "->", "color": colour, "linewidth": 1.2}
        )
        axes.plot(before, row, "s", color=GREY, markersize=4)
        axes.plot(after, row, "o" if step["accepted"] else "X", color=colour, markersize=7)
    axes.axvline(1.0, color=GREY, linestyle=(0, (5, 2)), linewidth=1.0)
    axes.set_xscale("log")
    plain_log(axes.xaxis)
    axes.set_yticks(
        range(len(found)), [("" if s["accepted"] else "not kept: ") + effect_name(s["effect"]) for s, _ in found]
    )
    axes.set_ylim(len(found) - 0.5, -0.5)
    axes.grid(axis="y", visible=False)
    axes.set_xlabel("held-out mean squared residual [noise variances]")
    kept = listed(effect_name(s["effect"]) for s, _ in found if s["accepted"]) or "nothing"
    return Picture(
        "steps",
        figure,
        "Held-out misfit before (square) and after (circle: kept, cross: not kept) each proposal; 1 is noise alone. "
        f"Kept: {kept}.",
        f"Arrows from the held-out misfit before to the one after each proposal of the loop. Kept: {kept}.",
    )
