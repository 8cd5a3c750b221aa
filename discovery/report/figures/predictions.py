"""Predictions beside the measurement, in time and in their bands, and the errors before and after."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from discovery.report import style
from discovery.report.figures.motion import channel_name, error_name, main_period, shown_scale
from discovery.report.numbers import scale_for, significant
from discovery.report.results import Run, Trajectory
from discovery.report.style import Picture, decimate, label, new_figure, plain_log, series, side_label
from discovery.report.words import compared_groups
from discovery.results.judging import held_group

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def draw_comparison(run: Run) -> Picture | None:
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
        below.plot(shown.time, left[model] * scale.factor, **style.LINES[model])
    noise = next(r["noise"] for r in run.results["recordings"] if r["name"] == shown.name)[0]
    if noise:
        below.axhspan(-2 * noise * scale.factor, 2 * noise * scale.factor, color=style.GREY, alpha=0.25, linewidth=0)
    above.set_ylabel(side_label(channel_name(run, shown.channels[0]), motion.symbol))
    below.set(ylabel=side_label(error_name(run, shown), scale.symbol), xlabel="time [s]")
    figure.align_ylabels()
    figure.legend(*above.get_legend_handles_labels(), loc="outside upper left", ncols=3)
    role = "held out" if shown.role == "holdout" or not shown.fitted.all() else "fitted"
    caption = (
        f"{shown.name} ({role}): measured and free-run models; below, model minus measurement, with the band of two "
        "standard deviations of the instrument’s noise."
    )
    alt = f"Time series of {shown.name} ({role}): measured, declared and final model, and below the error of both."
    return Picture("comparison", figure, caption, alt, raster=True)


#: Periods of the motion that a zoom shows.
_ZOOM = 3
#: Stretches of time of each of which the largest error is shown.
_STRETCHES = 100


def _panel(axes: Axes, trajectory: Trajectory, channel: int, factor: float, start: float, stop: float) -> None:
    time = trajectory.time
    here = (time >= start) & (time <= stop)
    if trajectory.band is not None:
        low, high = (factor * trajectory.band[k, here, channel] for k in (0, 2))
        axes.fill_between(time[here], low, high, color=style.BLUE, alpha=0.2, linewidth=0, label="90 % posterior band")
    for model, values in (("measured", trajectory.measured), *trajectory.models.items()):
        series(axes, model, time[here], factor * values[here, channel])
    axes.set_xlim(start, stop)


def _distances(axes: Axes, trajectory: Trajectory, name: str) -> None:
    """Draw the largest distance to the measurement in every stretch of time, on a logarithmic axis."""
    found = {model: trajectory.distance(model) for model in trajectory.models}
    # A motion that blew up has no distance.
    least = min((float(np.nanmax(d)) for d in found.values() if np.isfinite(d).any()), default=1.0)
    scale = scale_for(trajectory.units[0], least)
    edges = np.unique(np.linspace(0, trajectory.time.size, _STRETCHES + 1).astype(int))[:-1]
    for model, distance in found.items():
        largest = np.fmax.reduceat(distance, edges) * scale.factor
        axes.semilogy(trajectory.time[edges], largest, **style.LINES[model], drawstyle="steps-post")
    axes.set_xlim(trajectory.time[0], trajectory.time[-1])
    plain_log(axes.yaxis)
    axes.set(ylabel=side_label(name, scale.symbol), xlabel="time [s]")


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
    _distances(figure.add_subplot(grid[2 * count, :]), trajectory, error_name(run, trajectory))
    figure.legend(*whole.get_legend_handles_labels(), loc="outside upper left", ncols=2)
    fitted = "fitted" if trajectory.fitted.all() else "first part fitted"
    role = "held out" if trajectory.role == "holdout" else fitted
    caption = (
        f"{trajectory.name} ({role}): measured (some samples) and free-run models, whole, at the start and "
        "at the end; last, the largest error in every hundredth of the time."
    )
    alt = f"Time series of {trajectory.name} ({role}): measurement, models, and the models’ errors."
    return Picture(f"time_{trajectory.name}", figure, caption, alt, raster=True)


def draw_histories(run: Run) -> list[Picture]:
    """Return one figure for the first held-out recordings, and one for a training recording."""
    shown = list(run.held_out[:2])
    shown += [t for t in run.trajectories if t.role == "train" and t not in shown][:1]
    return [_history(run, t) for t in shown if np.isfinite(t.measured).any()]


def _bands(run: Run, trajectory: Trajectory) -> Picture | None:
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
            axis.fill_between(time, low, high, color=style.BLUE, alpha=alpha, linewidth=0, label=name)
        axis.plot(*decimate(time, left * scale.factor), ".", color="black", markersize=1.5, label="measured")
        parts = [f"{100 * s:.1f} % of the {part} readings" for (name, part), s in share.items() if name == channel]
        axis.set_title(f"{channel_name(run, channel)}: {', '.join(parts)} in the band", fontsize=8.5, color=style.GREY)
        axis.set_ylabel(label("minus median", scale.symbol))
    axes[-1].set_xlabel("time [s]")
    figure.align_ylabels()
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper left", ncols=2, markerscale=4)
    caption = (
        f"{trajectory.name} ({'held out' if trajectory.role == 'holdout' else 'fitted'}): readings minus the median of "
        "the posterior’s free-run predictions, with the 90 % band of a reading, noise included, and of the motion."
    )
    alt = f"Readings of {trajectory.name} in their posterior predictive bands."
    return Picture(f"bands_{trajectory.name}", figure, caption, alt, raster=True)


def draw_bands(run: Run) -> list[Picture]:
    """Return the bands of the first training recording and of the first two held-out ones."""
    if not run.posterior.get("coverage"):
        return []
    train = [t for t in run.trajectories if t.role == "train"][:1]
    held = [t for t in run.held_out if t not in train][:2]
    return [picture for t in (*train, *held) if (picture := _bands(run, t)) is not None]


#: Colour, marker, name and place beside its line of each of the two errors.
_SIDES = ((style.RED, "s", "before: declared model", -0.13), (style.BLUE, "o", "after: final model", 0.13))


def draw_errors(run: Run) -> Picture | None:
    """Return the figure of the answer."""
    errors = run.loop["errors"]
    before, after = errors["before"], errors["after"]
    groups = compared_groups(run)
    scale = scale_for(errors["unit"], after["train"]["rms"])
    figure = new_figure(0.62 * len(groups) + 1.25)
    axes = figure.subplots()
    for row, group in enumerate(groups):
        _draw_group(
            axes, row, [(m[group]["rms"] * scale.factor, m[group]["peak"] * scale.factor) for m in (before, after)]
        )
    floor = errors["noise_floor"] * scale.factor
    axes.axvline(floor, **style.MARK, label="noise floor, held out")
    axes.set_xscale("log")
    axes.set_xlim(left=0.6 * min(floor, *(m[g]["rms"] * scale.factor for m in (before, after) for g in groups)))
    plain_log(axes.xaxis)
    axes.set_yticks(range(len(groups)), [name.replace(", ", ",\n") for name in groups.values()])
    axes.set_ylim(len(groups) - 0.5, -0.6)
    axes.grid(axis="y", visible=False)
    axes.set_xlabel(label("error, rms (bar: to the peak)", scale.symbol))
    figure.legend(loc="outside upper left", ncols=2, fontsize=8, columnspacing=1.0)
    judged = held_group(errors)
    words = (
        f"rms {scale.text(before[judged]['rms'])} {scale.symbol} before and "
        f"{scale.text(after[judged]['rms'])} {scale.symbol} after; "
        f"the held-out noise floor is {significant(floor)} {scale.symbol}"
    )
    alt = f"Dots on a logarithmic axis compare the error of the declared and of the final model. {words}."
    return Picture("errors", figure, f"Free-run error before and after. {groups[judged].capitalize()}: {words}.", alt)


def _draw_group(axes: Any, row: int, sizes: Sequence[tuple[float, float]]) -> None:
    """Draw rms and peak of both models on the line of one group."""
    axes.plot([rms for rms, _ in sizes], [row, row], color="#BBBBBB", linewidth=1.5, zorder=1)
    for (rms, peak), (colour, marker, name, shift) in zip(sizes, _SIDES, strict=True):
        if math.isinf(rms):
            # At the right edge, above or below the line of its group as its bar would be.
            blown = f"{name.partition(':')[0]}: blows up"
            place = {"ha": "right", "va": "center", "transform": axes.get_yaxis_transform()}
            axes.text(0.99, row + 2 * shift, blown, color=colour, fontsize=8, **place)
            continue
        axes.plot([rms, peak], [row + shift] * 2, color=colour, linewidth=0.8, alpha=0.7)
        axes.plot(peak, row + shift, marker="|", color=colour, markersize=6)
        dot = {"marker": marker, "color": colour, "markersize": 7, "linestyle": "none"}
        axes.plot(rms, row, label=name if row == 0 else None, **dot)
        axes.annotate(significant(rms), (rms, row), (0, 8), textcoords="offset points", ha="center", fontsize=8)
