"""Pictures of a calibration, narrow enough for a telephone: ranks, coverage curves, coverage over manoeuvres."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from benchmarks.calibration.manoeuvre_table import METHODS
from benchmarks.calibration.ranks import BINS
from discovery.foundation.io import atomic_write

WIDTH = 4.06  # inches: 390 px
PALETTE = ("#0072B2", "#E69F00", "#009E73", "#CC79A7")
INK, BAND, BAR, WARN = "#20303a", "#cfd8dc", "#4f7f9b", "#b5533c"
STYLE = {
    "font.size": 8,
    "axes.titlesize": 8,
    "axes.edgecolor": INK,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.6,
    "svg.hashsalt": "calibration",
    "text.color": INK,
}
SYMBOLS = {
    "xi": "ξ",
    "alpha": "α",
    "beta": "β",
    "gamma": "γ",
    "delta_0_init": "initial deflection",
    "rate_0_init": "initial rate",
    "sigma": "noise σ",
    "nu": "ν of the noise",
    "share": "correlated share",
    "tau_n": "memory of the noise",
    "f_c": "dry friction",
    "log_likelihood": "log likelihood",
    "mu": "mass ratio μ",
}


def _save(figure: Any, path: Path) -> Path:
    with atomic_write(path) as draft:
        figure.savefig(draft, metadata={"Date": None})
    plt.close(figure)
    return path


def ranks(study: Mapping[str, Any], title: str, path: Path) -> Path:
    """Draw the histogram of ranks of every quantity, with the band that holds 95 % of the bins of a right posterior."""
    quantities = study["quantities"]
    rows = -(-len(quantities) // 2)
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(
            rows, 2, figsize=(WIDTH, 0.6 + 1.05 * rows), sharex=True, sharey=True, squeeze=False
        )
        for axis, (name, found) in zip(axes.flat, quantities.items(), strict=False):
            histogram = found["histogram"]
            axis.axhspan(histogram["low"], histogram["high"], color=BAND, lw=0)
            axis.bar(np.arange(BINS) + 0.5, histogram["counts"], width=0.86, color=BAR)
            axis.set_title(SYMBOLS.get(name, name), pad=2)
            axis.set_xticks([0, BINS / 2, BINS], ["0", "½", "1"])
        for axis in axes.flat[len(quantities) :]:
            axis.axis("off")
        figure.suptitle(f"{title}\n{study['replications']} replications; grey: 95 % of the bins", fontsize=8)
        figure.supxlabel("rank of the truth in its posterior", fontsize=8)
        figure.tight_layout(h_pad=0.4, w_pad=0.6, pad=0.5)
        return _save(figure, path)


def coverages(studies: Mapping[str, Mapping[str, Any]], titles: Mapping[str, str], path: Path) -> Path:
    """Draw how far the coverage of every quantity is from its level, with the 95 % band of a right posterior."""
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(
            len(studies), 1, figsize=(WIDTH, 0.5 + 1.35 * len(studies)), sharex=True, squeeze=False
        )
        for axis, (name, study) in zip(axes.flat, studies.items(), strict=True):
            for found in study["quantities"].values():
                curve = {key: 100 * np.array(values) for key, values in found["curve"].items()}
                level = curve["level"]
                axis.plot(level, curve["share"] - level, color=BAR, lw=0.8, alpha=0.9)
            axis.fill_between(level, curve["low"] - level, curve["high"] - level, color=BAND, lw=0)
            axis.axhline(0, color=INK, lw=0.6)
            axis.set_title(f"{titles[name]} ({study['replications']})", loc="left", pad=3)
            axis.set_ylim(-10, 10)
            axis.set_yticks([-5, 0, 5])
        axes[-1, 0].set_xlabel("level of the interval, %")
        figure.supylabel("coverage minus level, %", fontsize=8)
        figure.tight_layout(h_pad=0.5, pad=0.5)
        return _save(figure, path)


def manoeuvres(found: Mapping[str, Any], target: str, path: Path) -> Path:
    """Draw how often each kind of interval holds a target, by parameter, with binomial intervals."""
    names = list(found["scatter"])
    with plt.rc_context(STYLE):
        figure, axis = plt.subplots(figsize=(WIDTH, 4.4))
        for k, method in enumerate(METHODS):
            for j, name in enumerate(names):
                row = next(r for r in found["rows"] if r["method"] == method and r["parameter"] == name)[target]
                y = k + 0.22 * (j - 1)
                axis.plot([100 * row["low"], 100 * row["high"]], [y, y], color=PALETTE[j], lw=1.4)
                axis.plot(100 * row["share"], y, "o", ms=4, color=PALETTE[j], label=SYMBOLS[name] if k == 0 else None)
            axis.text(0, k - 0.36, METHODS[method], fontsize=7.5, va="bottom")
        axis.axvline(90, color=INK, lw=0.8)
        axis.set_xlim(-2, 102)
        axis.set_ylim(len(METHODS) - 0.5, -0.75)
        axis.set_yticks([])
        axis.set_xlabel("90 % intervals that hold the value, %")
        axis.legend(loc="lower left", ncol=len(names), frameon=False, fontsize=8, bbox_to_anchor=(0, 1.0), borderpad=0)
        figure.suptitle(found["model"], fontsize=8, x=0.02, ha="left")
        figure.tight_layout(pad=0.5)
        return _save(figure, path)
