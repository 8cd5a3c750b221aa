"""The page: one self-contained HTML file made of a run's result files."""

from __future__ import annotations

import base64
import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from discovery.foundation.arguments import as_path
from discovery.foundation.io import atomic_write
from discovery.report import ambiguity, answer, evidence, latent, measures, noise, posterior, story
from discovery.report.caution_sentences import failure_sentence, remedy_sentence
from discovery.report.charts import chart_data, policy, scripts, sheet
from discovery.report.equations import (
    drive_words,
    found_terms,
    model_formulas,
    regression_equation,
    standing,
    three_terms,
)
from discovery.report.estimates import elastica_table, final_table, nuisance_table, posterior_table, published
from discovery.report.figures import draw_all, motion
from discovery.report.latex import latex
from discovery.report.model_error_sentences import model_error_words
from discovery.report.numbers import interval, significant
from discovery.report.references import methods_used, sources_table
from discovery.report.results import Run, read_run
from discovery.report.sentences import lead_sentence, refutations, verdict_sentence
from discovery.report.style import Picture, render, styled
from discovery.report.tables import Table
from discovery.report.words import clause, headline, origin, page_prose, sentence

if TYPE_CHECKING:
    from jinja2 import Environment

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
            drawn = motion.draw(run)
            shown = {"data": [] if drawn is None else [embed(run.folder, drawn)]}
        html = environment().get_template("failed.html.j2").render(_failed_context(run), figures=shown)
        return _page(run.folder, html)
    tables = _tables(run)
    figures: dict[str, list[dict[str, Any]]] = {}
    with styled():
        for section, pictures in draw_all(run).items():
            figures[section] = [embed(run.folder, picture) for picture in pictures]
    for table in tables.values():
        written(run.folder / "tables" / f"{table.name}.csv", table.csv())
    return _page(run.folder, environment().get_template("page.html.j2").render(_context(run, tables, figures)))


def _page(folder: Path, html: str) -> Path:
    # The odds that are told stand in one line.
    return written(folder / "report.html", html.replace("10 000", "10\N{NO-BREAK SPACE}000"))


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
    made.filters |= {"prose": page_prose, "sentence": sentence, "clause": clause, "latex": latex}
    return made


def _tables(run: Run) -> dict[str, Table]:
    """Return the tables for which the run has results, by name."""
    r = run.results
    made: list[Table | None] = [
        measures.recordings_table(run),
        measures.errors_table(run),
        measures.scored_table(run),
        measures.clean_table(run),
        measures.fits_table(run),
        evidence.distortion_table(run),
        evidence.terms_table(run) if r.get("discovery") else None,
        evidence.equations_table(run) if r.get("discovery") else None,
        evidence.radius_table(run),
        noise.honest_table(run) if r.get("posterior") else None,
        posterior_table(run) if r.get("posterior") else None,
        nuisance_table(run) if r.get("posterior") else None,
        posterior.profiles_table(run),
        posterior.priors_table(run),
        posterior.coverage_table(run),
        posterior.diagnostics_table(run),
        noise.noise_table(run),
        posterior.models_table(run),
        elastica_table(run) if r.get("elastica") and r["elastica"]["comparison"] else None,
        evidence.residual_table(run),
        evidence.dependence_table(run),
        evidence.effects_table(run),
        evidence.ranking_table(run),
        evidence.model_error_table(run),
        latent.dependence_table(run),
        latent.patches_table(run),
        ambiguity.separation_table(run),
        ambiguity.moves_table(run),
        ambiguity.contradictions_table(run),
        ambiguity.reconciliations_table(run),
        final_table(run),
        sources_table(run),
    ]
    return {table.name: table for table in made if table is not None}


def _context(run: Run, tables: Mapping[str, Table], figures: Mapping[str, Any]) -> dict[str, Any]:
    """Return what the template of the page asks for."""
    return {
        "tables": {name: table.html() for name, table in tables.items()},
        "figures": figures,
        "has_rod": run.system.has_rod,
        "provenance": run.results["provenance"],
        "methods": methods_used(run),
        **_first_screen(run),
        **_regression_part(run),
        **_model_part(run),
        **_posterior_part(run),
        "elastica": run.results.get("elastica") if "elastica" in tables else None,
        **_loop_part(run),
    }


