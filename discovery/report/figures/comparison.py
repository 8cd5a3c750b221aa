"""The first figure: measured, declared and final model on a held-out recording, and what each leaves."""

from __future__ import annotations

import numpy as np

from discovery.report.figures.motion import channel_name, shown_scale
from discovery.report.numbers import scale_for
from discovery.report.results import Run
from discovery.report.style import GREY, LINES, Picture, label, new_figure, series, side_label


def draw(run: Run) -> Picture | None:
    """Return the first channel of the first held-out recording, of the first one otherwise."""
    shown = next((t for t in (*run.held_out, *run.trajectories) if np.isfinite(t.measured).any()), None)
    if shown is None:
        return None
    models = {m: shown.models[m][:, 0] for m in ("before", "after") if m in shown.models}
    left = {m: values - shown.measured[:, 0] for m, values in models.items()}
    scale = scale_for(shown.units[0], min((float(np.nanmax(np.abs(v))) for v in left.values()), default=1.0))
    motion = shown_scale(shown, 0, run.coordinate_unit)
    figure = new_figure(3.4, width=5.6)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    series(above, "measured", shown.time, shown.measured[:, 0] * motion.factor)
    for model, values in models.items():
        series(above, model, shown.time, values * motion.factor)
        below.plot(shown.time, left[model] * scale.factor, **LINES[model])
    noise = next(r["noise"] for r in run.results["recordings"] if r["name"] == shown.name)[0]
    if noise:
        below.axhspan(-2 * noise * scale.factor, 2 * noise * scale.factor, color=GREY, alpha=0.25, linewidth=0)
    above.set_ylabel(side_label(channel_name(run, shown.channels[0]), motion.symbol))
    below.set_ylabel(label("error", scale.symbol))
    below.set_xlabel("time [s]")
    figure.align_ylabels()
    figure.legend(*above.get_legend_handles_labels(), loc="outside upper left", ncols=3)
    role = "held out" if shown.role == "holdout" or not shown.fitted.all() else "fitted"
    return Picture(
        "comparison",
        figure,
        f"{shown.name} ({role}): measured and free-run models; below, model minus measurement, with the band of two "
        "standard deviations of the instrument’s noise.",
        f"Time series of {shown.name} ({role}): measured, declared and final model, and below the error of both.",
        raster=True,
    )
