"""Parameters over the cases of a campaign: each estimate, what the others make of it, and the population."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from discovery.report.numbers import unit_text
from discovery.report.style import BLUE, GREY, ORANGE, Picture, new_figure, quantity_label, verbatim

#: Parameters that are drawn, cases up to which each is named on the axis, and letters of a name there.
_PARAMETERS, _NAMED, _LETTERS = 12, 25, 14
#: Standard deviations of an interval of 95 %.
_WIDE = 1.96


def draw_specimens(pooled: Sequence[Mapping[str, Any]]) -> list[Picture]:
    """Return pictures of the parameters that most cases have, from `discovery.runs.campaign.pooled_parameters`."""
    return [_draw(i, parameter) for i, parameter in enumerate(pooled[:_PARAMETERS])]


def _short(name: str) -> str:
    """Return a name for an axis."""
    return name if len(name) <= _LETTERS else f"{name[: _LETTERS - 1]}…"


def _draw(number: int, parameter: Mapping[str, Any]) -> Picture:
    cases = parameter["cases"]
    place = np.arange(len(cases))
    values, sds = (np.array([case[key] for case in cases]) for key in ("value", "sd"))
    shrunk = np.array([[case["shrunk"][end] for end in ("low", "median", "high")] for case in cases])
    figure = new_figure(2.6)
    axes = figure.subplots()
    mean, following = parameter["mean"], parameter["following"]
    axes.axhspan(following["low"], following["high"], color=GREY, alpha=0.12, linewidth=0, label="next specimen")
    axes.axhspan(mean["low"], mean["high"], color=GREY, alpha=0.35, linewidth=0, label="mean of all")
    drawn: dict[str, Any] = {"markersize": 4.0 if len(cases) <= _NAMED else 1.5, "linewidth": 1.0}
    apart = np.abs(shrunk[:, [0, 2]] - shrunk[:, 1:2]).T
    axes.errorbar(place - 0.12, values, _WIDE * sds, fmt="o", color=BLUE, label="alone", **drawn)
    axes.errorbar(place + 0.12, shrunk[:, 1], apart, fmt="s", color=ORANGE, label="with the others", **drawn)
    # A first specimen that is far off hides none of the others, and a band that is far wider than all points neither.
    low, high = (values - 2 * _WIDE * sds).min(), (values + 2 * _WIDE * sds).max()
    axes.set_ylim(max(axes.get_ylim()[0], low), min(axes.get_ylim()[1], high))
    if len(cases) <= _NAMED:
        names = [_short(case["name"]) for case in cases]
        turned = 90 if len(cases) > 5 or max(map(len, names)) > 8 else 0
        axes.set_xticks(place, [verbatim(name) for name in names], rotation=turned)
    else:
        axes.set_xlabel("case")
    axes.set_ylabel(quantity_label(parameter["parameter"], unit_text(parameter["unit"])))
    figure.legend(loc="outside upper left", ncols=2)
    return Picture(
        f"specimens_{number}_{parameter['parameter']}",
        figure,
        "Estimates with 95 % intervals, each alone and with the others’ help; grey: the mean of all specimens, and "
        "where the next one will be.",
        f"{parameter['parameter']} over {len(cases)} cases with intervals, alone and pooled.",
        raster=len(cases) > 200,
    )
