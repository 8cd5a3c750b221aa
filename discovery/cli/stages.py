"""The stages of a run as commands, each alone, and the page of a run written again."""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from discovery.cli.folders import held, results_folder
from discovery.cli.loop_page import has_parts, rebuild_page
from discovery.cli.options import PATH, load, note, options, print_files, print_json, progress
from discovery.foundation.estimate_text import estimate_text

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from discovery.recordings.dataset import Dataset

#: Noise models, named here so that the help is there at once; "auto" is the one of largest evidence.
NOISES = ("auto", "gaussian", "student_t", "correlated", "input", "quantised")


def _save(file: Path, content: Mapping[str, Any], dataset: Dataset, seed: int) -> None:
    """Write what a stage found, and where it comes from."""
    from discovery.results.provenance import provenance, write_json

    write_json(file, {"provenance": provenance(dataset, seed=seed), **content})


@click.command()
@click.argument("rig", type=PATH)
@options("train", "out", "seed", "quiet", "json")
def discover(rig: Path, train, out: Path, seed: int, quiet: bool, as_json: bool) -> None:
    """Find the equation of motion by sparse regression."""
    from discovery.runs import regression_stage

    dataset = load(rig, train, (), quiet, keep_third=False)
    folder = results_folder(out, "discovery.json")
    with progress(quiet) as tell:
        found = regression_stage.discover(dataset, seed=seed, progress=tell)
    summary = found.summary()
    _save(folder / "discovery.json", summary, dataset, seed)
    if as_json:
        print_json({**summary, "files": [folder / "discovery.json"]})
        return
    click.echo(summary["discovery"]["status"])
    if summary["radius"]:
        click.echo(summary["radius"]["status"])


@click.command()
@click.argument("rig", type=PATH)
@options("train", "out", "seed", "quiet", "json")
def fit(rig: Path, train, out: Path, seed: int, quiet: bool, as_json: bool) -> None:
    """Fit the linear and the declared model by output error."""
    from discovery.runs import stages

    dataset = load(rig, train, (), quiet, keep_third=False)
    folder = results_folder(out, "fit.json")
    with progress(quiet) as tell:
        fits = stages.estimate(dataset, progress=tell)
    _save(folder / "fit.json", fits.summary(), dataset, seed)
    if as_json:
        print_json({**fits.summary(), "files": [folder / "fit.json"]})
        return
    for label, found in fits.models.items():
        values = ", ".join(
            f"{n} = {estimate_text(p['value'], p['sd'], p['unit'])}"
            for n, p in found.summary()["parameters"].items()
            if n in found.problem.free
        )
        click.echo(f"{label}: {values}; {found.status}")


@click.command()
@click.argument("rig", type=PATH)
@options("train", "out", "seed", "quiet", "json")
@click.option(
    "--noise",
    type=click.Choice(NOISES),
    default="gaussian",
    show_default=True,
    help="What the errors of the readings are like; auto: what the evidence prefers.",
)
def posterior(rig: Path, train, out: Path, seed: int, quiet: bool, as_json: bool, noise: str) -> None:
    """Sample the posterior of the declared model; an interrupted run is resumed."""
    from discovery.runs import stages

    dataset = load(rig, train, (), quiet, keep_third=False)
    folder = results_folder(out, "posterior.json", "posterior.nc", "posterior_chains.h5")
    checkpoint = folder / "posterior_chains.h5"
    with progress(quiet) as tell:
        fitted = stages.estimate(dataset, progress=tell).models["declared"]
        choice = stages.weighed(fitted, seed=seed, progress=tell) if noise == "auto" else None
        chosen = noise if choice is None else choice.noise
        found = stages.sampled(fitted, seed=seed, progress=tell, backend=checkpoint, noise=chosen)
        tell("simulating what some of the draws would read again")
        found.to_netcdf(folder / "posterior.nc", dataset)
    rows = found.summary()
    of_noise = {"chosen": chosen} if choice is None else choice.summary()
    summary = {"rows": rows, "status": found.status, "noise": of_noise}
    _save(folder / "posterior.json", summary, dataset, seed)
    checkpoint.unlink(missing_ok=True)
    if found.warns:  # whatever is silenced: the intervals are not what they seem
        note(found.status)
    if as_json:
        print_json({**summary, "files": [folder / "posterior.json", folder / "posterior.nc"]})
        return
    if choice is not None:
        click.echo(f"noise: {chosen}, by its evidence{'' if choice.chosen.reliable else ', which cannot be trusted'}")
    _say_rows(rows)
    if not found.warns:
        click.echo(found.status)


