"""What comes before a loop, as commands: a rig file drafted from recordings, and what was understood of one."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from discovery.cli.folders import writable
from discovery.cli.options import KINDS, PATH, note, options, print_json, tell_unused

if TYPE_CHECKING:
    from collections.abc import Mapping

    from discovery.recordings.dataset import Dataset

#: Formats of a picture that matplotlib and a browser both know.
_PICTURES = (".png", ".svg", ".pdf")


@click.command()
@click.argument("recordings", nargs=-1, required=True, type=PATH, metavar="RECORDING...")
@click.option("--holdout", multiple=True, type=PATH, help="Recording that is never fitted; repeat for several.")
@click.option("--out", type=PATH, help="Rig file to write; rig.toml beside the first recording otherwise.")
@click.option("--kind", type=click.Choice(KINDS), help="Kind of system; told from the signals otherwise.")
@click.option("--rate", type=click.FloatRange(0, min_open=True), help="Readings a second, for files without times.")
@click.option("--time", help="Column of the times.")
@click.option("--input", "given", help="Column of what drives the system.")
@click.option("--output", help="Column of the motion.")
@options("json")
def init(
    recordings: tuple[Path, ...], holdout: tuple[Path, ...], out: Path | None, kind: str | None, rate: float | None,
    time: str | None, given: str | None, output: str | None, as_json: bool,
) -> None:  # fmt: skip
    """Write a commented rig file for recordings of one system.

    Columns, units, rate, noise and the kind of system are read from the files; what is a guess says so in the rig file.
    A rig file that is there already is not touched.
    """
    from discovery.drafting.overview import overview, overview_lines
    from discovery.drafting.rig_text import draft
    from discovery.foundation.errors import InputError
    from discovery.foundation.io import atomic_write
    from discovery.recordings.dataset import load_dataset

    place = recordings[0].parent / "rig.toml" if out is None else out
    if os.path.exists(place):
        raise InputError(f"{place} is there already. Change it, or name another file with --out.")
    chosen = {"time": time, "input": given, "output": output}
    writable(place.parent)
    text = draft(recordings, place.parent, holdout=holdout, kind=kind, rate=rate, chosen=chosen)
    with atomic_write(place) as beside:
        beside.write_text(text, encoding="utf-8")
    try:
        dataset = load_dataset(place)
    except InputError as error:
        raise InputError(f"{place} is written, and needs a look before it can be used. {error}") from None
    if as_json:
        print_json({**overview(dataset), "files": [place]})
        return
    for line in overview_lines(dataset, overview(dataset)):
        click.echo(line)
    click.echo(f"written: {place}")
    click.echo(f"next: look at its guesses, then `discovery loop {place} --out {place.with_suffix('')}_loop`")


@click.command()
@click.argument("rig", type=PATH)
@options("train", "holdout", "estimate_noise")
@click.option("--plot", type=PATH, help=f"Draw the recordings to this file ({', '.join(_PICTURES)}).")
@click.option("--open", "opened", is_flag=True, help="Open the picture of --plot.")
@options("json")
def check(
    rig: Path, train, holdout, estimate_noise: bool, plot: Path | None, opened: bool, as_json: bool
) -> None:  # fmt: skip
    """Show what is understood of a rig file and its recordings: sampling, noise, excitation, flags.

    Nothing is fitted. A rig file or a recording that cannot be right ends with exit status 2 and its reason.
    """
    from discovery.drafting.overview import overview, overview_lines
    from discovery.recordings.dataset import load_dataset

    if opened and plot is None:
        raise click.UsageError("--open needs --plot FILE: the picture is opened from there.")
    if plot is not None and plot.suffix.lower() not in _PICTURES:
        raise click.UsageError(f"--plot {plot}: a picture is one of {', '.join(_PICTURES)}.")
    dataset = load_dataset(rig, train, holdout, estimate_noise=estimate_noise)
    tell_unused(dataset.rig, train, holdout)
    content: Mapping[str, Any] = overview(dataset)
    if plot is not None:
        _draw(dataset, plot)
    if as_json:
        print_json({**content, "files": [] if plot is None else [plot]})
    else:
        for line in overview_lines(dataset, content):
            click.echo(line)
        if plot is not None:
            click.echo(f"written: {plot}")
    if opened and click.launch(str(plot)):
        note(f"{plot}: no program was found that opens it.")


def _draw(dataset: Dataset, place: Path) -> None:
    """Draw the recordings to a file."""
    from discovery.foundation.io import atomic_write
    from discovery.plots.axes import detached_axes

    figure, axes = detached_axes(len((*dataset.everything, *dataset.test)))
    dataset.plot_recordings(axes)
    with atomic_write(place) as beside:
        figure.savefig(beside)


COMMANDS: tuple[click.Command, ...] = (init, check)
