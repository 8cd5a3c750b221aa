"""Measured against models in time, with zooms on the start and on the end."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from discovery.report.figures.motion import _NAMES
from discovery.report.figures.phase import _period
from discovery.report.results import Run, Trajectory
from discovery.report.style import BLUE, LINES, Picture, label, new_figure, series

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["draw"]

#: Periods of the motion that a zoom shows.
_ZOOM = 3


def _panel(axes: Axes, trajectory: Trajectory, channel: int, start: float, stop: float) -> None:
    time = trajectory.time
    here = (time >= start) & (time <= stop)
    if trajectory.band is not None:
        low, high = trajectory.band[0, here, channel], trajectory.band[2, here, channel]
        axes.fill_between(time[here], low, high, color=BLUE, alpha=0.2, linewidth=0, label="90 % posterior band")
    for model, values in (("measured", trajectory.measured), *trajectory.models.items()):
        series(axes, model, time[here], values[here, channel])
    axes.set_xlim(start, stop)


def _history(run: Run, trajectory: Trajectory) -> Picture:
    time, count = trajectory.time, len(trajectory.channels)
    reference = trajectory.measured[:, -1] if trajectory.deflection is None else trajectory.deflection
    zoom = min(_ZOOM * _period(time, reference), (time[-1] - time[0]) / 2)
    figure = new_figure(2.0 * 1.25 * count + 0.9)
    grid = figure.add_gridspec(2 * count, 2)
    for c, (channel, unit) in enumerate(zip(trajectory.channels, trajectory.units, strict=True)):
        whole = figure.add_subplot(grid[2 * c, :])
        start, end = figure.add_subplot(grid[2 * c + 1, 0]), figure.add_subplot(grid[2 * c + 1, 1])
        _panel(whole, trajectory, c, time[0], time[-1])
        _panel(start, trajectory, c, time[0], time[0] + zoom)
        _panel(end, trajectory, c, time[-1] - zoom, time[-1])
        start.set_title("start")
        end.set_title("end")
        for axis in (whole, start):
            axis.set_ylabel(label(_NAMES.get(channel, channel), unit))
        if c == count - 1:
            start.set_xlabel("time [s]")
            end.set_xlabel("time [s]")
    handles, names = whole.get_legend_handles_labels()
    figure.legend(handles, names, loc="outside upper left", ncols=2)
    held = "held out" if trajectory.role == "holdout" else "fitted" if trajectory.fitted.all() else "fitted, last part held out"
    return Picture(
        f"time_{trajectory.name}",
        figure,
        f"{trajectory.name} ({held}): measured and free-run models, whole and at its start and end.",
        f"Time series of recording {trajectory.name} ({held}): measurement, {', '.join(LINES[m]['label'] for m in trajectory.models)}.",
    )


def draw(run: Run) -> list[Picture]:
    """Return one figure for the first held-out recordings, and one for a training recording."""
    shown = list(run.held_out[:2])
    shown += [t for t in run.trajectories if t.role == "train" and t not in shown][:1]
    return [_history(run, t) for t in shown if np.isfinite(t.measured).any()]
