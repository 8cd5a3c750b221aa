"""Instantaneous frequency and damping against amplitude in free decay."""

from __future__ import annotations

import numpy as np

from discovery.report.results import MODELS, Run
from discovery.report.style import LINES, Picture, label, new_figure
from discovery.report.words import deflection_unit


def draw(run: Run) -> Picture | None:
    """Return the figure; None where no recording holds a free decay."""
    curves = {name: data for name in ("measured", *MODELS) if (data := run.open("amplitude.nc", name)) is not None}
    if "measured" not in curves:
        return None
    figure = new_figure(4.2)
    top, bottom = figure.subplots(2, 1, sharex=True)
    for name, data in curves.items():
        order = np.argsort(data["amplitude"].to_numpy())
        look = {**LINES[name], "markersize": 5} if name == "measured" else LINES[name]
        for axis, variable in ((top, "frequency"), (bottom, "damping")):
            axis.plot(data["amplitude"].to_numpy()[order], data[variable].to_numpy()[order], **look)
    top.set_ylabel(label("frequency", "Hz"))
    bottom.set_ylabel(label("decay rate", "1/s"))
    bottom.set_xlabel(label("amplitude", deflection_unit(run)))
    figure.legend(*top.get_legend_handles_labels(), loc="outside upper left", ncols=2)
    recording = curves["measured"].attrs.get("recording", "a recording")
    return Picture(
        "amplitude",
        figure,
        f"Frequency and decay rate of the energy against amplitude in the free decay of {recording}, swing by swing.",
        "Two panels: frequency and decay rate against amplitude, measured points and a line for each model.",
    )
