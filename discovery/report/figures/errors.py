"""Error before and after, on what was fitted and on what was not, with the noise floor."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from discovery.report.numbers import scale_for, significant
from discovery.report.results import Run
from discovery.report.style import BLUE, MARK, RED, Picture, label, new_figure, plain_log
from discovery.report.words import compared_groups
from discovery.results.judging import held_group

#: Colour, marker, name and place beside its line of each of the two errors.
_SIDES = ((RED, "s", "before: declared model", -0.13), (BLUE, "o", "after: final model", 0.13))


def draw(run: Run) -> Picture | None:
    """Return the figure of the answer."""
    errors = run.loop["errors"]
    before, after = errors["before"], errors["after"]
    groups = compared_groups(run)
    scale = scale_for(errors["unit"], after["train"]["rms"])
    figure = new_figure(0.62 * len(groups) + 1.25)
    axes = figure.subplots()
    for row, group in enumerate(groups):
        _draw_group(
            axes, row, [(m[group]["rms"] * scale.factor, m[group]["peak"] * scale.factor) for m in (before, after)]
        )
    floor = errors["noise_floor"] * scale.factor
    axes.axvline(floor, **MARK, label="noise floor, held out")
    axes.set_xscale("log")
    axes.set_xlim(left=0.6 * min(floor, *(m[g]["rms"] * scale.factor for m in (before, after) for g in groups)))
    plain_log(axes.xaxis)
    axes.set_yticks(range(len(groups)), [name.replace(", ", ",\n") for name in groups.values()])
    axes.set_ylim(len(groups) - 0.5, -0.6)
    axes.grid(axis="y", visible=False)
    axes.set_xlabel(label("error, rms (bar: to the peak)", scale.symbol))
    figure.legend(loc="outside upper left", ncols=2, fontsize=8, columnspacing=1.0)
    judged = held_group(errors)
    words = (
        f"rms {scale.text(before[judged]['rms'])} {scale.symbol} before and "
        f"{scale.text(after[judged]['rms'])} {scale.symbol} after; "
        f"the held-out noise floor is {significant(floor)} {scale.symbol}"
    )
    return Picture(
        "errors",
        figure,
        f"Free-run error before and after. {groups[judged].capitalize()}: {words}.",
        f"Dots on a logarithmic axis compare the error of the declared and of the final model. {words}.",
    )


def _draw_group(axes: Any, row: int, sizes: Sequence[tuple[float, float]]) -> None:
    """Draw rms and peak of both models on the line of one group."""
    axes.plot([rms for rms, _ in sizes], [row, row], color="#BBBBBB", linewidth=1.5, zorder=1)
    for (rms, peak), (colour, marker, name, shift) in zip(sizes, _SIDES, strict=True):
        if math.isinf(rms):
            # At the right edge, above or below the line of its group as its bar would be.
            blown = f"{name.partition(':')[0]}: blows up"
            place = {"ha": "right", "va": "center", "transform": axes.get_yaxis_transform()}
            axes.text(0.99, row + 2 * shift, blown, color=colour, fontsize=8, **place)
            continue
        axes.plot([rms, peak], [row + shift] * 2, color=colour, linewidth=0.8, alpha=0.7)
        axes.plot(peak, row + shift, marker="|", color=colour, markersize=6)
        dot = {"marker": marker, "color": colour, "markersize": 7, "linestyle": "none"}
        axes.plot(rms, row, label=name if row == 0 else None, **dot)
        axes.annotate(significant(rms), (rms, row), (0, 8), textcoords="offset points", ha="center", fontsize=8)
