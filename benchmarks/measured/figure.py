"""One figure over all rigs: held-out errors before and after, the best known one, and the floor."""

from __future__ import annotations

from collections.abc import Sequence

from benchmarks.measured.entry import Entry
from discovery.report.style import BLUE, GREEN, GREY, RED, Picture, new_figure, plain_log


def draw(entries: Sequence[Entry]) -> Picture:
    """Return the errors on held-out data over that of the declared model, on a logarithmic axis, one line a rig."""
    figure = new_figure(0.27 * len(entries) + 1.5, width=7.2)
    axes = figure.subplots()
    labels = {
        "before: declared model": ("s", RED),
        "after: final model": ("o", BLUE),
        "best known": ("D", GREEN),
        "floor": ("|", GREY),
    }
    seen = set()
    for row, entry in enumerate(entries):
        before, after = (entry.error(when, entry.judged) for when in ("before", "after"))
        if not before or after is None:
            continue
        best = entry.best_known(entry.judged)
        values = (before, after, best[0] if best else None, entry.floor()[0])
        axes.plot([1.0, after / before], [row, row], color="#BBBBBB", linewidth=1.5, zorder=1)
        for (name, (marker, colour)), value in zip(labels.items(), values, strict=True):
            if value is not None:
                once = name not in seen
                seen.add(name)
                (point,) = axes.plot(
                    value / before, row, marker, color=colour, markersize=6, label=name if once else None
                )
                if marker == "D":
                    point.set_fillstyle("none")
    axes.set_xscale("log")
    plain_log(axes.xaxis)
    axes.set_yticks(range(len(entries)), [e.run.results["rig"]["name"] for e in entries])
    axes.set_ylim(len(entries) - 0.4, -0.6)
    axes.set_xlabel("held-out rms error over that of the declared model")
    figure.legend(loc="outside upper left", ncols=4)
    return Picture(
        "comparison",
        figure,
        "Free-run errors on held-out data, each over that of the declared model: after the loop, the best comparable "
        "figure from elsewhere, and what a perfect model would leave.",
        "Held-out errors of every measured set relative to the declared model: before, after, best known, floor.",
        wide=True,
    )
