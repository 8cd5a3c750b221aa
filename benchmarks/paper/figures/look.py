"""The look of the models on the reproduction page, and numbers beside the paper's."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from discovery.report.numbers import significant
from discovery.report.style import BLUE, GREEN, GREY, LINES, RED, decimate

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FloatArray = NDArray[np.float64]

#: Every model of the paper and the exact arm: colour, dashes and width all differ.
LOOKS: dict[str, dict[str, Any]] = {
    "linear": LINES["linear"],
    "cubic": {"color": RED, "linestyle": (0, (4, 1.6)), "linewidth": 1.1, "label": "cubic spring"},
    "with_radius": {"color": GREEN, "linestyle": (0, (7, 1.2)), "linewidth": 1.2, "label": "with radius law"},
    "after_loop": {"color": BLUE, "linestyle": "-", "linewidth": 0.7, "label": "exact arm"},
}
#: A line that marks a value.
DASHED: dict[str, Any] = {"color": GREY, "linestyle": (0, (5, 2)), "linewidth": 1.0}
STRETCHES = 25
"""Stretches of time of each of which the largest error is shown: each longer than a swing."""


def beside(ours: float, printed: float, factor: float = 1.0, unit: str = "", digits: int = 3) -> str:
    """Return a number, multiplied into a unit of display, and behind it the paper's with the digits that it prints."""
    size = f"{significant(factor * ours, digits)} {unit}".strip()
    return f"{size} (paper {factor * printed:.6g})"


def polar(tip: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return angle [rad] and radius [m] of a path of the tip, shape (n, 2)."""
    return np.unwrap(np.arctan2(tip[:, 1], tip[:, 0])), np.hypot(*tip.T)


def curve(axes: Axes, model: str, time: FloatArray, values: FloatArray, **changes: Any) -> None:
    """Draw one curve in the model's own look."""
    axes.plot(*decimate(time, values), **{**LOOKS[model], **changes})


def envelope(axes: Axes, model: str, time: FloatArray, size: FloatArray, **changes: Any) -> None:
    """Draw the largest value in every stretch of time, which stays readable on a logarithmic axis."""
    edges = np.unique(np.linspace(0, time.size, STRETCHES + 1).astype(int))[:-1]
    largest = np.maximum.reduceat(size, edges)
    times, values = np.append(time[edges], time[-1]), np.append(largest, largest[-1])
    axes.semilogy(times, values, drawstyle="steps-post", **{**LOOKS[model], **changes})


def marks(axes: Axes, *looks: Mapping[str, Any]) -> list[Any]:
    """Return the entries of a legend for markers that more than one series shares."""
    return [axes.plot([], [], **{"linestyle": "none", **look})[0] for look in looks]