def _say_rows(rows: Sequence[Mapping[str, Any]]) -> None:
    """Print the rows of a posterior, what belongs to a recording after what belongs to the system."""
    from discovery.foundation.start_names import is_start

    of_recordings = [row for row in rows if is_start(row["name"])]
    for row in (*(row for row in rows if row not in of_recordings), *of_recordings):
        if of_recordings and row is of_recordings[0]:
            click.echo("initial states:")
        indent = "  " if row in of_recordings else ""
        click.echo(f"{indent}{row['name']}: {estimate_text(row['mean'], row['sd'], row['unit'])}")


@click.command()
@click.argument("rig", type=PATH)
@options("train")
@click.option("--out", type=PATH, help="Folder for elastica.json; without it the prediction is only printed.")
@options("seed", "quiet", "json")
def elastica(rig: Path, train, out: Path | None, seed: int, quiet: bool, as_json: bool) -> None:
    """Predict alpha, beta and gamma from the rig file alone; with posterior.nc in OUT, compare.

    With recordings, the elastica's law is also fitted over the deflections that they reach.
    """
    from discovery.foundation.errors import InputError
    from discovery.posterior.draws import Posterior
    from discovery.recordings.dataset import Dataset
    from discovery.rigs.rig_file import read_rig
    from discovery.runs import stages

    described = read_rig(rig)
    recorded = train or described.records
    dataset = load(rig, train, (), quiet, keep_third=False) if recorded else Dataset(described, (), ())
    saved = None if out is None else out / "posterior.nc"
    posterior = Posterior.from_netcdf(saved) if saved is not None and os.path.exists(saved) else None
    with progress(quiet) as tell:
        found = stages.predicted(dataset, posterior, seed=seed, progress=tell)
    if found is None:
        raise InputError(
            f"{rig}: the elastica needs an arm with length, tip_mass, beam_mass and flexural_rigidity in its rig file."
        )
    if out is not None:
        _save(results_folder(out, "elastica.json") / "elastica.json", found, dataset, seed)
    if as_json:
        print_json({**found, "files": [] if out is None else [out / "elastica.json"]})
        return
    for row in found["prediction"]:
        value = estimate_text(row["mean"], row["sd"], row["unit"])
        click.echo(f"{row['mass']:12} {row['law']:22} {row['parameter']:10} {value}")


@click.command()
@click.argument("rig", type=PATH)
@options("train", "out", "seed", "quiet", "json")
def residual(rig: Path, train, out: Path, seed: int, quiet: bool, as_json: bool) -> None:
    """Examine what the declared model leaves."""
    from discovery.estimation.natural_units import natural_units
    from discovery.estimation.residual import examine
    from discovery.runs import stages

    dataset = load(rig, train, (), quiet, keep_third=False)
    folder = results_folder(out, "residual.json")
    with progress(quiet) as tell:
        fits = stages.estimate(dataset, progress=tell)
    report = examine(dataset.train, fits.predictions["declared"], 2 * math.pi * natural_units(dataset.train).time)
    _save(folder / "residual.json", report.summary(), dataset, seed)
    if as_json:
        print_json({**report.summary(), "files": [folder / "residual.json"]})
        return
    click.echo(
        f"rms {report.rms:.3g} noise sds, systematic part {report.systematic:.3g}, "
        f"{'white' if report.white else 'not white'} (Ljung-Box p = {report.ljung_box_p:.2g})"
    )


@click.command()
@click.argument("folder", type=PATH)
@options("json")
def report(folder: Path, as_json: bool) -> None:
    """Write the page of a finished run or loop again from its result files."""
    from discovery.foundation.errors import InputError
    from discovery.foundation.io import shown
    from discovery.report import build_report
    from discovery.results.provenance import read_json

    whole = os.path.exists(folder / "results.json")
    if not whole and not has_parts(folder):
        raise InputError(
            f"{shown(folder)} holds neither results.json nor the page of a loop; make them with `discovery run` or "
            "`discovery loop`."
        )
    page = (build_report if whole else rebuild_page)(held(folder))
    found = read_json(folder / "results.json")["loop"] if whole else read_json(folder / "loop.json")
    print_files([page], as_json, {"verdict": found["verdict"]})


COMMANDS: tuple[click.Command, ...] = (discover, fit, posterior, elastica, residual, report)
