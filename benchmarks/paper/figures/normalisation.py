"""The claim of (9): a model found on one arm, carried to others without a fit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from benchmarks.paper.figures.look import DASHED
from discovery.report.numbers import significant
from discovery.report.style import BLUE, GREEN, ORANGE, RED, Picture, new_figure, plain_log

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_LOOKS: dict[str, dict[str, Any]] = {
    "linear": {"color": ORANGE, "marker": "s", "linestyle": (0, (1, 1.2)), "label": "linear model"},
    "paper, massless rod": {"color": RED, "marker": "^", "linestyle": (0, (4, 1.6)), "label": "paper’s, massless rod"},
    "paper, rod counted": {"color": GREEN, "marker": "v", "linestyle": (0, (7, 1.2)), "label": "paper’s, rod counted"},
    "exact arm": {"color": BLUE, "marker": "o", "linestyle": "-", "label": "exact arm"},
}
#: Quantities of arms that are alike in normalised coordinates: words.
_ALIKE = {"length": "length", "stiffness": "stiffness", "both masses": "masses"}

_Trials = Sequence[Mapping[str, Any]]


def _errors(axes: Axes, places: Sequence[float], trials: _Trials, lines: bool) -> None:
    for name, look in _LOOKS.items():
        changes = {} if lines else {"linestyle": "none"}
        values = [100 * t["errors"][name] for t in trials]
        axes.plot(places, values, **{"markersize": 5, "linewidth": 1.0, **look, **changes})
    axes.set_yscale("log")
    plain_log(axes.yaxis)


def draw(numbers: Mapping[str, Any], curves: Mapping[str, Any]) -> list[Picture]:
    """Return the mean error over the length, by what differs from the arm on which the models were found."""
    trials = numbers["trials"]
    alike = [t for t in trials if t["changed"] in _ALIKE]
    ratios, sizes = ([t for t in trials if t["changed"] == c] for c in ("mass ratio", "amplitude"))
    (home,) = (t for t in sizes if t["value"] == 1.0)
    figure = new_figure(6.4)
    top, middle, bottom = figure.subplots(3, 1, sharey=True)
    _errors(top, range(len(alike)), alike, lines=False)
    top.set_xticks(range(len(alike)), [f"{_ALIKE[t['changed']]}\n× {t['value']:g}" for t in alike])
    top.margins(x=0.09)
    top.set_xlabel("quantity changed [–]")
    _errors(middle, [t["mass_ratio"] for t in ratios], ratios, lines=True)
    middle.axvline(home["mass_ratio"], **DASHED)
    middle.set_xlabel("mass of the rod over that of the tip [–]")
    _errors(bottom, [t["deflection"] for t in sizes], sizes, lines=True)
    bottom.axvline(home["deflection"], **DASHED)
    bottom.set_xlabel("largest deflection [rad]")
    middle.set_ylabel("mean error of the tip over the length [%]")
    figure.legend(*top.get_legend_handles_labels(), loc="outside upper left", ncols=2)

    def worst(group: _Trials, name: str) -> str:
        return f"{significant(max(100 * t['errors'][name] for t in group), 2)} %"

    model = "paper, rod counted"
    words = (
        f"the paper’s model, its rod counted, is wrong by {significant(100 * home['errors'][model], 2)} % where it was "
        f"found, {worst(alike, model)} at most on arms of other length, stiffness or mass, {worst(ratios, model)} at "
        f"other mass ratios ({worst(ratios, 'paper, massless rod')} with a massless rod) and {worst(sizes, model)} at "
        f"other amplitudes; the exact arm {worst(trials, 'exact arm')}"
    )
    return [
        Picture(
            "normalisation",
            figure,
            f"Models found on the paper’s arm (dashed line) and carried to other arms by (9), nothing fitted: {words}.",
            f"Three panels of mean error on a logarithmic axis, by the quantity changed: {words}.",
        )
    ]