def _first_screen(run: Run) -> dict[str, Any]:
    """Return the answer, and the chart in the reader's browser."""
    chart, lines = chart_data(run), answer.equation_lines(run)
    return {
        "policy": policy(chart=chart is not None),
        "scripts": scripts(chart=chart is not None),
        "chart": chart,
        "chart_sheet": sheet(),
        "certainty": answer.certainty(run),
        "final_lines": lines,
        "final_tex": answer.in_one(lines),
        "where": answer.where(run, lines),
        "final_values": answer.parameter_lines(run),
        "bars": answer.error_bars(run),
        "standing": standing(run),
        "name": run.results["rig"]["name"],
        "origin": origin(run),
        "headline": headline(run),
        "verdict": run.loop["verdict"],
        "because": verdict_sentence(run.told),
        "refutations": refutations(run.loop),
        "model_error": model_error_words(run.told),
        "lead": lead_sentence(run.loop["lead"]) if run.loop.get("lead") else "",
        "added": answer.added_effects(run),
        "quantities": measures.quantities(run),
        "notes": [(r["name"], n) for r in run.results["recordings"] for n in r.get("notes", ())],
    }


def _regression_part(run: Run) -> dict[str, Any]:
    """Return what the recording says before any model is fitted."""
    r, system = run.results, run.results["rig"]["kind"]
    discovery, radius = r.get("discovery"), r.get("radius")
    return {
        "discovery": discovery,
        "equation": regression_equation(found_terms(discovery), system) if discovery else "",
        "three": three_terms(discovery, system) if discovery and run.system.has_rod else None,
        "radius": radius,
        "radius_interval": interval(*radius["interval"]) if radius else "",
        "radius_gamma": significant(radius["gamma"], 4) if radius else "",
        "multisine": r.get("multisine"),
    }


def _model_part(run: Run) -> dict[str, Any]:
    """Return the declared and the final model."""
    model, system = run.loop["model"], run.results["rig"]["kind"]
    return {
        "declared_formulas": [f.shown for f in model_formulas(model["before"]["model"], system)],
        "drive": drive_words(run),
        "final_formulas": [f.shown for f in model_formulas(model["after"]["model"], system)],
        "same_model": model["before"]["model"] == model["after"]["model"],
        "final": model["after"],
        "reduced_chi2": significant(model["after"]["reduced_chi2"], 4),
        "solver_shift": significant(model["after"]["solver_shift_sd"], 2),
    }


def _posterior_part(run: Run) -> dict[str, Any]:
    return {
        "posterior": run.results.get("posterior"),
        "pending": posterior.pending_sentence(run),
        "asked": posterior.is_as_asked(run),
        "whole": run.is_whole,
        "noise_differs": noise.noise_differs(run),
        "noise": noise.noise_sentence(run),
        "converged": posterior.convergence_sentence(run),
        "leans": posterior.prior_sentence(run),
        "correlated": posterior.correlation_sentences(run),
    }


def _loop_part(run: Run) -> dict[str, Any]:
    return {
        "paper": published(run).get("source", ""),
        "steps": story.steps(run),
        **ambiguity.told(run),
        "unexplained": latent.sentences(run),
    }


def _failed_context(run: Run) -> dict[str, Any]:
    """Return what the template of the page asks for where the declared model has no fit, but for its pictures."""
    failure = run.loop["failure"]
    formulas = model_formulas(run.loop["model"]["before"]["model"], run.results["rig"]["kind"])
    return {
        "policy": policy(chart=False),
        "scripts": scripts(chart=False),
        "name": run.results["rig"]["name"],
        "origin": origin(run),
        "why": failure_sentence(failure),
        "remedy": remedy_sentence(failure),
        "message": failure["message"],
        "declared_formulas": [f.shown for f in formulas],
        "recordings": measures.recordings_table(run).html(),
        "notes": [(r["name"], n) for r in run.results["recordings"] for n in r.get("notes", ())],
        "provenance": run.results["provenance"],
    }
