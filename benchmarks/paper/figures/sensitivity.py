"""Which of the paper's numbers depend on what it does not state: speed, length of the record, mass of the rod."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from discovery_datasets.twin import PAPER_RIG

from benchmarks.paper.figures.look import marks
from benchmarks.paper.stand import DURATION, SPEED
from discovery.report.numbers import significant
from discovery.report.references import paper_numbers
from discovery.report.style import GREY, Picture, new_figure
from discovery.report.words import listed


@dataclass(frozen=True)
class _Row:
    """A number of the paper: words, key of the study, place in ``published.toml``, factor and unit of display."""

    words: str
    key: str
    place: tuple[str, ...]
    factor: float = 1.0
    unit: str = ""

    @property
    def printed(self) -> float:
        """The paper's number, in SI units."""
        found: Any = paper_numbers()
        for name in self.place:
            found = found[name]
        return float(found)


#: Blocks of rows, as P11 to P15 list them.
_BLOCKS = (
    (
        _Row("deflection", "deflection", ("manoeuvre", "deflection"), 1.0, "rad"),
        _Row("variation of ρₜ", "radius_constant_peak", ("manoeuvre", "radius_variation"), 1e3, "mm"),
    ),
    (
        _Row("ξ (linear)", "xi_linear", ("linear", "xi"), 1.0, "1/s"),
        _Row("ω²", "omega2", ("linear", "omega2"), 1.0, "1/s²"),
        _Row("ξ", "xi", ("parameters", "xi"), 1.0, "1/s"),
        _Row("α", "alpha", ("parameters", "alpha"), 1.0, "1/s²"),
        _Row("β", "beta", ("parameters", "beta"), 1.0, "1/s²"),
        _Row("γ", "gamma", ("parameters", "gamma")),
    ),
    (
        _Row("angle (linear)", "angle_linear", ("errors", "linear", "angle_mean"), 1e3, "mrad"),
        _Row("angle (cubic)", "angle_cubic", ("errors", "constant_radius", "angle_mean"), 1e3, "mrad"),
        _Row("radius (constant)", "radius_constant_mean", ("errors", "linear", "radius_peak"), 1e3, "mm"),
        _Row("tip (linear)", "position_linear", ("errors", "linear", "position_mean"), 1e3, "mm"),
        _Row("tip (cubic)", "position_cubic", ("errors", "constant_radius", "position_mean"), 1e3, "mm"),
        _Row("tip (radius law)", "position_with_radius", ("errors", "declared", "position_mean"), 1e3, "mm"),
    ),
    (
        _Row("peak (linear)", "peak_linear", ("errors", "linear", "position_peak"), 1e3, "mm"),
        _Row("peak (radius law)", "peak_with_radius", ("errors", "declared", "position_peak"), 1e3, "mm"),
    ),
)
#: What is varied: words, factor and unit of display, and the value behind Figures 5 to 13.
_VARIED = {
    "speed": ("speed of the motor", 1.0, "rad/s", SPEED),
    "duration": ("length of the record", 1.0, "s", DURATION),
    "rod_mass": ("mass of the rod", 1e3, "g", PAPER_RIG.beam_mass),
}
#: From low to high values: part of the viridis scale, which gets lighter throughout, and a marker for each.
_COLOURS = ("#440154", "#423f85", "#2d718e", "#1e9d89", "#56c667", "#cae11f")
_MARKERS = "os^Dvp"
#: Spread of a number, relative to the paper's, below which it counts as robust.
_ROBUST = 0.1


def draw(numbers: Mapping[str, Any], curves: Mapping[str, Any]) -> list[Picture]:
    """Return one figure for each quantity that is varied: every number over the paper's."""
    return [_picture(name, numbers[name]) for name in _VARIED]


def _picture(varied: str, found: list[Mapping[str, float]]) -> Picture:
    words, factor, unit, usual = _VARIED[varied]
    rows = [r for block in _BLOCKS for r in block]
    ratios = np.array([[f[r.key] / r.printed for r in rows] for f in found])
    figure = new_figure(0.25 * len(rows) + 1.25)
    axes = figure.subplots()
    places = np.arange(len(rows))
    axes.hlines(places, ratios.min(axis=0), ratios.max(axis=0), color="#BBBBBB", linewidth=1.5, zorder=1)
    looks = []
    for f, values, colour, marker in zip(found, ratios, _COLOURS, _MARKERS, strict=False):
        name = f"{factor * f[varied]:g} {unit}"
        look: dict[str, Any] = {"marker": marker, "color": colour, "markersize": 5, "label": name}
        axes.plot(values, places, linestyle="none", **look)
        looks.append(look)
    axes.axvline(1.0, color="black", linewidth=1.0)
    for edge in np.cumsum([len(block) for block in _BLOCKS])[:-1]:
        axes.axhline(edge - 0.5, color=GREY, linewidth=0.6)
    axes.set_yticks(places, [f"{r.words}  {r.factor * r.printed:.6g} {r.unit}".strip() for r in rows])
    axes.set_ylim(len(rows) - 0.5, -0.5)
    axes.grid(axis="y", visible=False)
    axes.set_xlabel("number over the paper’s [–]")
    figure.legend(handles=marks(axes, *looks), loc="outside upper left", ncols=3, fontsize=8, columnspacing=1.0)
    spread = np.ptp(ratios, axis=0)
    robust = listed(r.words for r, s in zip(rows, spread, strict=True) if s < _ROBUST) or "none"
    widest = rows[int(np.argmax(spread))]
    low, high = (significant(v, 2) for v in (ratios[:, rows.index(widest)].min(), ratios[:, rows.index(widest)].max()))
    story = (
        f"Changed by less than {100 * _ROBUST:g} % of the paper’s number: {robust}. Least robust: {widest.words}, "
        f"{low} to {high} times the paper’s"
    )
    return Picture(
        f"sensitivity_{varied}",
        figure,
        f"The paper’s numbers (left, as printed), found again on the twin at other values of the {words}, over the "
        f"printed ones; Figs. 5 to 13 have {factor * usual:g} {unit}. The radius’s printed maximum stands beside our "
        f"mean. {story}.",
        f"Dots for {len(rows)} numbers over the paper’s by {words}. {story}.",
    )
