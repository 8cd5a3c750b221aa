"""The manoeuvres that would tell rival effects apart."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from discovery.diagnosis.manoeuvre_design import Move, hub_drive
from discovery.report.ambiguity import input_of
from discovery.report.follow_up_sentences import laws_apart
from discovery.report.results import Run
from discovery.report.style import BLUE, GREEN, ORANGE, Picture, label, new_figure
from discovery.report.words import effect_name, listed

#: Characters of a legend, with four for each line, that one row of a figure holds.
_ROW = 50


def draw(run: Run) -> list[Picture] | None:
    """Draw the course of the input in every manoeuvre that decides, or what is predicted of a release."""
    pictures = []
    for i, design in enumerate(run.loop.get("separation") or ()):
        if design["decides"] and (design["moves"] or design["predicted"]):
            pictures.append((_course if design["moves"] else _release)(i + 1, design))
    return pictures or None


def _course(number: int, design: Mapping[str, Any]) -> Picture:
    """Draw the course of the input."""
    moves = [Move(**m) for m in design["moves"]]
    time = np.linspace(0.0, design["limits"]["duration"], 600)
    figure = new_figure(2.0)
    axes = figure.subplots()
    axes.plot(time, hub_drive(moves).evaluate(time)[0], color=BLUE, linewidth=1.3)
    name, unit = input_of(design)
    axes.set_xlabel("time [s]")
    axes.set_ylabel(label(name, unit))
    rivals = listed(map(effect_name, laws_apart(design)))
    return Picture(
        f"manoeuvre_{number}",
        figure,
        f"Manoeuvre {number}, from where the {'hub' if name == 'motor angle' else 'input'} starts: designed to tell "
        f"{rivals} apart.",
        f"{name.capitalize()} against time of the manoeuvre that tells {rivals} apart: {len(moves)} moves with rests.",
    )


def _release(number: int, design: Mapping[str, Any]) -> Picture:
    """Draw what each law predicts after a release, and below it how far the others lie from the first."""
    time, *every = np.array(design["predicted"]).T
    own = dict(zip(design["rivals"], every, strict=True))
    shown = laws_apart(design)
    names, predicted = [*map(effect_name, shown)], [own[name] for name in shown]
    rows = 1 if sum(len(name) + 4 for name in names) <= _ROW else len(names)
    figure = new_figure(2.8 + 0.2 * rows)
    above, below = figure.subplots(2, sharex=True)
    for name, reading, colour in zip(names, predicted, (BLUE, ORANGE, GREEN), strict=False):
        above.plot(time, reading, color=colour, linewidth=1.1, label=name)
        if reading is not predicted[0]:
            below.plot(time, reading - predicted[0], color=colour, linewidth=1.1)
    above.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=len(names) if rows == 1 else 1, frameon=False)
    above.set_ylabel(label("reading", design["unit"]))
    below.set_ylabel(label("apart", design["unit"]))
    below.set_xlabel("time [s]")
    rivals, place = listed(names), f"{design['release']:.3g} {design['unit']}"
    return Picture(
        f"manoeuvre_{number}",
        figure,
        f"Manoeuvre {number}: let go at {place} from rest, to tell {rivals} apart. Above what each predicts with its "
        "parameters as they are, below how far they lie apart.",
        f"Predictions of {rivals} against time after a release at {place}, and their difference.",
    )
