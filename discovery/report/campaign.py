"""The page of a campaign: a matrix of verdicts, parameters over the cases, the worst residuals, and what is pooled."""

from __future__ import annotations

import math
import os
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
from markupsafe import Markup, escape

from discovery.report.numbers import interval, scale_for, significant, unit_text
from discovery.report.page import embed, environment, written
from discovery.report.style import BLUE, GREY, ORANGE, Picture, new_figure, quantity_label, styled, verbatim
from discovery.report.tables import Table, name_cell
from discovery.report.words import effect_name, listed, sentence

#: Name of the page.
PAGE = "campaign.html"
#: Cases in the table of the worst ones, and beyond which the matrix of all is folded.
_WORST, _MANY = 10, 40
#: A failed case says of its error as much.
_SAID = 200


def build_campaign(
    folder: Path, rows: Sequence[Mapping[str, Any]], pooled: Sequence[Mapping[str, Any]], dashboard: str = ""
) -> Path:
    """Write ``campaign.html``, one file, and ``tables/`` of a campaign, and return the path of the page.

    Rows and pooled parameters are those of `discovery.runs.campaign`. Cases with a page ``CASE/report.html`` are linked
    to it, and so is the dashboard of a cluster where its address is of the web.
    """
    tables = [_matrix(folder, rows), _worst(folder, rows), *([_pooled(pooled)] if pooled else [])]
    for table in tables:
        written(folder / "tables" / f"{table.name}.csv", table.csv())
    with styled():
        figures = [embed(folder, _specimen(i, parameter)) for i, parameter in enumerate(pooled[:_PARAMETERS])]
    context = {
        "answer": _answer(rows),
        "many": len(rows) > _MANY,
        "dashboard": dashboard if dashboard.startswith(("http://", "https://")) else "",
        "tables": {table.name: table.html() for table in tables},
        "figures": {"specimens": figures},
        "failed": [(row["name"], row["error"][:_SAID]) for row in rows if row["error"]],
    }
    return written(folder / PAGE, environment().get_template("campaign.html.j2").render(context))


