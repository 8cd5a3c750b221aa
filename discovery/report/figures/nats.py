"""An axis of log evidence: linear where gains are few nats, else logarithmic beyond the odds that decide."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from discovery.report.style import GREY, MARK
from discovery.selection.settings import LoopSettings

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Losses beyond this [nats] are drawn at the edge, with an arrow.
LOSS = -30.0
#: Gain [nats] from which the axis is logarithmic beyond the odds that decide.
_LARGE = 60.0


def nats_axis(axes: Axes, values: Iterable[float | None]) -> None:
    """Set the horizontal axis for gains in nats, and mark none and the odds that decide."""
    from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

    known = [v for v in values if v is not None and np.isfinite(v)]
    low, high = max(min(known, default=0.0), LOSS), max(max(known, default=0.0), 2 * LoopSettings.nats)
    if high > _LARGE:
        axes.set_xscale("symlog", linthresh=10.0, linscale=0.7)
        decades = [10.0**k for k in range(1, int(np.ceil(np.log10(high))) + 1)]
        ticks = [*([-10.0] if low < 0 else []), 0.0, *decades[:: 1 + len(decades) // 5]]
        axes.xaxis.set_major_locator(FixedLocator(ticks))
        axes.xaxis.set_minor_locator(NullLocator())
        axes.xaxis.set_major_formatter(FuncFormatter(_tick))
        axes.set_xlim(1.3 * low if low < 0 else 0.0, 1.6 * high)
    else:
        span = high - min(low, 0.0)
        axes.set_xlim(min(low, 0.0) - 0.04 * span * (low < 0), high + 0.08 * span)
    axes.axvline(0.0, color=GREY, linewidth=0.8)
    axes.axvline(LoopSettings.nats, **MARK)


def bar(axes: Axes, row: float, value: float | None, colour: str, *, held: bool = False, height: float = 0.34) -> None:
    """Draw one gain: filled for training, hatched for what was held out, an arrow for what lies beyond the axis."""
    if value is None or np.isnan(value):
        return
    left, right = axes.get_xlim()
    edge = max(LOSS, left)
    shown = float(np.clip(value, edge, right))
    face, hatch = ("white", "//////") if held else (colour, "")
    axes.barh(row, shown, height, facecolor=face, hatch=hatch, edgecolor=colour, linewidth=0.8, zorder=3)
    if value < edge:
        axes.plot(shown, row, "<", color=colour, markersize=5, zorder=4, clip_on=False)


def _tick(value: float, _: int) -> str:
    text = f"{abs(value):g}" if abs(value) < 1e4 else f"$10^{{{round(np.log10(abs(value)))}}}$"
    return f"\N{MINUS SIGN}{text}" if value < 0 else text
