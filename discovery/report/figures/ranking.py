"""Which candidates were compared in each search, and how much log evidence each gains."""

from __future__ import annotations

from typing import TYPE_CHECKING

from discovery.report.figures.nats import LOSS, bar, nats_axis
from discovery.report.results import Run
from discovery.report.story import Search, blows_up, fate, named, searches
from discovery.report.style import BLUE, MARK, RED, SKY, Picture, new_figure
from discovery.report.words import effect_name, listed

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Candidates and searches that are drawn; the table has all.
_MOST, _SEARCHES = 10, 4
#: Colours of what became of a candidate, and the words for them.
_KINDS = {
    "added": (BLUE, "added"),
    "tied": (SKY, "as likely"),
    "refused": (RED, "tried in vain"),
    "other": ("#9A9A9A", "less likely"),
}


def draw(run: Run) -> list[Picture]:
    """Return the candidates of every search through the catalogue."""
    return [_ranking(run, search, i) for i, search in enumerate(searches(run)[:_SEARCHES], 1)]


def _ranking(run: Run, search: Search, position: int) -> Picture:
    shown = search.candidates[:_MOST]
    figure = new_figure(0.42 * len(shown) + 1.45)
    axes = figure.subplots()
    gains = [c[k] for c in shown if not blows_up(c) for k in ("train", "held")]
    nats_axis(axes, gains)
    labels, seen = [], []
    for row, c in enumerate(shown):
        kind, outcome = search.kind(c["effects"]), search.outcome(c["effects"])
        if search.taken and kind != "added" and fate(run, search.taken) and named(run, c["effects"]):
            outcome = "in the final model"
        colour = _KINDS[kind][0]
        seen.append(kind)
        if not blows_up(c):
            bar(axes, row - 0.18, c["train"], colour)
            bar(axes, row + 0.18, c["held"], colour, held=True)
        name = " +\n".join(map(effect_name, c["effects"]))
        labels.append(f"{name}\n({outcome})" if outcome else name)
    axes.set_yticks(range(len(shown)), labels)
    axes.set_ylim(len(shown) - 0.45, -0.55)
    axes.grid(axis="y", visible=False)
    axes.set_xlabel("log evidence gained [nats]")
    _legend(figure, seen)
    beyond = any(v < LOSS for v in gains)
    return _picture(search, position, figure, len(shown), end=fate(run, search.taken), beyond=beyond)


def _legend(figure: Figure, seen: list[str]) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles: list[Patch | Line2D] = [
        Patch(facecolor="#666666", edgecolor="#666666", label="training"),
        Patch(facecolor="white", edgecolor="#666666", hatch="//////", label="held out"),
        Line2D([], [], **MARK, label="odds of 20 to 1"),
    ]
    handles += [Patch(facecolor=colour, label=words) for kind, (colour, words) in _KINDS.items() if kind in seen]
    figure.legend(handles=handles, loc="outside upper left", ncols=3, columnspacing=1.0, handlelength=1.6)


def _picture(search: Search, position: int, figure: Figure, count: int, *, end: str, beyond: bool) -> Picture:
    beside = f" beside {listed(map(effect_name, search.beside))}" if search.beside else ""
    taken = f"{listed(map(effect_name, search.taken))}{end}" if search.taken else "nothing"
    who = f"the {count} most likely candidates gain" if count > 1 else "the only candidate gains"
    arrows = " Arrows: losses beyond the axis." if beyond else ""
    best = listed(map(effect_name, search.candidates[0]["effects"]))
    return Picture(
        f"ranking_{position}",
        figure,
        f"Search {position}{beside}: log evidence that {who}, once everything is refitted.{arrows} Added: {taken}.",
        f"Bars of the log evidence that each candidate gains, in training and held out; {best} is the most likely. "
        f"Added: {taken}.",
    )
