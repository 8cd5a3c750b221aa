"""What was searched: terms of the regression, candidates of the catalogue, odds of the added, the model error left."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

from discovery.report.numbers import scale_for, significant
from discovery.report.results import Run
from discovery.report.sentences import chances, verdict_sentence
from discovery.report.story import Search, blows_up, fate, named, searches
from discovery.report.style import BLUE, GREY, MARK, ORANGE, RED, SKY, Picture, label, new_figure, plain_log
from discovery.report.words import effect_name, listed, prose
from discovery.selection.settings import LoopSettings

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_TERMS = 12


def draw_inclusion(run: Run) -> Picture | None:
    """Return the probabilities of all terms that some resample chose, and how many were never chosen."""
    inclusion = (run.results.get("discovery") or {}).get("inclusion", {})
    chosen = sorted(((p, n) for n, p in inclusion.items() if p > 0), reverse=True)[:_TERMS]
    if not chosen:
        return None
    terms = {t["term"] for t in run.results["discovery"]["terms"]}
    figure = new_figure(0.27 * len(chosen) + 0.75)
    axes = figure.subplots()
    rows = np.arange(len(chosen))
    colours = [BLUE if n in terms else "#B8D4E8" for _, n in chosen]
    axes.barh(rows, [p for p, _ in chosen], height=0.65, color=colours)
    axes.set_yticks(rows, [prose(n).replace("θ̇ₜ", "θₜ'").replace("̇", "'") for _, n in chosen])
    axes.invert_yaxis()
    axes.set_xlim(0, 1)
    axes.grid(axis="y", visible=False)
    axes.set_xlabel("inclusion probability [–]")
    never = len(inclusion) - sum(p > 0 for p in inclusion.values())
    caption = (
        "How often each term was part of the equation, over resamples of whole stretches; dark: in the reported "
        "equation. "
        f"{never} other terms of the library were never chosen."
    )
    alt = "Bars of inclusion probability: " + ", ".join(f"{n} {p:.2f}" for p, n in chosen) + "."
    return Picture("inclusion", figure, caption, alt)


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
        # Where the second decade is cut, a tick within it says how far the bars reach.
        between = [3 * d for d in decades if 3 * d < 1.5 * high] if len(decades) <= 2 else []
        ticks = [*([-10.0] if low < 0 else []), 0.0, *decades[:: 1 + len(decades) // 5], *between]
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


#: Candidates and searches that are drawn; the table has all.
_MOST, _SEARCHES = 10, 4
#: Colours of what became of a candidate, and the words for them.
_KINDS = {
    "added": (BLUE, "added"),
    "tied": (SKY, "as likely"),
    "refused": (RED, "tried in vain"),
    "other": ("#9A9A9A", "less likely"),
}


def draw_ranking(run: Run) -> list[Picture]:
    """Return the candidates of every search through the catalogue."""
    return [_ranking(run, search, i) for i, search in enumerate(searches(run)[:_SEARCHES], 1)]


def _ranking(run: Run, search: Search, position: int) -> Picture:
    shown = search.candidates[:_MOST]
    figure = new_figure(0.42 * len(shown) + 1.45)
    axes = figure.subplots()
    gains = [c[k] for c in shown if not blows_up(c) for k in ("train", "held")]
    nats_axis(axes, gains)
    labels, seen = [], []
    for row, c in enumerate(shown):
        kind, outcome = search.kind(c["effects"]), search.outcome(c["effects"])
        if search.taken and kind != "added" and fate(run, search.taken) and named(run, c["effects"]):
            outcome = "in the final model"
        colour = _KINDS[kind][0]
        seen.append(kind)
        if not blows_up(c):
            bar(axes, row - 0.18, c["train"], colour)
            bar(axes, row + 0.18, c["held"], colour, held=True)
        name = " +\n".join(map(effect_name, c["effects"]))
        labels.append(f"{name}\n({outcome})" if outcome else name)
    axes.set_yticks(range(len(shown)), labels)
    axes.set_ylim(len(shown) - 0.45, -0.55)
    axes.grid(axis="y", visible=False)
    # Long names leave less room than the words ask for: they reach to the left under these.
    axes.set_xlabel("log evidence gained [nats]", loc="right")
    _legend(figure, seen)
    beyond = any(v < LOSS for v in gains)
    return _picture(search, position, figure, len(shown), end=fate(run, search.taken), beyond=beyond)


def _legend(figure: Figure, seen: list[str]) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles: list[Patch | Line2D] = [
        Patch(facecolor="#666666", edgecolor="#666666", label="training"),
        Patch(facecolor="white", edgecolor="#666666", hatch="//////", label="held out"),
        Line2D([], [], **MARK, label="odds of 20 to 1"),
    ]
    handles += [Patch(facecolor=colour, label=words) for kind, (colour, words) in _KINDS.items() if kind in seen]
    figure.legend(handles=handles, loc="outside upper left", ncols=3, columnspacing=1.0, handlelength=1.6)


def _picture(search: Search, position: int, figure: Figure, count: int, *, end: str, beyond: bool) -> Picture:
    beside = f" beside {listed(map(effect_name, search.beside))}" if search.beside else ""
    taken = f"{listed(map(effect_name, search.taken))}{end}" if search.taken else "nothing"
    who = f"the {count} most likely candidates gain" if count > 1 else "the only candidate gains"
    notes = " Beyond 10 nats the axis is logarithmic." if figure.axes[0].get_xscale() == "symlog" else ""
    notes += " Arrows: losses beyond the axis." if beyond else ""
    best = listed(map(effect_name, search.candidates[0]["effects"]))
    return Picture(
        f"ranking_{position}",
        figure,
        f"Search {position}{beside}: log evidence that {who}, once everything is refitted.{notes} Added: {taken}.",
        f"Bars of the log evidence that each candidate gains, in training and held out; {best} is the most likely. "
        f"Added: {taken}.",
    )


def draw_odds(run: Run) -> Picture | None:
    """Return the log odds of every effect that was added from the catalogue; None where there is none."""
    from matplotlib.patches import Patch

    shown = [e for e in run.loop["effects"] if e["evidence"]]
    if not shown:
        return None
    figure = new_figure(0.62 * len(shown) + 1.4)
    axes = figure.subplots()
    nats_axis(axes, (v for e in shown for v in _parts(e["evidence"])))
    for row, e in enumerate(shown):
        train, held, against = _parts(e["evidence"])
        bar(axes, row - 0.25, train, BLUE, height=0.23)
        bar(axes, row, held, BLUE, held=True, height=0.23)
        bar(axes, row + 0.25, against, ORANGE, height=0.23)
    axes.set_yticks(range(len(shown)), [effect_name(e["id"]).replace(" ", "\n", 1) for e in shown])
    axes.set_ylim(len(shown) - 0.5, -0.5)
    axes.grid(axis="y", visible=False)
    axes.set_xlabel("log odds [nats]", loc="right")
    handles = [
        Patch(facecolor=BLUE, edgecolor=BLUE, label="training"),
        Patch(facecolor="white", edgecolor=BLUE, hatch="//////", label="with held out"),
        Patch(facecolor=ORANGE, edgecolor=ORANGE, label="against model error"),
    ]
    figure.legend(handles=handles, loc="outside upper left", ncols=3, columnspacing=1.0, handlelength=1.6)
    words = listed(f"{effect_name(e['id'])} has {chances(e['evidence']['odds'])}" for e in shown)
    caption = (
        "Three log odds of each added effect: the smallest decides, and must pass the dashed line at 20 to 1. "
        f"{words.capitalize()}."
    )
    return Picture("odds", figure, caption, f"Bars of three log odds for each added effect. {words}.")


def _parts(evidence: dict[str, Any]) -> tuple[float | None, float | None, float | None]:
    """Return the log odds in training, with the held-out recordings, and against being model error."""
    train, held = evidence["train"], evidence["held"]
    both = None if train is None or held is None else train + held
    return train, both, evidence["against_error"]


_ROWS = {"before": ("declared model", RED), "after": ("final model", BLUE)}
#: The axis reaches beyond its sizes by these factors.
_BELOW, _ABOVE = 0.3, 5.0


def draw_model_error(run: Run) -> Picture:
    """Return bars of both sizes on a logarithmic axis."""
    error = run.loop["model_error"]
    noise = min(n for r in run.results["recordings"] if r["role"] == "train" for n in r["noise"])
    sizes = {k: error[k] for k in _ROWS if error[k] is not None and math.isfinite(error[k])}
    scale = scale_for(error["unit"], max([noise, error["least"], *sizes.values()]))
    known = [v * scale.factor for v in (noise, error["least"], *sizes.values()) if v > 0]
    low, high = _BELOW * min(known), _ABOVE * max(known)
    figure = new_figure(2.1)
    axes = figure.subplots()
    axes.set(xscale="log", xlim=(low, high))
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
    caption = "The model error before and after, one standard deviation each. In the shaded range it counts as none."
    alt = f"Bars of the model error of the declared and of the final model; {why}."
    return Picture("model_error", figure, caption, alt)
