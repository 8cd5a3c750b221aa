"""The residual before and after: in time, and its spectrum."""

from __future__ import annotations

import numpy as np

from discovery.report.figures.motion import channel_name
from discovery.report.numbers import scale_for
from discovery.report.results import Run
from discovery.report.style import BLUE, GREY, LINES, MARK, RED, Picture, decimate, label, new_figure


def draw(run: Run) -> Picture | None:
    """Return the residual of the first held-out recording (the first one otherwise), every channel before and after."""
    shown = run.judged
    if shown is None:
        return None
    count = len(shown.channels)
    figure = new_figure(2 * 1.15 * count + 0.8)
    axes = np.atleast_1d(figure.subplots(2 * count, 1, sharex=True))
    for c, (channel, unit) in enumerate(zip(shown.channels, shown.units, strict=True)):
        for i, (model, colour) in enumerate((("before", RED), ("after", BLUE))):
            left = shown.models[model][:, c] - shown.measured[:, c]
            scale = scale_for(unit, float(np.nanmax(np.abs(left))))
            axis = axes[2 * c + i]
            axis.plot(*decimate(shown.time, left * scale.factor), color=colour, linewidth=0.6)
            axis.set_title(f"{channel_name(run, channel)}, {LINES[model]['label']}", fontsize=8.5, color=GREY)
            axis.set_ylabel(label("", scale.symbol).strip())
    axes[-1].set_xlabel("time [s]")
    figure.align_ylabels()
    return Picture(
        "residual",
        figure,
        f"Model minus measurement on {shown.name}, before and after; the vertical scales differ.",
        f"Residual against time of {shown.name}, every channel before and after the loop.",
        raster=True,
    )


def draw_spectrum(run: Run) -> Picture | None:
    """Return the spectrum of the normalised residual on the first training recording."""
    residual = run.loop.get("residual", {})
    if not all(residual.get(m, {}).get("frequency") for m in ("before", "after")):
        return None
    figure = new_figure(3.0)
    axes = figure.subplots()
    for model in ("before", "after"):
        frequency, density = (np.array(residual[model][k], dtype=float) for k in ("frequency", "spectrum"))
        axes.loglog(frequency[1:], density[1:], **LINES[model])
    # The spectrum reaches half the sampling rate; white noise of unit variance has this one-sided density.
    axes.axhline(1.0 / frequency[-1], **MARK, label="noise alone")
    axes.set_xlabel("frequency [Hz]")
    axes.set_ylabel("residual density [noise sds² / Hz]")
    figure.legend(loc="outside upper left", ncols=2)
    name = next(r["name"] for r in run.results["recordings"] if r["role"] == "train")
    return Picture(
        "spectrum",
        figure,
        f"Spectrum of the residual on {name}, in units of the noise. On the dashed line the residual is white noise.",
        "Power spectral density of the residual before and after, with the level of the noise alone.",
    )
