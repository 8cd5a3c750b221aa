"""What was recorded: signals in time, the motion in its plane, and its decay."""

from __future__ import annotations

import numpy as np

from discovery.foundation.arrays import FloatArray
from discovery.foundation.sampling import median_step
from discovery.report import style
from discovery.report.numbers import Scale, listed, scale_for, unit_text
from discovery.report.results import MODELS, Run, Trajectory
from discovery.report.style import Picture, decimate, label, new_figure, side_label, verbatim
from discovery.report.words import deflection_unit, sentence

_NAMES = {"tip_x": "tip x", "tip_y": "tip y", "tip_angle": "tip angle", "tip_deflection": "tip deflection"}


def channel_name(run: Run, channel: str) -> str:
    """Return a recorded channel in the words of a reader."""
    return run.output_name if channel == "output" else _NAMES.get(channel, channel.replace("_", " "))


def error_name(run: Run, trajectory: Trajectory) -> str:
    """Return what errors are called: by the output's name where more than that is read."""
    beside = len(trajectory.channels) > 1 and not run.system.has_rod
    return f"error of {run.output_name}" if beside else "error"


def shown_scale(trajectory: Trajectory, channel: int, coordinate: str) -> Scale:
    """Return the unit under which a channel's readings are easy to read."""
    unit, values = trajectory.units[channel], np.abs(trajectory.measured[:, channel])
    scale = scale_for(unit, float(values[np.isfinite(values)].max(initial=0.0)))
    return scale if scale.factor != 1.0 else Scale(1.0, unit_text(unit, coordinate))


def _largest(trajectory: Trajectory) -> float:
    return 0.0 if trajectory.deflection is None else float(np.nanmax(np.abs(trajectory.deflection)))


def draw_motion(run: Run) -> Picture | None:
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
        axes[-1].plot(*decimate(shown.time, shown.input), color=style.BLUE, linewidth=0.9)
        axes[-1].set_ylabel(side_label("motor angle" if run.system.has_rod else run.input_name, run.input_unit))
    axes[-1].set_xlabel("time [s]")
    figure.align_ylabels()
    drawn = [*(channel_name(run, c) for c in shown.channels), *([run.input_name] if shown.input is not None else [])]
    what = "tip position and motor angle" if run.system.has_rod else listed(drawn)
    caption = f"Measured: {what} of {shown.name}."
    return Picture("motion", figure, caption, f"Time series of {what} of recording {shown.name}.")


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
        colour = "black" if role == "training" else style.RED
        axis.plot(*decimate(trajectory.time, trajectory.deflection), color=colour, linewidth=0.8)
        axis.set_title(f"{verbatim(trajectory.name)} ({role})", fontsize=8.5, color=style.GREY)
    figure.supylabel("deflection [rad]", fontsize=9)
    axes[-1].set_xlabel("time [s]")
    sizes = ", ".join(f"{t.name} {_largest(t):.2f} rad" for t in shown)
    alt = f"Deflection against time of {len(shown)} recordings. Largest: {sizes}."
    return Picture("deflections", figure, f"Deflection of the tip in every recording. Largest: {sizes}.", alt)


#: Swings of a recording that are drawn: more would fill the plane.
_SWINGS = 6


def main_period(time: FloatArray, values: FloatArray) -> float:
    """Return the period of the strongest line of a motion [s]."""
    even = np.linspace(time[0], time[-1], time.size)
    good = np.isfinite(values)
    filled = np.interp(even, time[good], values[good])
    power = np.abs(np.fft.rfft(filled - filled.mean())) ** 2
    power[0] = 0.0
    return float((time[-1] - time[0]) / max(1, int(np.argmax(power))))


def _rate(time: FloatArray, values: FloatArray, period: float) -> FloatArray:
    """Return the slope of straight lines over a twelfth of a period, for drawing only."""
    half = max(1, round(period / 24 / median_step(time)))
    slope = np.full(values.shape, np.nan)
    slope[half:-half] = (values[2 * half :] - values[: -2 * half]) / (time[2 * half :] - time[: -2 * half])
    return slope


def _portrait(trajectory: Trajectory, model: str, period: float) -> tuple[FloatArray, FloatArray] | None:
    values = trajectory.deflection if model == "measured" else trajectory.deflection_of(model)
    if values is None:
        return None
    stop = int(np.searchsorted(trajectory.time, trajectory.time[0] + _SWINGS * period))
    return values[:stop], _rate(trajectory.time, values, period)[:stop]


def draw_phase(run: Run) -> Picture | None:
    """Return the portrait of the first held-out recording, or of the first one."""
    candidates = [t for t in (*run.held_out, *run.trajectories) if t.deflection is not None]
    if not candidates or not run.reads_coordinate:
        return None
    shown = candidates[0]
    assert shown.deflection is not None
    period = main_period(shown.time, shown.deflection)
    figure = new_figure(3.8)
    axes = figure.subplots()
    for model in ("measured", "after"):
        portrait = _portrait(shown, model, period) if model == "measured" or model in shown.models else None
        if portrait is not None:
            look = {**style.LINES[model], "linewidth": 0.8}
            axes.plot(*portrait, **look)
    unit, what = run.coordinate_unit, "deflection" if run.system.has_rod else run.output_name
    axes.set(xlabel=label(what, unit), ylabel=label("its rate", f"{unit}/s"))
    figure.legend(loc="outside upper left", ncols=2)
    caption = f"Phase portrait of {shown.name}, first {min(_SWINGS * period, shown.time[-1] - shown.time[0]):.3g} s."
    alt = f"{sentence(what)} of {shown.name} against its rate: loops, measured and by the final model."
    return Picture("phase", figure, caption, alt, raster=True)


def draw_amplitude(run: Run) -> Picture | None:
    """Return the figure; None where no recording holds a free decay."""
    curves = {name: data for name in ("measured", *MODELS) if (data := run.open("amplitude.nc", name)) is not None}
    if "measured" not in curves:
        return None
    figure = new_figure(4.2)
    top, bottom = figure.subplots(2, 1, sharex=True)
    for name, data in curves.items():
        order = np.argsort(data["amplitude"].to_numpy())
        look = {**style.LINES[name], "markersize": 5} if name == "measured" else style.LINES[name]
        for axis, variable in ((top, "frequency"), (bottom, "damping")):
            axis.plot(data["amplitude"].to_numpy()[order], data[variable].to_numpy()[order], **look)
    top.set_ylabel(label("frequency", "Hz"))
    bottom.set(ylabel=label("decay rate", "1/s"), xlabel=label("amplitude", deflection_unit(run)))
    figure.legend(*top.get_legend_handles_labels(), loc="outside upper left", ncols=2)
    recording = curves["measured"].attrs.get("recording", "a recording")
    caption = (
        f"Frequency and decay rate of the energy against amplitude in the free decay of {recording}, swing by swing."
    )
    alt = "Two panels: frequency and decay rate against amplitude, measured points and a line for each model."
    return Picture("amplitude", figure, caption, alt)
