"""Phase portrait: the deflection against its rate, measured and after the loop."""

from __future__ import annotations

import numpy as np

from discovery.foundation.arrays import FloatArray
from discovery.foundation.sampling import median_step
from discovery.report.results import Run, Trajectory
from discovery.report.style import LINES, Picture, label, new_figure
from discovery.report.words import sentence

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


def draw(run: Run) -> Picture | None:
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
            look = {**LINES[model], "linewidth": 0.8}
            axes.plot(*portrait, **look)
    unit, what = run.coordinate_unit, "deflection" if run.system.has_rod else run.output_name
    axes.set_xlabel(label(what, unit))
    axes.set_ylabel(label("its rate", f"{unit}/s"))
    figure.legend(loc="outside upper left", ncols=2)
    return Picture(
        "phase",
        figure,
        f"Phase portrait of {shown.name}, first {min(_SWINGS * period, shown.time[-1] - shown.time[0]):.3g} s.",
        f"{sentence(what)} of {shown.name} against its rate: loops, measured and by the final model.",
        raster=True,
    )
