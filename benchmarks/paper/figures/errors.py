"""Figures 7 to 9: errors of the models in angle, radius and position."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from benchmarks.paper.figures.look import STRETCHES, FloatArray, beside, curve, envelope, polar
from discovery.report.numbers import significant
from discovery.report.references import paper_numbers
from discovery.report.style import Picture, label, new_figure, plain_log


def _picture(
    name: str,
    time: FloatArray,
    errors: Mapping[str, FloatArray],
    quantity: tuple[str, str],
    caption: str,
    alt: str,
    labels: Mapping[str, str] | None = None,
) -> list[Picture]:
    """Draw errors as the paper does, and below it their envelope on a logarithmic axis, with the exact arm."""
    figure = new_figure(4.0)
    top, bottom = figure.subplots(2, 1, sharex=True)
    for model, error in errors.items():
        size = np.abs(error)
        if model != "after_loop":
            curve(top, model, time, size, linewidth=0.9)
        envelope(bottom, model, time, size, **({"label": labels[model]} if labels and model in labels else {}))
    top.set_ylim(bottom=0.0)
    plain_log(bottom.yaxis)
    top.set_ylabel(label(*quantity))
    bottom.set_ylabel(label(f"largest in {(time[-1] - time[0]) / STRETCHES:.2g} s", quantity[1]))
    bottom.set_xlabel("time [s]")
    bottom.set_xlim(0.0, time[-1])
    figure.legend(*bottom.get_legend_handles_labels(), loc="outside upper left", ncols=2)
    figure.align_ylabels()
    return [Picture(name, figure, f"{caption} Below: logarithmic, with the exact arm.", alt)]


def draw_angle(numbers: Mapping[str, Any], curves: Mapping[str, FloatArray]) -> list[Picture]:
    """Return Figure 7: absolute error of the tip's angle."""
    recorded, _ = polar(curves["recorded"])
    models = ("linear", "cubic", "after_loop")
    found, printed = numbers["errors"], paper_numbers()["errors"]
    linear = beside(found["linear"]["angle"]["mean"], printed["linear"]["angle_mean"], 1e3, "mrad")
    cubic = beside(found["cubic"]["angle"]["mean"], printed["constant_radius"]["angle_mean"], 1e3, "mrad")
    exact = significant(1e3 * found["after_loop"]["angle"]["mean"], 2)
    return _picture(
        "fig_07",
        curves["time"],
        {m: 1e3 * (polar(curves[m])[0] - recorded) for m in models},
        ("angle error", "mrad"),
        f"Fig. 7. Absolute error of the tip’s angle. Mean: linear model {linear}, cubic spring {cubic}, exact arm "
        f"{exact} mrad.",
        f"Angle error against time. Mean: linear {linear}, cubic {cubic}, exact arm {exact} mrad.",
    )


def draw_radius(numbers: Mapping[str, Any], curves: Mapping[str, FloatArray]) -> list[Picture]:
    """Return Figure 8: absolute error of the tip's radius."""
    _, recorded = polar(curves["recorded"])
    found, printed = numbers["errors"], paper_numbers()["errors"]
    constant, law = found["linear"]["radius"], numbers["law_on_recorded_deflection"]
    predicted = significant(1e3 * found["with_radius"]["radius"]["peak"])
    radii = {"linear": polar(curves["linear"])[1], "with_radius": curves["law"]}
    radii["after_loop"] = polar(curves["after_loop"])[1]
    largest = beside(constant["peak"], printed["linear"]["radius_peak"], 1e3, "mm")
    by_law = beside(law["peak"], printed["declared"]["radius_peak"], 1e3, "mm")
    means = [significant(1e3 * e["mean"]) for e in (constant, law)]
    return _picture(
        "fig_08",
        curves["time"],
        {m: 1e3 * (rho - recorded) for m, rho in radii.items()},
        ("radius error", "mm"),
        f"Fig. 8. Absolute error of the tip’s radius. Largest: constant radius (linear model) {largest}, law (16) "
        f"{by_law} on the recorded deflection and {predicted} mm on the predicted one. Mean: {means[0]} and "
        f"{means[1]} mm.",
        f"Radius error against time. Largest: constant radius {largest}, radius law {by_law}.",
        {"linear": "constant radius", "with_radius": "radius law (16)"},
    )


def draw_position(numbers: Mapping[str, Any], curves: Mapping[str, FloatArray]) -> list[Picture]:
    """Return Figure 9: distance of the predicted to the recorded tip."""
    models = ("linear", "cubic", "with_radius", "after_loop")
    found, printed = numbers["errors"], paper_numbers()["errors"]
    names = {"linear": "linear", "cubic": "constant_radius", "with_radius": "declared"}
    linear, cubic, radius = (
        beside(found[m]["position"]["mean"], printed[p]["position_mean"], 1e3, "mm") for m, p in names.items()
    )
    peaks = [
        beside(found[m]["position"]["peak"], printed[names[m]]["position_peak"], 1e3, "mm")
        for m in ("linear", "with_radius")
    ]
    exact = significant(1e3 * found["after_loop"]["position"]["mean"], 2)
    return _picture(
        "fig_09",
        curves["time"],
        {m: 1e3 * np.hypot(*(curves[m] - curves["recorded"]).T) for m in models},
        ("distance", "mm"),
        f"Fig. 9. Distance of the predicted to the recorded tip. Mean: linear model {linear}, cubic spring {cubic}, "
        f"with radius law {radius}, exact arm {exact} mm. Largest: linear model {peaks[0]}, with radius law "
        f"{peaks[1]}.",
        f"Distance against time. Mean: linear {linear}, cubic spring {cubic}, with radius law {radius}, exact arm "
        f"{exact} mm.",
    )
