"""The model error before and after, beside the noise and the size that counts as none."""

from __future__ import annotations

import math

from discovery.report.numbers import scale_for, significant
from discovery.report.results import Run
from discovery.report.sentences import verdict_sentence
from discovery.report.style import BLUE, MARK, RED, Picture, label, new_figure, plain_log

_ROWS = {"before": ("declared model", RED), "after": ("final model", BLUE)}
#: The axis reaches beyond its sizes by these factors.
_BELOW, _ABOVE = 0.3, 5.0


def draw(run: Run) -> Picture:
    """Return bars of both sizes on a logarithmic axis."""
    error = run.loop["model_error"]
    noise = min(n for r in run.results["recordings"] if r["role"] == "train" for n in r["noise"])
    sizes = {k: error[k] for k in _ROWS if error[k] is not None and math.isfinite(error[k])}
    scale = scale_for(error["unit"], max([noise, error["least"], *sizes.values()]))
    known = [v * scale.factor for v in (noise, error["least"], *sizes.values()) if v > 0]
    low, high = _BELOW * min(known), _ABOVE * max(known)
    figure = new_figure(2.1)
    axes = figure.subplots()
    axes.set_xscale("log")
    axes.set_xlim(low, high)
    for row, (key, (_, colour)) in enumerate(_ROWS.items()):
        value = sizes[key] * scale.factor if key in sizes else None
        if value:
            axes.barh(row, value - low, 0.5, left=low, color=colour, zorder=3, hatch="" if key == "after" else "////",
                      edgecolor="white", linewidth=0.0)  # fmt: skip
        words = "blows up" if value is None else f"{significant(value)} {scale.symbol}".strip()
        axes.annotate(words, (value or low, row), (5, 0), textcoords="offset points", va="center", fontsize=8.5,
                      bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.0}, zorder=4)  # fmt: skip
    axes.axvspan(low, error["least"] * scale.factor, color="#E8E8E8", zorder=0, label="counts as none")
    axes.axvline(noise * scale.factor, **MARK, label="noise of a reading")
    axes.set_yticks(range(len(_ROWS)), [words for words, _ in _ROWS.values()])
    axes.set_ylim(len(_ROWS) - 0.5, -0.5)
    axes.grid(axis="y", visible=False)
    plain_log(axes.xaxis)
    axes.set_xlabel(label("model error", scale.symbol))
    figure.legend(loc="outside upper left", ncols=2, columnspacing=1.0)
    why = verdict_sentence(run.loop)
    return Picture(
        "model_error",
        figure,
        "The model error before and after, one standard deviation each. In the shaded range it counts as none.",
        f"Bars of the model error of the declared and of the final model; {why}.",
    )
