"""Figures 5 and 6: the recorded motion of the tip, Cartesian and polar."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from benchmarks.paper.figures.look import FloatArray, beside, polar
from discovery.report.references import paper_numbers
from discovery.report.style import BLUE, Picture, decimate, new_figure

_RECORDED: dict[str, Any] = {"color": "black", "linewidth": 0.8}


def draw_cartesian(numbers: Mapping[str, Any], curves: Mapping[str, FloatArray]) -> list[Picture]:
    """Return Figure 5: x and y of the tip against time."""
    figure = new_figure(3.2)
    for axes, name, values in zip(figure.subplots(2, 1, sharex=True), "xy", curves["recorded"].T, strict=True):
        axes.plot(*decimate(curves["time"], 1e3 * values), **_RECORDED)
        axes.set_ylabel(f"{name} [mm]")
        axes.set_xlim(0.0, curves["time"][-1])
    axes.set_xlabel("time [s]")
    figure.align_ylabels()
    return [
        Picture(
            "fig_05",
            figure,
            "Fig. 5. Cartesian coordinates of the tip as the camera records them.",
            "Two panels: recorded x and y of the tip in millimetres against time, a decaying oscillation.",
        )
    ]


def draw_polar(numbers: Mapping[str, Any], curves: Mapping[str, FloatArray]) -> list[Picture]:
    """Return Figure 6: angle of the tip with the motor's, and its radius."""
    time, (theta_t, rho) = curves["time"], polar(curves["recorded"])
    figure = new_figure(3.5)
    top, bottom = figure.subplots(2, 1, sharex=True)
    top.plot(*decimate(time, theta_t), label="tip θₜ", **_RECORDED)
    top.plot(*decimate(time, curves["motor_angle"]), color=BLUE, linestyle=(0, (4, 1.6)), label="motor θₘ")
    top.set_ylabel("angle [rad]")
    bottom.plot(*decimate(time, 1e3 * rho), **_RECORDED)
    bottom.set_ylabel("radius ρₜ [mm]")
    bottom.set_xlabel("time [s]")
    bottom.set_xlim(0.0, time[-1])
    figure.legend(loc="outside upper left", ncols=2)
    figure.align_ylabels()
    reached, printed = numbers["excursion"], paper_numbers()["manoeuvre"]
    largest = beside(reached["deflection"], printed["deflection"], 1.0, "rad", 2)
    varied = beside(reached["radius_variation"], printed["radius_variation"], 1e3, "mm", 2)
    return [
        Picture(
            "fig_06",
            figure,
            f"Fig. 6. Polar coordinates of the tip, and the motor’s angle. Largest deflection {largest}; the radius "
            f"varies by {varied}.",
            "Two panels against time: recorded angle of the tip with the motor’s ramp of 1 rad, and recorded radius, "
            "which shortens at every swing.",
        )
    ]
