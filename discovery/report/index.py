"""One page over all runs: what each recording says, with a link to the run's own page.

Run it as ``python -m discovery.report.index FOLDER``, where each run has a folder of its own in FOLDER.
"""

from __future__ import annotations

import base64
import sys
from pathlib import Path
from typing import Any

from markupsafe import Markup

from discovery.foundation.errors import InputError
from discovery.foundation.io import atomic_write
from discovery.report.estimates import posterior_table
from discovery.report.formula import formula
from discovery.report.numbers import scale_for, significant, uncertain, unit_text
from discovery.report.page import added_effects, environment, found_terms, regression_equation, three_terms
from discovery.report.results import Run, read_run
from discovery.report.words import effect_name, headline, held_group, origin
from discovery.results.provenance import read_json

__all__ = ["build_index"]

#: Figures of a run that the page over all runs shows, in this order, where the run has them.
_SHOWN = ("errors", "residual", "spring_law", "radius_law", "model_error", "distortion")


def build_index(folder: Path) -> Path:
    """Write ``index.html`` in a folder of runs.

    Parameters
    ----------
    folder : Path
        Each subfolder with ``results.json`` is a whole run, each with ``loop.json`` alone a closed loop; one with
        ``studies.json`` holds the source paper's reproduction; ``measured`` the measured sets side by side.

    Returns
    -------
    Path
        The page; figures are embedded, pages of the runs are linked.

    Raises
    ------
    InputError
        If no subfolder holds results.
    """
    whole = [read_run(p.parent) for p in sorted(folder.glob("*/results.json"))]
    loops = [p.parent for p in sorted(folder.glob("*/loop.json")) if not (p.parent / "results.json").exists()]
    if not whole and not loops:
        raise InputError(f"{folder} holds no finished run; make one with `discovery run ... --out {folder}/NAME`.")
    paper = next(iter(sorted(folder.glob("*/studies.json"))), None)
    context = {
        "runs": [_section(run) for run in whole],
        "loops": [_row(p) for p in loops],
        "paper": paper.parent.name if paper else "",
        "measured": (folder / "measured" / "index.html").exists(),
    }
    path = folder / "index.html"
    with atomic_write(path) as temporary:
        temporary.write_text(environment().get_template("index.html.j2").render(context), encoding="utf-8")
    return path


def _section(run: Run) -> dict[str, Any]:
    """Return what the page says of a whole run."""
    r = run.results
    system = r["rig"]["kind"]
    discovery = r.get("discovery")
    return {
        "folder": run.folder.name,
        "name": r["rig"]["name"],
        "origin": origin(run),
        "headline": headline(run),
        "verdict": run.loop["verdict"],
        "equation": regression_equation(found_terms(discovery), system) if discovery else "",
        "three": three_terms(discovery, system) if discovery else None,
        "status": discovery["status"] if discovery else "",
        "parameters": posterior_table(run).html() if r.get("posterior") else "",
        "elastica": _check(run),
        "added": added_effects(run),
        "figures": [_figure(path) for n in _SHOWN if (path := run.folder / "figures" / f"{n}.svg").exists()],
    }


def _check(run: Run) -> list[tuple[Markup, str]]:
    """Return posterior against prediction, the rod's mass counted, by the law that a constant radius follows best."""
    elastica = run.results.get("elastica")
    if not elastica:
        return []
    rows = [
        row
        for row in elastica["comparison"]
        if row["mass"] == "rod_counted" and row["law"] == "static_least_squares" and row["parameter"] != "beta/alpha"
    ]
    return [
        (
            Markup(formula(row["parameter"])),
            f"{uncertain(row['posterior_mean'], row['posterior_sd'])} measured, "
            f"{uncertain(row['predicted_mean'], row['predicted_sd'] or None)} predicted "
            f"{unit_text(row['unit'], run.coordinate_unit)} ({significant(row['discrepancy'], 2)} sd apart)",
        )
        for row in rows
    ]


def _figure(path: Path) -> dict[str, str]:
    content = base64.b64encode(path.read_bytes()).decode("ascii")
    return {"name": path.stem, "source": f"data:image/svg+xml;base64,{content}"}


def _row(folder: Path) -> dict[str, Any]:
    """Return what the page says of a closed loop."""
    loop = read_json(folder / "loop.json")
    errors = loop["errors"]
    group = held_group(errors)
    scale = scale_for(errors["unit"], errors["after"][group]["rms"])
    found = []
    for effect in loop["effects"]:
        values = [
            f"{name} = {uncertain(p['value'], p['sd'])} {unit_text(p['unit'])}".strip()
            for name, p in effect["parameters"].items()
        ]
        rivals = "".join(f" or {effect_name(r)}" for r in effect["ambiguous_with"])
        found.append(effect_name(effect["id"]) + (f" ({'; '.join(values)})" if values else "") + rivals)
    return {
        "page": f"{folder.name}/report.html" if (folder / "report.html").is_file() else "",
        "name": effect_name(folder.name),
        "verdict": loop["verdict"].replace("_", " "),
        "found": found,
        "before": significant(errors["before"][group]["rms"] * scale.factor),
        "after": significant(errors["after"][group]["rms"] * scale.factor),
        "floor": significant(errors["noise_floor"] * scale.factor),
        "unit": scale.symbol,
    }


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python -m discovery.report.index FOLDER")
    try:
        print(build_index(Path(sys.argv[1])))
    except InputError as error:
        sys.exit(f"discovery: {error}")
