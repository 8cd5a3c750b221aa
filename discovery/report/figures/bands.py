"""Readings in their predictive bands."""

from __future__ import annotations

import numpy as np

from discovery.report.figures.motion import channel_name
from discovery.report.numbers import scale_for
from discovery.report.results import Run, Trajectory
from discovery.report.style import BLUE, GREY, Picture, decimate, label, new_figure


def _picture(run: Run, trajectory: Trajectory) -> Picture | None:
    """Return the readings minus the median prediction, in the bands of the reading and of the motion."""
    found = run.open("predictive.nc", trajectory.name)
    if found is None:
        return None
    time = trajectory.time
    motion, reading = (
        np.stack([found[f"{kind}_{q}"].to_numpy() for q in ("q05", "q50", "q95")]) for kind in ("motion", "reading")
    )
    share = {
        (c["channel"], c["part"]): c["share"] for c in run.posterior["coverage"] if c["recording"] == trajectory.name
    }
    figure = new_figure(1.7 * len(trajectory.channels) + 0.8)
    axes = np.atleast_1d(figure.subplots(len(trajectory.channels), 1, sharex=True))
    for c, (axis, channel, unit) in enumerate(zip(axes, trajectory.channels, trajectory.units, strict=True)):
        middle = motion[1, :, c]
        left = trajectory.measured[:, c] - middle
        scale = scale_for(unit, float(np.nanmax(np.abs(left))))
        for band, alpha, name in ((reading, 0.25, "90 % of readings"), (motion, 0.8, "90 % of motions")):
            low, high = ((band[k, :, c] - middle) * scale.factor for k in (0, 2))
            axis.fill_between(time, low, high, color=BLUE, alpha=alpha, linewidth=0, label=name)
        axis.plot(*decimate(time, left * scale.factor), ".", color="black", markersize=1.5, label="measured")
        parts = [f"{100 * s:.1f} % of the {part} readings" for (name, part), s in share.items() if name == channel]
        axis.set_title(f"{channel_name(run, channel)}: {', '.join(parts)} in the band", fontsize=8.5, color=GREY)
        axis.set_ylabel(label("minus median", scale.symbol))
    axes[-1].set_xlabel("time [s]")
    figure.align_ylabels()
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper left", ncols=2, markerscale=4)
    return Picture(
        f"bands_{trajectory.name}",
        figure,
        f"{trajectory.name} ({'held out' if trajectory.role == 'holdout' else 'fitted'}): readings minus the median of "
        "the posterior’s free-run predictions, with the 90 % band of a reading, noise included, and of the motion.",
        f"Readings of {trajectory.name} in their posterior predictive bands.",
        raster=True,
    )


def draw(run: Run) -> list[Picture]:
    """Return the bands of the first training recording and of the first two held-out ones."""
    if not run.posterior.get("coverage"):
        return []
    train = [t for t in run.trajectories if t.role == "train"][:1]
    held = [t for t in run.held_out if t not in train][:2]
    return [picture for t in (*train, *held) if (picture := _picture(run, t)) is not None]