def _answer(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return what the page says in two sentences."""
    verdicts = Counter(effect_name(row["verdict"]) for row in rows if not row["error"])
    failed = sum(bool(row["error"]) for row in rows)
    counts = [f"{count} {verdict}" for verdict, count in verdicts.most_common()]
    counts += [f"{failed} failed"] if failed else []
    effects = Counter(effect for row in rows for effect in _effects(row))
    added = [f"{effect_name(effect)} ({count})" for effect, count in effects.most_common(5)]
    said = f" Added most often: {listed(added)}." if added else " Nothing was added to any."
    return f"Of {len(rows)} {'case' if len(rows) == 1 else 'cases'}: {listed(counts)}.{said}"


def _effects(row: Mapping[str, Any]) -> list[str]:
    return [effect for effect in (row.get("effects") or "").split(", ") if effect]


def _case(folder: Path, name: str) -> Markup:
    """Return the name of a case, with a link where it has a page."""
    if os.path.exists(folder / name / "report.html"):
        return Markup('<a href="{}">{}</a>').format(f"{quote(name)}/report.html", name)
    return escape(name)


def _matrix(folder: Path, rows: Sequence[Mapping[str, Any]]) -> Table:
    """Return verdicts and added effects, case by case."""
    counts = Counter(effect for row in rows for effect in _effects(row))
    effects = [effect for effect, _ in counts.most_common()]
    cells, raw = [], []
    for row in rows:
        added = _effects(row)
        verdict = "failed" if row["error"] else effect_name(row["verdict"])
        cells.append([_case(folder, row["name"]), verdict, *("●" if effect in added else "" for effect in effects)])
        raw.append([row["name"], row.get("verdict"), *(int(effect in added) for effect in effects)])
    caption = "Verdict of each case, and what was added to its declared model (●)."
    head = ("case", "verdict", *map(effect_name, effects))
    keys = ("case", "verdict", *effects)
    return Table("matrix", caption, head, cells, keys, raw, text=(0, 1))


def _left(row: Mapping[str, Any]) -> float:
    """Return how many times the noise the held-out error of a case is, the training error where nothing is held out."""
    error, floor = _error(row, "after"), row.get("noise_floor")
    return error / floor if error is not None and floor else -math.inf


def _error(row: Mapping[str, Any], when: str) -> float | None:
    held = row.get(f"holdout_rms_{when}")
    return row.get(f"train_rms_{when}") if held is None else held


def _worst(folder: Path, rows: Sequence[Mapping[str, Any]]) -> Table:
    """Return the cases whose final models leave most."""
    cells, raw = [], []
    for row in sorted((row for row in rows if _left(row) > 0), key=_left, reverse=True)[:_WORST]:
        before, after = _error(row, "before"), _error(row, "after")
        scale = scale_for(row["unit"], after or 0.0)
        shown = [scale.text(x) for x in (before, after, row["noise_floor"])]
        because = sentence(row.get("because") or "")
        cells.append([_case(folder, row["name"]), *shown, scale.symbol, significant(_left(row)), because])
        raw.append([row["name"], before, after, row["noise_floor"], row["unit"], _left(row), row.get("because")])
    caption = (
        "The cases whose final models leave most, over what a perfect model would leave: free-run rms errors, held out "
        "where something is."
    )
    head = ("case", "before", "after", "floor", "unit", "after / floor", "verdict because")
    keys = ("case", "before", "after", "noise_floor", "unit", "after_over_floor", "because")
    return Table("worst", caption, head, cells, keys, raw, text=(0, 4, 6))


def _pooled(pooled: Sequence[Mapping[str, Any]]) -> Table:
    """Return the parameters over all cases that have them."""
    cells, raw = [], []
    parts = ("mean", "spread", "following")
    for p in pooled:
        ends = [interval(p[part]["low"], p[part]["high"]) for part in parts]
        shares = [case["shrinkage"] for case in p["cases"]]
        shrunk = f"{100 * min(shares):.0f} to {100 * max(shares):.0f} %"
        about = [name_cell(p["parameter"]), effect_name(p["effect"]) if p["effect"] else "declared", p["kind"]]
        cells.append([*about, str(len(shares)), *ends, shrunk, unit_text(p["unit"])])
        numbers = [p[part][end] for part in parts for end in ("low", "median", "high")]
        raw.append([p["parameter"], p["effect"], p["kind"], len(shares), *numbers, p["unit"]])
    caption = (
        "Parameters that at least three cases have, pooled: intervals of 95 % of the mean of all specimens, of the "
        "standard deviation between them, and of the value of the next one. Shrinkage: by which part of its distance "
        "from the mean an estimate is moved towards it."
    )
    head = ("parameter", "of", "kind", "cases", "mean", "spread", "next specimen", "shrinkage", "unit")
    columns = (f"{part}_{end}" for part in parts for end in ("low", "median", "high"))
    keys = ("parameter", "effect", "kind", "cases", *columns, "unit")
    return Table("pooled", caption, head, cells, keys, raw, text=(0, 1, 2, 8))


#: Parameters that are drawn, cases up to which each is named on the axis, and letters of a name there.
_PARAMETERS, _NAMED, _LETTERS = 12, 25, 14
#: Standard deviations of an interval of 95 %.
_WIDE = 1.96


def _short(name: str) -> str:
    """Return a name for an axis."""
    return name if len(name) <= _LETTERS else f"{name[: _LETTERS - 1]}…"


def _specimen(number: int, parameter: Mapping[str, Any]) -> Picture:
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
    caption = (
        "Estimates with 95 % intervals, each alone and with the others’ help; grey: the mean of all specimens, and "
        "where the next one will be."
    )
    alt = f"{parameter['parameter']} over {len(cases)} cases with intervals, alone and pooled."
    return Picture(f"specimens_{number}_{parameter['parameter']}", figure, caption, alt, raster=len(cases) > 200)
