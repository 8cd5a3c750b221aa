"""The look of the figures: a palette and line style a model, sizes that stay legible, files as light as they can be."""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np

from discovery.foundation.arrays import FloatArray
from discovery.report.numbers import GREEK

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

# Okabe and Ito's palette, which colour-blind readers can tell apart.
BLUE, ORANGE, GREEN, RED = "#0072B2", "#E69F00", "#009E73", "#D55E00"
PURPLE, SKY, GREY = "#CC79A7", "#56B4E9", "#4D4D4D"
#: A limit, a level or a size beside what is drawn.
MARK: dict[str, Any] = {"color": GREY, "linestyle": (0, (5, 2)), "linewidth": 1.0}
#: Dashes of lines that lie on others.
DASHED, DOTTED = (0, (4, 1.6)), (0, (1, 1.2))
#: Every model looks the same in every figure: colour, dashes and width all differ.
LINES: dict[str, dict[str, Any]] = {
    "measured": {"color": "black", "linestyle": "none", "marker": ".", "markersize": 2.5, "label": "measured"},
    "linear": {"color": ORANGE, "linestyle": DOTTED, "linewidth": 1.3, "label": "linear model"},
    "before": {"color": RED, "linestyle": DASHED, "linewidth": 1.2, "label": "before: declared model"},
    "after": {"color": BLUE, "linestyle": "-", "linewidth": 1.0, "label": "after: final model"},
}
#: Measured points that a panel shows.
_DOTS = 90
#: Measured points beyond which a panel shows a line: chosen samples would draw a motion that is not there.
_DENSE = 4000
#: Width of a figure [inches]. A phone shows it at three quarters of its size, a wide screen at five quarters.
WIDTH = 4.6
#: A picture of points is shown at 118 dots per inch at most; a denser screen gains a little.
_DOTS_PER_INCH = 150
#: Ticks of a decade, coarse to fine, and how many there are at least.
_LOG_STEPS = ((1.0,), (1.0, 2.0, 5.0), (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 7.0))
_FEWEST_TICKS = 3
#: Characters of an axis label beyond which it takes another line.
_LABEL = 16
_STYLE: Any = {
    "axes.edgecolor": GREY,
    "axes.formatter.useoffset": False,
    "axes.grid": True,
    "axes.labelsize": 9,
    "axes.linewidth": 0.7,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlelocation": "left",
    "axes.titlesize": 9,
    "figure.dpi": 100,
    "font.family": "DejaVu Sans",
    "font.size": 9,
    "grid.color": "#DDDDDD",
    "grid.linewidth": 0.6,
    "legend.fontsize": 8.5,
    "legend.frameon": False,
    "savefig.facecolor": "white",
    "svg.fonttype": "none",
    "svg.hashsalt": "discovery",
    "xtick.labelsize": 8.5,
    "ytick.labelsize": 8.5,
    "xtick.color": GREY,
    "ytick.color": GREY,
}
#: Colours of a picture of lines and text, their blends with the paper included.
_COLOURS = 40
_PATH = re.compile(r' d="([^"]+)"')
_STEP = re.compile(r"([MLQCz])([^MLQCz]*)")
#: Units of a path in a point: a tenth of a point is finer than a line is wide.
_GRAIN = 10
_PLACE = re.compile(r'( [xy]="-?\d+\.\d)\d+"')
#: Letters of a path that is a curve, not a marker or a frame.
_CURVE = 120


@dataclass(frozen=True)
class Picture:
    """A figure with the stem of its file and the words that go with it; `alt` is for those who cannot see it.

    It is `wide` where it needs the full width of the page, and stored as PNG (`raster`) where it would be heavy as SVG.
    """

    name: str
    figure: Figure
    caption: str
    alt: str
    wide: bool = False
    raster: bool = False


@contextmanager
def styled() -> Iterator[None]:
    """Draw with the look of the report inside this block, and with the user's outside."""
    import matplotlib as mpl

    with mpl.rc_context(_STYLE):
        yield


def new_figure(height: float, width: float = WIDTH, layout: Any = "constrained") -> Figure:
    """Return an empty figure [inches] that belongs to no window and no global state."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout=layout)


def verbatim(text: str) -> str:
    """Return a user's text for a figure: what stands between two dollar signs would be read as mathematics."""
    return text.replace("$", r"\$")


def render(picture: Picture) -> tuple[str, bytes]:
    """Return the file suffix and the content of a picture; the same picture gives the same bytes."""
    buffer = io.BytesIO()
    if picture.raster:
        picture.figure.savefig(buffer, format="png", dpi=_DOTS_PER_INCH, metadata={"Software": None})
        return ".png", slim_png(buffer.getvalue())
    picture.figure.savefig(buffer, format="svg", dpi=200, metadata={"Date": None, "Creator": None})
    return ".svg", slim_svg(buffer.getvalue().decode("utf-8")).encode("utf-8")


