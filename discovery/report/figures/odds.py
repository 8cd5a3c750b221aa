"""What each added effect is worth: the three log odds of which the smallest decides."""

from __future__ import annotations

from typing import Any

from discovery.report.figures.nats import bar, nats_axis
from discovery.report.results import Run
from discovery.report.sentences import chances
from discovery.report.style import BLUE, ORANGE, Picture, new_figure
from discovery.report.words import effect_name, listed


def draw(run: Run) -> Picture | None:
    """Return the log odds of every effect that was added from the catalogue; None where there is none."""
    from matplotlib.patches import Patch

    shown = [e for e in run.loop["effects"] if e["evidence"]]
    if not shown:
        return None
    figure = new_figure(0.62 * len(shown) + 1.4)
    axes = figure.subplots()
    nats_axis(axes, (v for e in shown for v in _parts(e["evidence"])))
    for row, e in enumerate(shown):
        train, held, against = _parts(e["evidence"])
        bar(axes, row - 0.25, train, BLUE, height=0.23)
        bar(axes, row, held, BLUE, held=True, height=0.23)
        bar(axes, row + 0.25, against, ORANGE, height=0.23)
    axes.set_yticks(range(len(shown)), [effect_name(e["id"]).replace(" ", "\n", 1) for e in shown])
    axes.set_ylim(len(shown) - 0.5, -0.5)
    axes.grid(axis="y", visible=False)
    axes.set_xlabel("log odds [nats]")
    handles = [
        Patch(facecolor=BLUE, edgecolor=BLUE, label="training"),
        Patch(facecolor="white", edgecolor=BLUE, hatch="//////", label="with held out"),
        Patch(facecolor=ORANGE, edgecolor=ORANGE, label="against model error"),
    ]
    figure.legend(handles=handles, loc="outside upper left", ncols=3, columnspacing=1.0, handlelength=1.6)
    words = listed(f"{effect_name(e['id'])} has {chances(e['evidence']['odds'])}" for e in shown)
    return Picture(
        "odds",
        figure,
        "Three log odds of each added effect: the smallest decides, and must pass the dashed line at 20 to 1. "
        f"{words.capitalize()}.",
        f"Bars of three log odds for each added effect. {words}.",
    )


def _parts(evidence: dict[str, Any]) -> tuple[float | None, float | None, float | None]:
    """Return the log odds in training, with the held-out recordings, and against being model error."""
    train, held = evidence["train"], evidence["held"]
    both = None if train is None or held is None else train + held
    return train, both, evidence["against_error"]
