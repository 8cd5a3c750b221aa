"""The lines of a multisine: what the system answers where it was excited, and where it was not."""

from __future__ import annotations

import numpy as np

from discovery.report.numbers import scale_for
from discovery.report.results import Run
from discovery.report.style import BLUE, MARK, ORANGE, RED, SKY, Picture, label, new_figure

_LOOK = {
    "excited": (BLUE, "o", "excited lines"),
    "odd": (RED, "s", "odd lines, not excited"),
    "even": (ORANGE, "^", "even lines, not excited"),
    "outside": (SKY, ".", "outside the band"),
}
_MOST = 1500


def draw(run: Run) -> Picture | None:
    """Return the level of every line by class, over the noise; None where the input was no multisine."""
    lines = run.open("multisine.nc")
    if lines is None:
        return None
    frequency, level, noise = (lines[n].to_numpy() for n in ("frequency", "output", "noise"))
    kinds = lines["line_class"].to_numpy().astype(str)
    unit = str((run.results.get("multisine") or {}).get("unit", ""))
    scale = scale_for(unit, float(np.nanmax(level)))
    figure = new_figure(3.4)
    axes = figure.subplots()
    for kind, (colour, marker, name) in _LOOK.items():
        here = np.flatnonzero(kinds == kind)
        here = here[:: max(1, here.size // _MOST)]
        if here.size:
            axes.plot(
                frequency[here],
                level[here] * scale.factor,
                marker,
                color=colour,
                markersize=2.5,
                label=name,
                rasterized=True,
            )
    if np.isfinite(noise).any():
        axes.plot(frequency, noise * scale.factor, **MARK, label="noise")
    axes.set_yscale("log")
    axes.set_xlabel("frequency [Hz]")
    axes.set_ylabel(label("output level, rms of a line", scale.symbol))
    figure.legend(loc="outside upper left", ncols=2, markerscale=2.5)
    return Picture(
        "multisine",
        figure,
        "Output at every line of the multisine. What stands above the noise on lines that were not excited is "
        "distortion.",
        "Level of the output against frequency at excited, odd unexcited and even unexcited lines, with the noise.",
    )
