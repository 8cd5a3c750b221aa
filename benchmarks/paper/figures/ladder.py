"""Error against model, from the linear one to the exact arm; and what freed inertial terms do."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from benchmarks.paper.figures.look import DASHED, marks
from benchmarks.paper.stand import POSITION_NOISE
from discovery.report.numbers import significant
from discovery.report.references import paper_numbers
from discovery.report.style import BLUE, GREEN, GREY, RED, Picture, new_figure, plain_log

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: The manoeuvres on which a model is judged: colour, marker, and place in its row.
_MANOEUVRES = {"trained": (BLUE, "o", -0.24), "inside": (GREEN, "s", 0.0), "beyond": (RED, "^", 0.24)}
#: Terms of finding h by parameter.
_TERMS = {"c_cen": "c₁", "c_cor": "c₂", "c_rad": "c₃"}


def _dots(axes: Axes, row: int, errors: Mapping[str, Mapping[str, float]], filled: bool) -> None:
    for name, (colour, marker, shift) in _MANOEUVRES.items():
        axes.plot(
            1e3 * errors[name]["mean"],
            row + shift,
            marker,
            color=colour,
            markersize=6,
            markerfacecolor=colour if filled else "white",
            zorder=4 if filled else 3,
        )


def _finish(axes: Axes, names: Sequence[str]) -> None:
    axes.set_xscale("log")
    plain_log(axes.xaxis)
    axes.set_yticks(range(len(names)), names)
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.grid(axis="y", visible=False)
    for row in range(1, len(names)):
        axes.axhline(row - 0.5, color="#DDDDDD", linewidth=0.6)
    axes.set_xlabel("mean error of the tip [mm]")


def _entries(deflection: Mapping[str, float]) -> list[dict[str, Any]]:
    words = {"trained": "fitted", "inside": "inside", "beyond": "beyond"}
    return [
        {"marker": m, "color": c, "label": f"{words[n]}, {significant(deflection[n], 2)} rad"}
        for n, (c, m, _) in _MANOEUVRES.items()
    ]


def draw_ladder(numbers: Mapping[str, Any], curves: Mapping[str, Any]) -> list[Picture]:
    """Return the error of every model on three manoeuvres, from the rig file alone and fitted."""
    rows, deflection = numbers["ladder"], numbers["deflection"]
    names = list(dict.fromkeys(r["model"] for r in rows))
    figure = new_figure(0.46 * len(names) + 1.35)
    axes = figure.subplots()
    for r in rows:
        _dots(axes, names.index(r["model"]), r["errors"], r["how"] == "fitted")
    noise = axes.axvline(1e3 * POSITION_NOISE, **DASHED, label="camera’s noise")
    _finish(axes, names)
    how = [
        {"marker": "o", "color": GREY, "label": "all parameters fitted"},
        {"marker": "o", "color": GREY, "markerfacecolor": "white", "label": "rig file, only ξ fitted"},
    ]
    figure.legend(
        handles=[*marks(axes, *_entries(deflection), *how), noise], loc="outside upper left", ncols=2, fontsize=8
    )
    inside = {(r["model"], r["how"]): significant(1e3 * r["errors"]["inside"]["mean"], 2) for r in rows}
    first, last = names[0], names[-1]
    words = (
        f"inside the fitted deflection the first model ({first}) leaves {inside[first, 'fitted']} mm when fitted, the "
        f"last ({last}) {inside[last, 'fitted']} mm, and {inside[last, 'rig']} mm from the rig file alone"
    )
    return [
        Picture(
            "ladder",
            figure,
            f"Mean distance to the noise-free tip by model, on the fitted manoeuvre, on one inside its deflection and "
            f"on one beyond. {_upper(words)}.",
            f"Dots on a logarithmic axis: mean error of {len(names)} models on three manoeuvres; {words}.",
        )
    ]


def _upper(words: str) -> str:
    return words[:1].upper() + words[1:]


def _values(row: Mapping[str, Any]) -> str:
    """Return the inertial coefficients of a row and its cubic stiffness, for the second line of its name."""
    values = row["values"]
    shown = [f"{symbol} {significant(values[n], 2)}" for n, symbol in _TERMS.items() if n in values]
    shown.append(f"β {significant(values['beta'], 2)}")
    # Two to a line leave the dots their place.
    return ",\n".join(", ".join(shown[i : i + 2]) for i in range(0, len(shown), 2))


def draw_freed(numbers: Mapping[str, Any], curves: Mapping[str, Any]) -> list[Picture]:
    """Return the error with the inertial terms one at a time, held at first principles, and all free (finding h)."""
    rows = numbers["freed"]
    figure = new_figure(0.54 * len(rows) + 1.2)
    axes = figure.subplots()
    for i, r in enumerate(rows):
        _dots(axes, i, r["errors"], filled=True)
    _finish(axes, [f"{r['model'].removesuffix(' at first principles')}\n{_values(r)}" for r in rows])
    figure.legend(handles=marks(axes, *_entries(numbers["deflection"])), loc="outside upper left", ncols=2, fontsize=8)
    by = {r["model"]: {n: significant(1e3 * e["mean"], 2) for n, e in r["errors"].items()} for r in rows}
    held, free = by["all held at first principles"], by["all free"]
    words = (
        f"held at first principles they leave {held['trained']} mm on the fitted manoeuvre, {held['inside']} mm inside "
        f"and {held['beyond']} mm beyond; left free {free['trained']}, {free['inside']} and {free['beyond']} mm"
    )
    return [
        Picture(
            "freed",
            figure,
            f"The terms that the paper’s model leaves out, added to it one at a time and together, with their "
            f"coefficients and the β fitted with them (paper: {paper_numbers()['parameters']['beta']} 1/s²). "
            f"{_upper(words)}.",
            f"Dots: mean error of the paper’s model with inertial terms; {words}.",
        )
    ]
