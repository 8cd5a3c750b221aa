"""The page: one self-contained HTML file made of a run's result files, and what the reader's browser gets."""

from __future__ import annotations

import base64
import hashlib
import json
import os
import re
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from markupsafe import Markup

from discovery.foundation.arguments import as_path
from discovery.foundation.arrays import FloatArray
from discovery.foundation.io import atomic_write
from discovery.report import (
    ambiguity,
    answer,
    doubt_sentences,
    equations,
    estimates,
    evidence,
    latent,
    measures,
    model_error_words,
    noise,
    numbers,
    posterior,
    references,
    sentences,
    story,
    words,
)
from discovery.report.figures import draw_all, motion
from discovery.report.figures.motion import channel_name, shown_scale
from discovery.report.mathml import block, broken
from discovery.report.numbers import scale_for
from discovery.report.results import Run, Trajectory, read_run
from discovery.report.style import Picture, render, styled

if TYPE_CHECKING:
    from jinja2 import Environment

#: What the templates ask for words and numbers, by name; every function ``*_table`` there is a table of the page.
_ASKED = {
    room.__name__.rpartition(".")[2]: room
    for room in (
        measures, evidence, noise, posterior, estimates, latent, ambiguity, references,
        answer, equations, numbers, sentences, doubt_sentences, model_error_words, story, words,
    )
}  # fmt: skip
#: Letters of the name of a figure's file.
_LONGEST = 100


def build_report(run_dir: str | os.PathLike[str]) -> Path:
    """Write ``report.html``, ``figures/`` and ``tables/`` of a finished run.

    Everything on the page is read from the result files; nothing is fitted or simulated here. Each file is written
    beside its place and then renamed, the page last.

    Parameters
    ----------
    run_dir : path
        Folder with ``results.json`` and the netCDF files of a run.

    Returns
    -------
    Path
        The page, one file that needs no other.

    Raises
    ------
    InputError
        If the folder does not hold the results of a run.

    Examples
    --------
    >>> data = load_dataset("datasets/spring_bench/rig.toml")
    >>> content = run(data, "out", with_posterior=False)
    >>> build_report("out").name
    'report.html'
    """
    run = read_run(as_path(run_dir, "run_dir", "Give the folder of a finished run."))
    if run.loop.get("failure"):
        with styled():
            drawn = motion.draw_motion(run)
            shown = {"data": [] if drawn is None else [embed(run.folder, drawn)]}
        return _page(run, "failed.html.j2", figures=shown, chart=None)
    makers = [make for room in _ASKED.values() for name, make in vars(room).items() if name.endswith("_table")]
    tables = [table for make in makers if (table := make(run)) is not None]
    figures: dict[str, list[dict[str, Any]]] = {}
    with styled():
        for section, pictures in draw_all(run).items():
            figures[section] = [embed(run.folder, picture) for picture in pictures]
    for table in tables:
        written(run.folder / "tables" / f"{table.name}.csv", table.csv())
    shown = {table.name: table.html() for table in tables}
    return _page(
        run,
        "page.html.j2",
        tables=shown,
        figures=figures,
        chart=chart_data(run),
        chart_sheet=Markup(_asset("uPlot.min.css")),
    )


def _page(run: Run, template: str, **content: Any) -> Path:
    """Write a page, whose template asks the modules of this room for its words."""
    chart = content["chart"] is not None
    fields = {**_ASKED, **content, "run": run, "policy": policy(chart=chart), "scripts": scripts(chart=chart)}
    html = environment().get_template(template).render(fields)
    # The odds that are told stand in one line.
    return written(run.folder / "report.html", html.replace("10 000", "10\N{NO-BREAK SPACE}000"))


