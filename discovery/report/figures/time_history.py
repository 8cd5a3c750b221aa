"""Measured against models in time, with zooms on the start and on the end."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from discovery.report.figures.motion import channel_name, shown_scale
from discovery.report.figures.phase import main_period
from discovery.report.numbers import scale_for
from discovery.report.results import Run, Trajectory
from discovery.report.style import BLUE, LINES, Picture, label, new_figure, plain_log, series, side_label

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Periods of the motion that a zoom shows.
_ZOOM = 3
#: Stretches of time of each of which the largest error is shown.
_STRETCHES = 100


def _panel(axes: Axes, trajectory: Trajectory, channel: int, factor: float, start: float, stop: float) -> None:
    time = trajectory.time
    here = (time >= start) & (time <= stop)
    if trajectory.band is not None:
        low, high = (factor * trajectory.band[k, here, channel] for k in (0, 2))
        axes.fill_between(time[here], low, high, color=BLUE, alpha=0.2, linewidth=0, label="90 % posterior band")
    for model, values in (("measured", trajectory.measured), *trajectory.models.items()):
        series(axes, model, time[here], factor * values[here, channel])
    axes.set_xlim(start, stop)


def _distances(axes: Axes, trajectory: Trajectory) -> None:
    """Draw the largest distance to the measurement in every stretch of time, on a logarithmic axis."""
    found = {model: trajectory.distance(model) for model in trajectory.models}
    # A motion that blew up has no distance.
    least = min((float(np.nanmax(d)) for d in found.values() if np.isfinite(d).any()), default=1.0)
    scale = scale_for(trajectory.units[0], least)
    edges = np.unique(np.linspace(0, trajectory.time.size, _STRETCHES + 1).astype(int))[:-1]
    for model, distance in found.items():
        largest = np.fmax.reduceat(distance, edges) * scale.factor
        axes.semilogy(trajectory.time[edges], largest, **LINES[model], drawstyle="steps-post")
    axes.set_xlim(trajectory.time[0], trajectory.time[-1])
    plain_log(axes.yaxis)
    axes.set_ylabel(label("error", scale.symbol))
    axes.set_xlabel("time [s]")


def _history(run: Run, trajectory: Trajectory) -> Picture:
    time, count = trajectory.time, len(trajectory.channels)
    reference = trajectory.measured[:, -1] if trajectory.deflection is None else trajectory.deflection
    zoom = min(_ZOOM * main_period(time, reference), (time[-1] - time[0]) / 2)
    figure = new_figure(1.25 * (2 * count + 1) + 0.9)
    grid = figure.add_gridspec(2 * count + 1, 2)
    for c, channel in enumerate(trajectory.channels):
        scale = shown_scale(trajectory, c, run.coordinate_unit)
        whole = figure.add_subplot(grid[2 * c, :])
        start, end = figure.add_subplot(grid[2 * c + 1, 0]), figure.add_subplot(grid[2 * c + 1, 1])
        _panel(whole, trajectory, c, scale.factor, time[0], time[-1])
        _panel(start, trajectory, c, scale.factor, time[0], time[0] + zoom)
        _panel(end, trajectory, c, scale.factor, time[-1] - zoom, time[-1])
        start.set_title("start")
        end.set_title("end")
        for axis in (whole, start):
            axis.set_ylabel(side_label(channel_name(run, channel), scale.symbol))
    _distances(figure.add_subplot(grid[2 * count, :]), trajectory)
    figure.legend(*whole.get_legend_handles_labels(), loc="outside upper left", ncols=2)
    fitted = "fitted" if trajectory.fitted.all() else "first part fitted"
    role = "held out" if trajectory.role == "holdout" else fitted
    return Picture(
        f"time_{trajectory.name}",
        figure,
        f"{trajectory.name} ({role}): measured (some samples) and free-run models, whole, at the start and "
        "at the end; last, the largest error in every hundredth of the time.",
        f"Time series of {trajectory.name} ({role}): measurement, models, and the models’ errors.",
        raster=True,
    )


def draw(run: Run) -> list[Picture]:
    """Return one figure for the first held-out recordings, and one for a training recording."""
    shown = list(run.held_out[:2])
    shown += [t for t in run.trajectories if t.role == "train" and t not in shown][:1]
    return [_history(run, t) for t in shown if np.isfinite(t.measured).any()]
