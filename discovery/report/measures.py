"""Tables of measurements and errors: what was recorded, and how well each model predicts it."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

from discovery.report.estimates import published
from discovery.report.numbers import Scale, scale_for, scale_for_change, significant, uncertain, unit_text
from discovery.report.results import Run
from discovery.report.tables import Table
from discovery.report.words import FITS, deflection_unit, effect_name, error_groups, error_scale

_ROLES = {"train": "training", "holdout": "held out", "test": "only scored"}
_WHEN, _MEASURES = ("before", "after"), ("rms", "mean", "peak")
_SHOWN = (("angle", "mean"), ("radius", "mean"), ("radius", "peak"), ("position", "mean"), ("position", "peak"))


def recordings_table(run: Run) -> Table:
    """Return what was recorded."""
    cells, raw = [], []
    unit = deflection_unit(run)
    keys = ("name", "role", "channels", "samples", "duration_s", "rate_hz", "largest_deflection")
    for r in run.results["recordings"]:
        noise = [scale_for(u, n) for u, n in zip(r["units"], r["noise"], strict=True)]
        shown = dict.fromkeys(f"{s.text(n)} {s.symbol}" for n, s in zip(r["noise"], noise, strict=True))
        reach = scale_for(unit, r["largest_deflection"])
        largest = f"{reach.text(r['largest_deflection'])} {reach.symbol}"
        about = [r["name"], _ROLES[r["role"]], ", ".join(r["channels"]), f"{r['samples']}"]
        pace = [significant(r["duration_s"]), significant(r["rate_hz"], 4), largest]
        cells.append([*about, *pace, ", ".join(shown) + (" (estimated)" if r.get("noise_estimated") else "")])
        raw.append([" ".join(r[k]) if k == "channels" else r[k] for k in keys])
    most = f"largest {'deflection' if run.system.has_rod else run.output_name if run.reads_coordinate else 'motion'}"
    head = ("recording", "used for", "channels", "samples", "duration [s]", "rate [Hz]", most, "noise, sd")
    return Table("recordings", "Recordings.", head, cells, keys, raw, text=(0, 1, 2))


def _side_by_side(
    name: str, caption: str, rows: Sequence[tuple[str, str, Mapping[str, Any]]], scale: Scale, *,
    of: tuple[str, str] = ("recording", "recording"), unit: str = "",
) -> Table:  # fmt: skip
    """Return a table of errors before and after, in rows of a name for the file, one for the page, and the errors."""
    cells = [[shown, *(scale.text((m[w] or {}).get(k)) for w in _WHEN for k in _MEASURES)] for _, shown, m in rows]
    raw = [[key, *(m[w][k] for w in _WHEN for k in _MEASURES), *([unit] if unit else [])] for key, _, m in rows]
    head = (of[0], *(f"{w}, {k} [{scale.symbol}]" for w in _WHEN for k in _MEASURES))
    keys = (of[1], *(f"{w}_{k}" for w in _WHEN for k in _MEASURES), *(["unit"] if unit else []))
    return Table(name, caption, head, cells, keys, raw)


def errors_table(run: Run) -> Table:
    """Return the errors before and after by group of recordings."""
    errors = run.loop["errors"]
    scale = error_scale(errors)
    rows = [(g, name, {w: errors[w][g] for w in _WHEN}) for g, name in error_groups(run).items()]
    floor = scale.quantity(errors["noise_floor"])
    what = (
        "distance between predicted and recorded tip"
        if run.system.has_rod and len(run.results["recordings"][0]["channels"]) == 2
        else "absolute error"
    )
    kind = f"{errors['holdout_kind']}, moving by {significant(errors['holdout_motion'])} times the noise"
    caption = f"Free-run errors: {what}. A perfect model would leave {floor} rms of what is held out: {kind}."
    return _side_by_side("errors", caption, rows, scale, of=("", "group"), unit=errors["unit"])


def also_table(run: Run) -> Table | None:
    """Return the errors of what is read beside the output; None where nothing is."""
    found = run.loop["errors"].get("also")
    if not found:
        return None
    head = ("read beside the output", "readings", "before, rms", "after, rms")
    cells, raw = [], []
    for also in found:
        for group, name in (("train", "training"), ("holdout", "held out")):
            sizes = [also[when][group]["rms"] for when in _WHEN]
            scale = scale_for_change(also["unit"], *sizes)
            cells.append([effect_name(also["name"]), name, *(scale.quantity(size) for size in sizes)])
            raw.append([also["name"], group, *sizes, also["unit"]])
    caption = "Free-run errors of what is read beside the output; they are fitted with it, each by its own noise."
    return Table("also", caption, head, cells, ("name", "group", "before_rms", "after_rms", "unit"), raw)


def scored_table(run: Run) -> Table | None:
    """Return the errors on recordings that neither a fit nor a decision has seen."""
    tested = run.results.get("test")
    if not tested:
        return None
    rows = [(name, effect_name(name), m) for name, m in tested.items()]
    caption = "Free-run errors on recordings that are only scored: neither a fit nor a decision has seen them."
    errors = run.loop["errors"]
    return _side_by_side("scored", caption, rows, error_scale(errors), unit=errors["unit"])


def clean_table(run: Run) -> Table | None:
    """Return distances to the noise-free tip, which only a simulation knows."""
    clean = run.results.get("clean")
    if not clean:
        return None
    first = next(iter(clean.values()))
    before, after = (first[w]["mean"] for w in _WHEN)
    scale = scale_for(run.loop["errors"]["unit"], before if math.isfinite(before) else after)
    caption = "Distance to the noise-free tip, which a simulation knows and no fit saw."
    return _side_by_side("clean", caption, [(name, name, m) for name, m in clean.items()], scale)


def fits_table(run: Run) -> Table | None:
    """Return the errors of the fitted models side by side in training, with the paper's on its own rig."""
    fits: Mapping[str, Any] = run.results.get("fit_errors") or {}
    if not fits or (len(fits) > 1 and len({json.dumps(f, sort_keys=True) for f in fits.values()}) == 1):
        # A model beside itself says nothing.
        return None
    paper = published(run).get("errors", {})
    kinds = [(kind, m) for kind, m in _SHOWN if all(kind in f for f in fits.values())]
    units = {"angle": "rad", "radius": "m", "position": run.loop["errors"]["unit"]}
    scales = {k: scale_for(units[k], min(f[k]["mean"] for f in fits.values())) for k, _ in kinds}
    head, cells = ["model"], []
    for kind, m in kinds:
        what = kind if run.system.has_rod else run.output_name
        head.append(f"{what}, {m} [{scales[kind].symbol}]")
        if any(f"{kind}_{m}" in row for row in paper.values()):
            head.append("paper")
    for label, found in fits.items():
        row = [FITS.get(label, effect_name(label))]
        for kind, m in kinds:
            row.append(scales[kind].text(found[kind][m]))
            if any(f"{kind}_{m}" in other for other in paper.values()):
                row.append(scales[kind].text(paper.get(label, {}).get(f"{kind}_{m}")))
        cells.append(row)
    raw = [[label, *(found[k][m] for k, m in kinds)] for label, found in fits.items()]
    caption = "Errors of the fitted models on the training recordings" + (
        ", beside those that the source paper prints for its own arm and manoeuvre." if paper else "."
    )
    return Table("fits", caption, tuple(head), cells, ("model", *(f"{k}_{m}" for k, m in kinds)), raw)


def notes(run: Run) -> list[tuple[str, str]]:
    """Return what is unusual about the recordings, each with the name of its recording."""
    return [(r["name"], note) for r in run.results["recordings"] for note in r.get("notes", ())]


def quantities(run: Run) -> list[tuple[str, str]]:
    """Return what the experimenter stated of the rig, as words and printed values."""
    found = []
    for name, q in run.results["rig"].get("quantities", {}).items():
        scale = scale_for(q["unit"], q["value"]) if name.endswith("noise") else Scale(1.0, unit_text(q["unit"]))
        value, sd = q["value"] * scale.factor, q.get("sd")
        printed = uncertain(value, sd * scale.factor) if sd else significant(value)
        found.append((effect_name(name), f"{printed} {scale.symbol}"))
    return found
