"""The commands that take a discovered model along."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import click

from discovery.cli.folders import results_folder
from discovery.cli.options import PATH, note, options, print_files

_WHAT = click.option(
    "--what",
    type=click.Choice(["before", "after"]),
    default="after",
    show_default=True,
    help="The declared model refitted, or the final one.",
)


@click.command()
@click.argument("folder", type=PATH)
@options("out")
@_WHAT
@click.option(
    "--format", "formats", default="sympy,latex,numpy,json,c,fmu", show_default=True, help="Which files to write."
)
@options("json")
def export(folder: Path, out: Path, what: str, formats: str, as_json: bool) -> None:
    """Write the model of a finished run or loop as sympy, LaTeX, a numpy file, JSON, C and an FMU."""
    from discovery.export import FORMATS, export_model, read_fitted

    found = read_fitted(folder, what)
    chosen = [f.strip() for f in formats.split(",") if f.strip()]
    files = (file for name in chosen if name in FORMATS for file in FORMATS[name].files)
    written = export_model(found, results_folder(out, *files), chosen)
    print_files(written, as_json, found.to_dict())


@click.command()
@click.argument("folder", type=PATH)
@options("out")
@_WHAT
@click.option("--deflection", type=float, help="Of the operating point [q]; its equilibrium otherwise.")
@click.option("--speed", type=float, default=0.0, help="Rate there [q/s]: friction is that at this speed.")
@click.option("--held", type=float, default=0.0, help="Input there: the motor's angle [rad], or the force.")
@click.option("--amplitude", type=float, help="Of a swing [q]: forces become their describing functions.")
@click.option("--frequency", type=float, help="Of that swing [rad/s].")
@click.option("--sample-time", type=float, help="For discrete time, the input held between samples [s].")
@options("json")
def linearise(
    folder: Path, out: Path, what: str, sample_time: float | None, as_json: bool, **point: Any
) -> None:  # fmt: skip
    """Write the model of a run near an operating point as state-space matrices, with standard deviations."""
    from discovery.export import discretise, export_linear, linear_to_json, read_draws, read_fitted
    from discovery.export import linearise as tangent

    found = read_fitted(folder, what)
    linear = tangent(found, draws=read_draws(folder, found.model), **point)
    if sample_time is not None:
        linear = discretise(linear, sample_time)
    for warning in linear.warnings:
        note(f"warning: {warning}")
    written = export_linear(linear, found, results_folder(out, "linear.py", "linear.json"))
    print_files(written, as_json, json.loads(linear_to_json(linear)))


@click.command("feed-forward")
@click.argument("folder", type=PATH)
@options("out")
@_WHAT
@click.option("--rate", "largest_rate", type=float, required=True, help="Largest rate of the table [q/s].")
@click.option("--position", "largest_position", type=float, required=True, help="Largest position of the table [q].")
@options("json")
def feed_forward(
    folder: Path, out: Path, what: str, largest_rate: float, largest_position: float, as_json: bool
) -> None:
    """Write what a drive must be told for a wanted motion, friction included, as CSV and C tables."""
    from discovery.export import export_feed_forward, read_fitted
    from discovery.export import feed_forward as tables

    source = read_fitted(folder, what)
    found = tables(source, largest_rate=largest_rate, largest_position=largest_position)
    for warning in found.warnings:
        note(f"warning: {warning}")
    written = export_feed_forward(found, source, results_folder(out, "feed_forward.csv", "feed_forward.h"))
    print_files(written, as_json, asdict(found))


COMMANDS: tuple[click.Command, ...] = (export, linearise, feed_forward)
