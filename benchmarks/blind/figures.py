"""Figures of the blind benchmark, in the look of the reports."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from discovery.declarations.registry import effect_name
from discovery.report.style import BLUE, GREEN, GREY, ORANGE, PURPLE, RED, SKY, Picture, new_figure, render, styled

#: Title, colour and marker of a prediction.
PREDICTIONS = {
    "before": ("declared model", RED, "s"),
    "bare": ("exact arm, nothing added", GREY, "^"),
    "after": ("after the loop", BLUE, "o"),
}
#: What a size is.
SIZE = "part that the exact arm cannot absorb / noise"
COLOURS = (BLUE, ORANGE, GREEN, RED, PURPLE, SKY, GREY, "black")
MARKERS = "osD^vPX*"


def _by_size(table: pd.DataFrame, sizes: Mapping[str, Any]) -> Picture:
    """Share named over size, a panel a family."""
    figure = new_figure(1.7 * ((len(sizes) + 1) // 2), 6.4)
    axes = figure.subplots((len(sizes) + 1) // 2, 2, sharex=True, sharey=True, squeeze=False).ravel()
    for axis in axes[len(sizes) :]:
        axis.set_visible(False)
    single = table[table["error"].isna() & (table["kind"] == "single")]
    for axis, (family, part), colour in zip(axes, sizes.items(), COLOURS, strict=False):
        own = single if family == "all" else single[single["family"] == family]
        for label, p in part["bins"].items():
            low, high = (float(v) for v in label.split(" to "))
            inside = own["size"][(own["size"] >= low) & (own["size"] < high)]
            x = float(np.exp(np.mean(np.log(inside.clip(lower=0.05)))))
            axis.errorbar(
                x,
                p["share"],
                [[p["share"] - p["low"]], [p["high"] - p["share"]]],
                color=colour,
                marker="o",
                ms=4,
                capsize=2,
            )
        if part["limit"]["half"]:
            axis.axvline(part["limit"]["half"], color=GREY, lw=1.2, ls=":", label="half are named")
        axis.axvline(4, color="black", lw=0.6, label="goals from here on")
        axis.set(xscale="log", ylim=(-0.05, 1.05), title=f"{family} ({len(own)})")
    for axis in axes[1::2]:
        axis.tick_params(labelleft=False)
    # The last panel stands alone in its row.
    axes[len(sizes) - 2].tick_params(labelbottom=True)
    for axis in axes[len(sizes) - 2 : len(sizes)]:
        axis.set_xlabel(SIZE)
    figure.supylabel("share named")
    axes[len(sizes) - 1].legend(loc="lower right")
    return Picture(
        "named_by_size",
        figure,
        "Share of cases with the hidden effect in the set or its ambiguity group, with 95 % intervals, over its size.",
        "Shares rise with the size of the effect.",
    )


def _errors_by_size(table: pd.DataFrame, found: Mapping[str, Any]) -> Picture:
    """Hold-out error over size: a dot a case, median and quartiles a bin."""
    figure = new_figure(3.6, 6.0)
    axis = figure.subplots()
    single = table[table["error"].isna() & (table["kind"] == "single")]
    for shift, (when, (title, colour, marker)) in zip((0.93, 1.0, 1.07), PREDICTIONS.items(), strict=True):
        axis.plot(single["size"], single[f"{when}_mm"] / single["noise_mm"], marker, ms=2.5, color=colour, alpha=0.25)
        bins = [own for own in found.values() if own["median size"]]
        middle = [shift * own["median size"] for own in bins]
        rows = [own["hold-out over noise"][when] for own in bins]
        axis.vlines(middle, [r["low"] for r in rows], [r["high"] for r in rows], color=colour, lw=1.6)
        medians = [r["median"] for r in rows]
        axis.plot(middle, medians, marker + "-", ms=6.5, mec="white", mew=0.6, lw=1.0, color=colour, label=title)
    axis.axhline(1, color="black", lw=0.8, ls=":")
    axis.set(
        xscale="log",
        yscale="log",
        xlabel=SIZE,
        ylabel="hold-out error / noise",
    )
    figure.legend(loc="outside upper center", ncols=3)
    return Picture(
        "holdout_by_size",
        figure,
        "Rms distance between predicted and noise-free tip of the hold-out over the camera's noise; single effects by "
        "their size. Large marks are medians, bars quartiles; the dotted line is the noise.",
        "Before it is far above the noise, bare it rises with the size, after it stays below the noise.",
    )


def _shares_by_size(found: Mapping[str, Any]) -> Picture:
    """Shares over size, a panel a share."""
    titles = list(next(iter(found.values()))["shares"])
    figure = new_figure(4.2, 6.4)
    axes = figure.subplots(2, 3, sharex=True, sharey=True).ravel()
    for axis, title, colour in zip(axes, titles, COLOURS, strict=False):
        shares = [own["shares"][title] for own in found.values()]
        for i, p in enumerate(shares):
            if p["n"]:
                axis.vlines(i, p["low"], p["high"], color=colour, lw=1.6)
                axis.plot(i, p["share"], "o", ms=4, color=colour)
        axis.set(ylim=(-0.05, 1.05), title=title)
        axis.set_xticks(range(len(found)), list(found), rotation=90)
    figure.supylabel("share")
    figure.supxlabel(SIZE)
    return Picture(
        "shares_by_size",
        figure,
        "Shares of single effects by their size, and of clean cases, with 95 % intervals.",
        "Shares close to one but for effects below the noise.",
    )


def _distances(table: pd.DataFrame) -> Picture:
    """Hold-out distance before and after."""
    figure = new_figure(3.4, 4.6)
    axis = figure.subplots()
    ran = table[table["error"].isna()]
    for (kind, part), colour, marker in zip(ran.groupby("kind"), COLOURS, MARKERS, strict=False):
        axis.plot(
            part["bare_mm"] / part["noise_mm"],
            part["after_over_noise"],
            marker,
            ms=4,
            color=colour,
            label=kind,
            alpha=0.8,
        )
    limits = np.array([0.02, 1e3])
    axis.plot(limits, limits, color=GREY, lw=0.6)
    axis.axhline(1, color="black", lw=0.6)
    axis.axhline(2, color="black", lw=0.6, ls=":")
    axis.set(
        xscale="log",
        yscale="log",
        xlabel="hold-out distance of the exact arm alone / noise",
        ylabel="after the loop / noise",
    )
    axis.legend()
    return Picture(
        "holdout",
        figure,
        "Rms distance between predicted and noise-free tip of the hold-out.",
        "Points below the diagonal improved.",
    )


def _confusion(table: pd.DataFrame) -> Picture:
    """True against named effects."""
    ran = table[table["error"].isna() & table["kind"].isin(["none", "single", "outside"])]
    counts: dict[tuple[str, str], int] = {}
    for true, named in zip(ran["true"], ran["named"], strict=True):
        for name in named.split(" + "):
            counts[true, name] = counts.get((true, name), 0) + 1
    rows, columns = sorted({k[0] for k in counts}), sorted({k[1] for k in counts})
    figure = new_figure(1.6 + 0.17 * len(rows), 2.6 + 0.22 * len(columns))
    axis = figure.subplots()
    axis.grid(False)
    for (true, name), count in counts.items():
        right = true == name
        axis.text(
            columns.index(name),
            rows.index(true),
            str(count),
            color=BLUE if right else RED,
            ha="center",
            va="center",
            fontsize=8,
        )
    axis.set(xlim=(-0.6, len(columns) - 0.4), ylim=(len(rows) - 0.4, -0.6), xlabel="named", ylabel="hidden")
    axis.set_xticks(range(len(columns)), [effect_name(c) for c in columns], rotation=90, fontsize=7)
    axis.set_yticks(range(len(rows)), [effect_name(r) for r in rows], fontsize=7)
    return Picture("confusion", figure, "What was hidden and what was named.", "A table of counts.", wide=True)


def _coverage(intervals: pd.DataFrame) -> Picture:
    """Distribution of errors over standard deviations."""
    figure = new_figure(2.6)
    axis = figure.subplots()
    z = np.sort(np.abs(intervals["z"].to_numpy(float)))
    axis.plot(z, np.arange(1, z.size + 1) / max(1, z.size), color=BLUE, label="estimates")
    grid = np.linspace(0, 5, 100)
    from scipy.stats import norm

    axis.plot(grid, 2 * norm.cdf(grid) - 1, color=GREY, ls=":", label="normal")
    axis.set(xlim=(0, 5), xlabel="error of a parameter / its standard deviation", ylabel="share below")
    axis.legend()
    return Picture("coverage", figure, "Errors of the parameters of rightly named effects.", "Two rising curves.")


def draw(
    folder: Path, table: pd.DataFrame, intervals: pd.DataFrame, sizes: Mapping[str, Any], found: Mapping[str, Any]
) -> None:
    """Write the figures below `folder`."""
    with styled():
        pictures = (
            _by_size(table, sizes),
            *((_errors_by_size(table, found), _shares_by_size(found)) if found else ()),
            _distances(table),
            _confusion(table),
            _coverage(intervals),
        )
        for picture in pictures:
            suffix, content = render(picture)
            (folder / f"{picture.name}{suffix}").write_bytes(content)
