"""Inclusion probabilities of the terms of the library."""

from __future__ import annotations

import numpy as np

from discovery.report.results import Run
from discovery.report.style import BLUE, Picture, new_figure
from discovery.report.words import prose

_MOST = 12


def draw(run: Run) -> Picture | None:
    """Return the probabilities of all terms that some resample chose, and how many were never chosen."""
    inclusion = (run.results.get("discovery") or {}).get("inclusion", {})
    chosen = sorted(((p, n) for n, p in inclusion.items() if p > 0), reverse=True)[:_MOST]
    if not chosen:
        return None
    terms = {t["term"] for t in run.results["discovery"]["terms"]}
    figure = new_figure(0.27 * len(chosen) + 0.75)
    axes = figure.subplots()
    rows = np.arange(len(chosen))
    colours = [BLUE if n in terms else "#B8D4E8" for _, n in chosen]
    axes.barh(rows, [p for p, _ in chosen], height=0.65, color=colours)
    axes.set_yticks(rows, [prose(n).replace("θ̇ₜ", "θₜ'").replace("̇", "'") for _, n in chosen])
    axes.invert_yaxis()
    axes.set_xlim(0, 1)
    axes.grid(axis="y", visible=False)
    axes.set_xlabel("inclusion probability [–]")
    never = len(inclusion) - sum(p > 0 for p in inclusion.values())
    return Picture(
        "inclusion",
        figure,
        "How often each term was part of the equation, over resamples of whole stretches; dark: in the reported "
        "equation. "
        f"{never} other terms of the library were never chosen.",
        "Bars of inclusion probability: " + ", ".join(f"{n} {p:.2f}" for p, n in chosen) + ".",
    )
