"""What the commands share: options, progress, loading."""

from __future__ import annotations

import sys
from collections.abc import Callable
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from discovery.dataset import Dataset

__all__ = ["PATH", "load", "options", "progress", "results_folder"]

PATH = click.Path(path_type=Path)


def options(*names: str) -> Callable[[Any], Any]:
    """Return a decorator with the options that several commands share."""
    known = {
        "train": click.option("--train", multiple=True, type=PATH, help="Recording to fit; repeat for several."),
        "holdout": click.option(
            "--holdout", multiple=True, type=PATH, help="Recording that is never fitted; repeat for several."
        ),
        "out": click.option("--out", required=True, type=PATH, help="Folder for the results."),
        "seed": click.option(
            "--seed", default=1, show_default=True, type=click.IntRange(0), help="Seed of everything random."
        ),
        "quiet": click.option("--quiet", is_flag=True, help="No progress and no notes on standard error."),
    }

    def decorate(function: Any) -> Any:
        for name in reversed(names):
            function = known[name](function)
        return function

    return decorate


@contextmanager
def progress(quiet: bool):
    """Yield a function that shows what is being done on standard error."""
    if quiet or not sys.stderr.isatty():
        last = ""

        def tell(message: str) -> None:
            nonlocal last
            kind = message.partition(":")[0]
            if not quiet and kind != last:
                click.echo(message, err=True)
            last = kind

        yield tell
        return
    from rich.console import Console

    with Console(stderr=True).status("starting") as status:
        yield status.update


def load(
    rig: Path, train: tuple[Path, ...], holdout: tuple[Path, ...], quiet: bool, *, keep_third: bool = True
) -> Dataset:
    """Read the rig file and the recordings that a command names, and say what is unusual about them."""
    from discovery.dataset import load_dataset
    from discovery.input_choice import choose_interpolation

    dataset = choose_interpolation(load_dataset(rig, train, holdout, keep_third=keep_third))
    for _, experiment in () if quiet else dataset.everything:
        for note in experiment.recording.notes:
            click.echo(f"{experiment.recording.source}: {note}", err=True)
    return dataset


def results_folder(out: Path) -> Path:
    """Return the folder of ``--out``, made if need be; refuse one in which nothing can be written."""
    from tempfile import TemporaryFile

    from discovery.errors import InputError

    if out.exists() and not out.is_dir():
        raise InputError(f"{out} is a file; give a folder with --out.")
    try:
        out.mkdir(parents=True, exist_ok=True)
        with TemporaryFile(dir=out):
            pass
    except OSError as error:
        raise InputError(
            f"Nothing can be written to {out}: {error.strerror}. Give another folder with --out."
        ) from None
    return out
