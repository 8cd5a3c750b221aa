"""Axes to draw on: those that are given, else new ones."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from discovery.foundation.arguments import expect
from discovery.foundation.estimate_text import prefix_for

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

#: Width of a figure and height of one picture in it [inch].
_WIDTH, _HEIGHT = 8.0, 2.4


def one_axes(given: Axes | None) -> Axes:
    """Return the axes that are given, or those of a new figure of pyplot."""
    if given is not None:
        return axes_below(1, given)[0]
    import matplotlib.pyplot as plt

    return plt.subplots(figsize=(_WIDTH, 1.6 * _HEIGHT), layout="constrained")[1]


def with_unit(axis: Axis, label: str, unit: str) -> None:
    """Label an axis on which SI values are drawn: its ticks are in mm or µm where all values are small."""
    from matplotlib.ticker import FuncFormatter

    factor, prefix = prefix_for(unit, float(np.abs(axis.get_view_interval()).max()))
    if prefix:
        axis.set_major_formatter(FuncFormatter(lambda x, _: f"{factor * x:g}"))
    axis.set_label_text(f"{label} [{prefix}{unit}]" if unit not in ("", "1") else label)


def axes_below(count: int, given: Axes | Sequence[Axes] | None) -> list[Axes]:
    """Return a column of axes, new ones of pyplot where none are given; InputError if they are not axes, so many."""
    from discovery.foundation.errors import InputError

    if given is None:
        import matplotlib.pyplot as plt

        figure = plt.figure(figsize=(_WIDTH, _HEIGHT * count), layout="constrained")
        return list(figure.subplots(count, 1, squeeze=False)[:, 0])
    from matplotlib.axes import Axes

    # Rows and columns of axes, as `subplots` returns them, one after the other; a single one as a list of one.
    found = list(np.ravel(np.asarray(given, dtype=object)))
    for ax in found:
        expect(ax, Axes, "axes", "Make some with matplotlib.pyplot.subplots, or leave them out.")
    if len(found) != count:
        raise InputError(f"{count} axes are needed, and {len(found)} are given.")
    return found


def detached_axes(count: int) -> tuple[Figure, list[Axes]]:
    """Return a figure for a file, of which no window knows, and a column of axes in it."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(_WIDTH, _HEIGHT * count), layout="constrained")
    return figure, list(figure.subplots(count, 1, squeeze=False)[:, 0])
