"""The manoeuvres that would tell rival effects apart."""

from __future__ import annotations

import numpy as np

from discovery.diagnosis.manoeuvre_design import Move, hub_drive
from discovery.report.results import Run
from discovery.report.style import BLUE, Picture, new_figure
from discovery.report.words import effect_name, listed

__all__ = ["draw"]


def draw(run: Run) -> list[Picture] | None:
    """Draw the hub's angle in every designed manoeuvre."""
    pictures = []
    for i, design in enumerate(run.loop.get("separation") or ()):
        moves = [Move(**m) for m in design["moves"]]
        time = np.linspace(0.0, design["limits"]["duration"], 600)
        figure = new_figure(2.0)
        axes = figure.subplots()
        axes.plot(time, hub_drive(moves).evaluate(time)[0], color=BLUE, linewidth=1.3)
        axes.set_xlabel("time [s]")
        axes.set_ylabel("motor angle [rad]")
        rivals = listed(effect_name(e) for e in design["rivals"])
        pictures.append(
            Picture(
                f"manoeuvre_{i + 1}",
                figure,
                f"Manoeuvre {i + 1}, from where the hub starts: designed to tell {rivals} apart.",
                f"Motor angle against time of the manoeuvre that tells {rivals} apart: {len(moves)} moves with rests.",
            )
        )
    return pictures or None
