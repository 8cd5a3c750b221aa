"""Correlations of the parameters as a map."""

from __future__ import annotations

import numpy as np

from discovery.report.numbers import fixed
from discovery.report.results import Run
from discovery.report.style import Picture, new_figure, quantity_label
from discovery.report.words import prose


def draw(run: Run) -> Picture | None:
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
    return Picture(
        "correlations",
        figure,
        "Correlation coefficients of the posterior’s draws, initial states left out.",
        f"Map of the correlations between {', '.join(prose(n) for n in names)}.",
    )
