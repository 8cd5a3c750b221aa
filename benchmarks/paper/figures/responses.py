"""Figures 10 to 13: the recorded tip and the models, in x and y, at the start and at the end of the record."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from benchmarks.paper.figures.look import FloatArray, curve
from discovery.report.style import Picture, new_figure, series

_SPAN = 6.0
_MODELS = ("linear", "cubic", "with_radius")
#: Number, coordinate and end of the record of each figure.
_PANELS = ((10, 0, "first"), (11, 1, "first"), (12, 0, "last"), (13, 1, "last"))


def draw(numbers: Mapping[str, Any], curves: Mapping[str, FloatArray]) -> list[Picture]:
    """Return Figures 10 to 13."""
    return [_panel(number, coordinate, end, curves) for number, coordinate, end in _PANELS]


def _panel(number: int, coordinate: int, end: str, curves: Mapping[str, FloatArray]) -> Picture:
    time = curves["time"]
    start = 0.0 if end == "first" else time[-1] - _SPAN
    here = (time >= start) & (time <= start + _SPAN)
    name = "xy"[coordinate]
    figure = new_figure(2.7)
    axes = figure.subplots()
    series(axes, "measured", time[here], 1e3 * curves["recorded"][here, coordinate], label="recording", markersize=3.5)
    for model in _MODELS:
        curve(axes, model, time[here], 1e3 * curves[model][here, coordinate])
    axes.set_xlim(start, start + _SPAN)
    axes.set_ylabel(f"{name} [mm]")
    axes.set_xlabel("time [s]")
    figure.legend(loc="outside upper left", ncols=2)
    seen = (
        "The models of constant radius overshoot where the arm is bent most."
        if end == "first"
        else "The linear model is out of phase: the arm’s frequency changes with its amplitude."
    )
    return Picture(
        f"fig_{number}",
        figure,
        f"Fig. {number}. {name} of the tip in the {end} {_SPAN:g} s, recording (some samples) and the paper’s "
        f"models. {seen}",
        f"{name} of the tip in millimetres against time, {end} {_SPAN:g} seconds: recording and three models.",
    )
