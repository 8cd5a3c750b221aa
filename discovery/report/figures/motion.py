"""What was recorded: the motion of one recording, and the deflection of all."""

from __future__ import annotations

import numpy as np

from discovery.report.numbers import Scale, scale_for, unit_text
from discovery.report.results import Run, Trajectory
from discovery.report.style import BLUE, GREY, RED, Picture, decimate, new_figure, side_label, verbatim

_NAMES = {"tip_x": "tip x", "tip_y": "tip y", "tip_angle": "tip angle", "tip_deflection": "tip deflection"}


def channel_name(run: Run, channel: str) -> str:
    """Return a recorded channel in the words of a reader."""
    return _NAMES.get(channel, run.output_name)


def shown_scale(trajectory: Trajectory, channel: int, coordinate: str) -> Scale:
    """Return the unit under which a channel's readings are easy to read."""
    unit, values = trajectory.units[channel], np.abs(trajectory.measured[:, channel])
    scale = scale_for(unit, float(values[np.isfinite(values)].max(initial=0.0)))
    return scale if scale.factor != 1.0 else Scale(1.0, unit_text(unit, coordinate))


def _largest(trajectory: Trajectory) -> float:
    return 0.0 if trajectory.deflection is None else float(np.nanmax(np.abs(trajectory.deflection)))


def draw(run: Run) -> Picture | None:
    """Return input and channels of the training recording with the largest deflection."""
    train = [t for t in run.trajectories if t.role == "train"]
    if not train:
        return None
    shown = max(train, key=_largest)
    rows = len(shown.channels) + (shown.input is not None)
    figure = new_figure(1.25 * rows + 0.6)
    axes = np.atleast_1d(figure.subplots(rows, 1, sharex=True))
    for c, (axis, channel, values) in enumerate(zip(axes, shown.channels, shown.measured.T, strict=False)):
        scale = shown_scale(shown, c, run.coordinate_unit)
        axis.plot(*decimate(shown.time, values * scale.factor), color="black", linewidth=0.8)
        axis.set_ylabel(side_label(channel_name(run, channel), scale.symbol))
    if shown.input is not None:
        axes[-1].plot(*decimate(shown.time, shown.input), color=BLUE, linewidth=0.9)
        axes[-1].set_ylabel(side_label("motor angle" if run.system.has_rod else run.input_name, run.input_unit))
    axes[-1].set_xlabel("time [s]")
    figure.align_ylabels()
    driven = f" and {run.input_name}" if shown.input is not None else ""
    what = "tip position and motor angle" if run.system.has_rod else f"{run.output_name}{driven}"
    return Picture(
        "motion",
        figure,
        f"Measured: {what} of {shown.name}.",
        f"Time series of {what} of recording {shown.name}.",
    )


def draw_deflections(run: Run) -> Picture | None:
    """Return the deflection of every recording, training first."""
    shown = [t for t in run.trajectories if t.deflection is not None][:6]
    if not shown or not run.system.has_rod:
        return None
    figure = new_figure(0.95 * len(shown) + 0.7)
    axes = np.atleast_1d(figure.subplots(len(shown), 1, sharex=True, sharey=True))
    for axis, trajectory in zip(axes, shown, strict=True):
        assert trajectory.deflection is not None
        role = "training" if trajectory.role == "train" else "held out"
        axis.plot(
            *decimate(trajectory.time, trajectory.deflection),
            color="black" if role == "training" else RED,
            linewidth=0.8,
        )
        axis.set_title(f"{verbatim(trajectory.name)} ({role})", fontsize=8.5, color=GREY)
    figure.supylabel("deflection [rad]", fontsize=9)
    axes[-1].set_xlabel("time [s]")
    sizes = ", ".join(f"{t.name} {_largest(t):.2f} rad" for t in shown)
    return Picture(
        "deflections",
        figure,
        f"Deflection of the tip in every recording. Largest: {sizes}.",
        f"Deflection against time of {len(shown)} recordings. Largest: {sizes}.",
    )
