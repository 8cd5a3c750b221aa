"""The command that takes a discovered model along."""

from __future__ import annotations

from pathlib import Path

import click

from discovery.cli.options import PATH, options, results_folder

__all__ = ["COMMANDS"]


@click.command()
@click.argument("folder", type=PATH)
@options("out")
@click.option(
    "--what",
    type=click.Choice(["before", "after"]),
    default="after",
    show_default=True,
    help="The declared model refitted, or the final one.",
)
@click.option(
    "--format", "formats", default="sympy,latex,numpy,json,c,fmu", show_default=True, help="Which files to write."
)
def export(folder: Path, out: Path, what: str, formats: str) -> None:
    """Write the model of a finished run or loop as sympy, LaTeX, a numpy file, JSON, C and an FMU."""
    from discovery.export import FORMATS, export_model, read_fitted

    found = read_fitted(folder, what)
    chosen = [f.strip() for f in formats.split(",") if f.strip()]
    files = (file for name in chosen if name in FORMATS for file in FORMATS[name].files)
    for path in export_model(found, results_folder(out, *files), chosen):
        click.echo(f"{path}")


COMMANDS: tuple[click.Command, ...] = (export,)
