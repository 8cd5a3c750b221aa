"""The page: one self-contained HTML file made of a run's result files."""

from __future__ import annotations

import base64
import os
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

from discovery.foundation.arguments import as_path
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
    noise,
    numbers,
    posterior,
    references,
    sentences,
    story,
    words,
)
from discovery.report.charts import chart_data, policy, scripts, sheet
from discovery.report.figures import draw_all, motion
from discovery.report.mathml import latex
from discovery.report.results import Run, read_run
from discovery.report.style import Picture, render, styled

if TYPE_CHECKING:
    from jinja2 import Environment

#: What the templates ask for words and numbers, by name; every function ``*_table`` there is a table of the page.
_ASKED = {
    room.__name__.rpartition(".")[2]: room
    for room in (
        measures, evidence, noise, posterior, estimates, latent, ambiguity, references,
        answer, equations, numbers, sentences, doubt_sentences, story, words,
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
    return _page(run, "page.html.j2", tables=shown, figures=figures, chart=chart_data(run), chart_sheet=sheet())


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
    width, height = (round(96 * inches) for inches in picture.figure.get_size_inches())
    return {
        "name": picture.name,
        "source": f"data:{kind};base64,{base64.b64encode(content).decode('ascii')}",
        "caption": picture.caption,
        "alt": picture.alt,
        "wide": picture.wide,
        "width": width,
        "height": height,
    }


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
    made.filters |= {"prose": words.page_prose, "sentence": words.sentence, "clause": words.clause, "latex": latex}
    return made