def written(path: Path, text: str) -> Path:
    """Write a file beside its place first, and return it."""
    with atomic_write(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return path


def embed(folder: Path, picture: Picture) -> dict[str, Any]:
    """Write a figure's own file, and return it as the page embeds it."""
    suffix, content = render(picture)
    # It may name a recording, whose name is no path.
    stem = re.sub(r"[^\w.+-]", "_", picture.name)[:_LONGEST]
    with atomic_write(folder / "figures" / f"{stem}{suffix}") as temporary:
        temporary.write_bytes(content)
    kind = "image/png" if picture.raster else "image/svg+xml"
    source = f"data:{kind};base64,{base64.b64encode(content).decode('ascii')}"
    width, height = (round(96 * inches) for inches in picture.figure.get_size_inches())
    told = {key: getattr(picture, key) for key in ("name", "caption", "alt", "wide")}
    return {**told, "source": source, "width": width, "height": height}


def environment(*packages: str) -> Environment:
    """Return the templates of the report, and of other packages beside them, with their filters."""
    from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined

    made = Environment(
        loader=ChoiceLoader([PackageLoader(package) for package in (*packages, "discovery.report")]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    made.filters |= {"prose": words.page_prose, "sentence": words.sentence, "clause": words.clause}
    made.filters |= {"formula": block, "broken": broken}
    return made


#: Samples of a recording that a chart holds.
_MOST = 12_000
#: Change between two shown samples over the spread of the signal: twenty samples a period keep its shape.
_SMOOTH = 0.3
#: Recordings of a chart.
_RECORDINGS = 6
#: The integer that stands for a gap, and the largest one that stands for a value.
_GAP, _LARGEST = -32768, 32767
#: Files of `assets` in the order in which they run: the plotting library (MIT licence beside it), and the page's own.
_SCRIPTS = ("uPlot.iife.min.js", "page.js", "chart.js")


def chart_data(run: Run) -> Markup | None:
    """Return the recordings with what each model leaves of them, as JSON that can stand in a script element.

    A list with an entry a recording, the held-out ones first: `name`, `role`, `time` and `channels`. A channel has
    `measured`, and `left`, by model the model minus the measurement. None where no trajectory is stored.
    """
    held = [t.name for t in run.held_out]
    ordered = sorted(run.trajectories, key=lambda t: t.name not in held)
    entries = [_entry(run, t.thinned()) for t in ordered[:_RECORDINGS] if np.isfinite(t.measured).any()]
    if not entries:
        return None
    # Names come from files: nothing in them ends the script element.
    text = json.dumps(entries, ensure_ascii=True, separators=(",", ":"))
    return Markup(text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026"))


def _entry(run: Run, trajectory: Trajectory) -> dict[str, Any]:
    every = _every(trajectory.measured)
    role = {"train": "fitted", "holdout": "held out"}.get(trajectory.role, trajectory.role)
    if trajectory.role == "train" and not trajectory.fitted.all():
        role = "first part fitted"
    if -(-trajectory.time.size // every) > _MOST:
        role = f"{role}, first {trajectory.time[_MOST * every] - trajectory.time[0]:.3g} s"
    noise = next(r["noise"] for r in run.results["recordings"] if r["name"] == trajectory.name)
    return {
        "name": trajectory.name,
        "role": role,
        "time": _time(trajectory.time[::every][:_MOST]),
        "channels": [_channel(run, trajectory, c, noise[c], every) for c in range(len(trajectory.channels))],
    }


def _every(measured: FloatArray) -> int:
    """Return which samples are shown, every one, every second ...: as few as are held, but enough to keep the shape."""
    spread = np.nanstd(measured, axis=0)
    every = 1
    while measured.shape[0] > every * _MOST:
        change = measured[every + 1 :] - measured[: -every - 1]
        # Where readings were left out, no two may be so far apart.
        told = np.isfinite(change).any(axis=0).all()
        if not told or not np.all(np.sqrt(np.nanmean(change**2, axis=0)) <= _SMOOTH * spread):
            break
        every += 1
    return every


def _channel(run: Run, trajectory: Trajectory, c: int, noise: float, every: int) -> dict[str, Any]:
    measured, unit = trajectory.measured[::every, c][:_MOST], trajectory.units[c]
    shown = shown_scale(trajectory, c, run.coordinate_unit)
    left = {
        m: trajectory.models[m][::every, c][:_MOST] - measured for m in ("before", "after") if m in trajectory.models
    }
    largest = [float(np.nanmax(np.abs(v))) for v in left.values() if np.isfinite(v).any()]
    scale = scale_for(unit, min(largest, default=1.0))
    return {
        "name": channel_name(run, trajectory.channels[c]),
        "unit": shown.symbol,
        "factor": scale.factor / shown.factor,
        "small": scale.symbol,
        "noise": noise * shown.factor,
        "measured": _packed(measured * shown.factor),
        "left": {model: _packed(values * shown.factor) for model, values in left.items()},
    }


def _time(time: FloatArray) -> dict[str, Any]:
    """Return evenly spaced time by its start and step, else every value."""
    step = (time[-1] - time[0]) / max(1, time.size - 1)
    even = time[0] + step * np.arange(time.size)
    if np.abs(even - time).max() < 0.01 * step:
        return {"start": float(f"{time[0]:.9g}"), "step": float(f"{step:.9g}"), "n": int(time.size)}
    return {"values": [float(f"{t:.7g}") for t in time], "n": int(time.size)}


def _packed(values: FloatArray) -> dict[str, Any]:
    """Return values as 16-bit integers, each a 65 000th of the range: far below what an instrument reads."""
    good = values[np.isfinite(values)]
    low, high = (float(good.min()), float(good.max())) if good.size else (0.0, 0.0)
    step = (high - low) / (2 * _LARGEST) or 1.0
    whole = np.where(np.isfinite(values), np.rint((np.nan_to_num(values) - low) / step) - _LARGEST, _GAP)
    data = base64.b64encode(whole.astype("<i2").tobytes()).decode("ascii")
    return {"low": low, "step": step, "data": data}


@cache
def _asset(name: str) -> str:
    return (files("discovery.report") / "assets" / name).read_text(encoding="utf-8")


def scripts(*, chart: bool) -> list[Markup]:
    """Return the text of every script of a page; those of the live chart only where there is one."""
    return [Markup(_asset(name)) for name in _SCRIPTS if chart or name == "page.js"]


def policy(*, chart: bool) -> str:
    """Return the content-security policy: no request at all, and only scripts with these hashes."""
    hashes = " ".join(
        f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode('ascii')}'"
        for text in scripts(chart=chart)
    )
    return (
        f"default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src {hashes}; "
        "base-uri 'none'; form-action 'none'"
    )