def decimate(time: FloatArray, values: FloatArray, limit: int = 1400) -> tuple[FloatArray, FloatArray]:
    """Return a curve (n,) of at most about `limit` points that keeps the extremes of every stretch; NaN marks gaps."""
    n = time.size
    if n <= limit:
        return time, values
    edges = np.linspace(0, n, limit // 2 + 1).astype(int)
    keep = []
    for start, stop in pairwise(edges):
        part = values[start:stop]
        good = np.flatnonzero(np.isfinite(part))
        if good.size:
            keep += sorted({start + good[np.argmin(part[good])], start + good[np.argmax(part[good])]})
        else:
            keep.append(start)
    index = np.array(keep)
    return time[index], values[index]


def series(axes: Axes, model: str, time: FloatArray, values: FloatArray, **changes: Any) -> None:
    """Draw one curve in the model's own look; of many measured points, some evenly chosen ones, so that lines show."""
    look = {**LINES[model], **changes}
    if look["linestyle"] == "none":
        if time.size > _DENSE:
            axes.plot(*decimate(time, values), **{**look, "linestyle": "-", "marker": None, "linewidth": 0.8})
            return
        every = max(1, time.size // _DOTS)
        axes.plot(time[::every], values[::every], **look)
    else:
        axes.plot(*decimate(time, values), **look)


def plain_log(axis: Axis) -> None:
    """Label a logarithmic axis with plain numbers, more of them where it spans little."""
    from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter

    low, high = axis.get_view_interval()
    locators = [LogLocator(subs=steps) for steps in _LOG_STEPS[int(high < 40 * low) :]]
    counts = [sum(low <= tick <= high for tick in locator.tick_values(low, high)) for locator in locators]
    enough = (locator for locator, count in zip(locators, counts, strict=True) if count >= _FEWEST_TICKS)
    axis.set_major_locator(next(enough, MaxNLocator(4)))
    axis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}" if 1e-4 < x < 1e5 else f"{x:.0e}"))
    axis.set_minor_formatter(NullFormatter())


def label(quantity: str, unit: str) -> str:
    """Return an axis label with its unit."""
    return f"{quantity} [{unit}]" if unit else quantity


def side_label(quantity: str, unit: str) -> str:
    """Return the label of the vertical axis of a low panel, in lines that it can hold."""
    return fill(label(quantity, unit), _LABEL, break_long_words=False)


def quantity_label(name: str, unit: str = "") -> str:
    r"""Return an axis label of a sampled quantity such as ``tau_v`` or ``sigma[tip_angle]``, with its unit.

    >>> quantity_label("f_c_track", "N"), quantity_label("sigma[tip_angle]")
    ('f$_{\\mathrm{c\\ track}}$ [N]', 'σ tip angle')
    """
    symbol, _, part = name.partition("[")
    head, _, tail = symbol.partition("_")
    below = GREEK.get(tail, tail).replace("_", r"\ ")
    text = GREEK.get(head, head) + (f"$_{{\\mathrm{{{below}}}}}$" if tail else "")
    return label(f"{text} {part.rstrip(']').replace('_', ' ')}".strip(), unit)


def slim_svg(text: str) -> str:
    """Return a drawing of matplotlib with its curves as steps in tenths of a point; small shapes, as markers, stay."""
    drawn = _PATH.sub(lambda m: f' d="{_steps(m[1])}"' if len(m[1]) > _CURVE else m[0], text)
    return _PLACE.sub(r'\1"', drawn)


def slim_png(content: bytes) -> bytes:
    """Return a picture of lines and text with a palette, which a plot needs no more than."""
    from PIL import Image

    picture = Image.open(io.BytesIO(content)).convert("RGB")
    small = picture.quantize(_COLOURS, method=Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
    buffer = io.BytesIO()
    small.save(buffer, format="PNG", optimize=True)
    return buffer.getvalue()


def _steps(path: str) -> str:
    """Return a path of lines with each point as its distance from the last one; other paths unchanged."""
    at = (0, 0)
    written = []
    for command, numbers in _STEP.findall(path):
        if command in "QC":
            return path
        if command == "z":
            written.append("z")
            continue
        x, y = (round(_GRAIN * float(v)) for v in numbers.split())
        if command == "M":
            written.append(f"M{_plain(x)} {_plain(y)}")
        elif (x, y) != at:
            written.append(f"l{_plain(x - at[0])} {_plain(y - at[1])}")
        at = (x, y)
    return "".join(written)


def _plain(tenths: int) -> str:
    return f"{tenths / _GRAIN:.1f}".removesuffix(".0")
