"""Error before and after, on what was fitted and on what was not, with the noise floor."""

from __future__ import annotations

import math

from discovery.report.numbers import scale_for, significant
from discovery.report.results import Run
from discovery.report.style import BLUE, GREY, RED, Picture, new_figure, plain_log
from discovery.report.words import error_groups

__all__ = ["draw"]


def draw(run: Run) -> Picture | None:
    """Return the figure of the answer."""
    errors = run.loop["errors"]
    before, after = errors["before"], errors["after"]
    names = error_groups(run)
    groups = [g for g in names if g != "holdout" or "holdout_inside" not in names]
    scale = scale_for(errors["unit"], after[groups[0]]["rms"])
    figure = new_figure(0.62 * len(groups) + 1.25)
    axes = figure.subplots()
    for row, group in enumerate(groups):
        values = [m[group]["rms"] * scale.factor for m in (before, after)]
        peaks = [m[group]["peak"] * scale.factor for m in (before, after)]
        axes.plot(values, [row, row], color="#BBBBBB", linewidth=1.5, zorder=1)
        for value, peak, colour, marker, name, shift in zip(
            values,
            peaks,
            (RED, BLUE),
            ("s", "o"),
            ("before: declared model", "after: final model"),
            (-0.13, 0.13),
            strict=True,
        ):
            if math.isinf(value):
                # At the right edge, above or below the line of its group as its bar would be.
                blown = f"{name.partition(':')[0]}: blows up"
                axes.text(
                    0.99,
                    row + 2 * shift,
                    blown,
                    color=colour,
                    fontsize=8,
                    ha="right",
                    va="center",
                    transform=axes.get_yaxis_transform(),
                )
                continue
            axes.plot([value, peak], [row + shift] * 2, color=colour, linewidth=0.8, alpha=0.7)
            axes.plot(peak, row + shift, marker="|", color=colour, markersize=6)
            axes.plot(
                value,
                row,
                marker=marker,
                color=colour,
                markersize=7,
                linestyle="none",
                label=name if row == 0 else None,
            )
            axes.annotate(significant(value), (value, row), (0, 8), textcoords="offset points", ha="center", fontsize=8)
    floor = errors["noise_floor"] * scale.factor
    axes.axvline(floor, color=GREY, linestyle=(0, (5, 2)), linewidth=1.0, label="noise floor")
    axes.set_xscale("log")
    axes.set_xlim(left=0.6 * min(floor, *(m[g]["rms"] * scale.factor for m in (before, after) for g in groups)))
    plain_log(axes.xaxis)
    axes.set_yticks(range(len(groups)), [names[g].replace(", ", ",\n") for g in groups])
    axes.set_ylim(len(groups) - 0.5, -0.6)
    axes.grid(axis="y", visible=False)
    axes.set_xlabel(f"error, rms (bar: to the peak) [{scale.symbol}]")
    figure.legend(loc="outside upper left", ncols=2, fontsize=8, columnspacing=1.0)
    last = groups[-1] if "holdout_inside" not in groups else "holdout_inside"
    words = (
        f"rms {significant(before[last]['rms'] * scale.factor)} {scale.symbol} before and "
        f"{significant(after[last]['rms'] * scale.factor)} {scale.symbol} after; "
        f"the noise floor is {significant(floor)} {scale.symbol}"
    )
    return Picture(
        "errors",
        figure,
        f"Free-run error before and after. {names[last].capitalize()}: {words}.",
        f"Dots on a logarithmic axis compare the error of the declared and of the final model. {words}.",
    )
