"""What the commands share: options, progress, loading."""

from __future__ import annotations

import re
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from discovery.foundation.progress import Progress, Tell, silent

if TYPE_CHECKING:
    from discovery.recordings.dataset import Dataset
    from discovery.rigs.rig import Rig

#: Kinds of system that a rig file may name, here so that the help is there at once.
KINDS = ("flexible_arm", "oscillator", "pendulum", "base_excited", "drive", "falling_body", "system")


class _Path(click.Path):
    """A path that is named: without a name, it would be the current folder."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        if not str(value) or "\0" in str(value):
            self.fail("a path without a name; name a file or a folder.", param, ctx)
        return super().convert(value, param, ctx)


class Seconds(click.ParamType):
    """A time as a number of seconds, or with a unit: 90, 90s, 5min, 1.5h."""

    name = "TIME"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Return the seconds."""
        found = _TIME.fullmatch(str(value).strip())
        if not found:
            self.fail(f"{value!r} is no time; give seconds as in 90, or a unit as in 5min or 1h.", param, ctx)
        return float(found[1]) * {"m": 60.0, "h": 3600.0}.get(found[2][:1], 1.0)


PATH = _Path(path_type=Path)
SEED = click.IntRange(0)
_TIME = re.compile(r"(\d+(?:\.\d*)?|\.\d+) *(|s|min|m|h)")
#: Seconds after which a message of the same kind is said again where nothing can be overwritten.
_AGAIN = 30.0
#: Without a word of it the first loop on a machine would seem to hang.
_COMPILING = "compiling a simulator, up to a minute: each only once, then it is kept on disk"


def options(*names: str) -> Callable[[Any], Any]:
    """Return a decorator with the options that several commands share."""
    known = {
        "train": click.option(
            "--train",
            multiple=True,
            type=PATH,
            help="Recording to fit, in the place of all that the rig file names; repeat for several.",
        ),
        "holdout": click.option(
            "--holdout",
            multiple=True,
            type=PATH,
            help="Recording that is never fitted; repeat for several. --train alone leaves out the rig file's too.",
        ),
        "out": click.option("--out", required=True, type=PATH, help="Folder for the results."),
        "seed": click.option("--seed", default=1, show_default=True, type=SEED, help="Seed of everything random."),
        "estimate_noise": click.option(
            "--estimate-noise",
            is_flag=True,
            help="Take the noise of each channel from its scatter, whatever the rig file states.",
        ),
        "quiet": click.option(
            "--quiet",
            is_flag=True,
            help="No progress and no notes on standard error; errors stay, and a warning that a result is not what it "
            "may seem.",
        ),
        "json": click.option(
            "--json",
            "as_json",
            is_flag=True,
            help="Print the result as one JSON document, in SI units, in the place of lines for people.",
        ),
    }

    def decorate(function: Any) -> Any:
        for name in reversed(names):
            function = known[name](function)
        return function

    return decorate


def note(message: str) -> None:
    """Say something on standard error; where that cannot be written, the work goes on."""
    with suppress(OSError):
        click.echo(message, err=True)


def print_json(content: Mapping[str, Any] | Sequence[Any]) -> None:
    """Print a result as one JSON document."""
    from discovery.results.provenance import json_text

    click.echo(json_text(content))


def print_files(files: Sequence[Path], as_json: bool, content: Mapping[str, Any]) -> None:
    """Print where files were written, or, as one JSON document, what is in them and where they are."""
    if as_json:
        print_json({**content, "files": files})
        return
    for path in files:
        click.echo(f"{path}")


def once(_: click.Context, parameter: click.Parameter, values: tuple[Any, ...]) -> Any:
    """Return the value of an option that may be given once, and refuse it given again: the last would win unseen."""
    if len(values) > 1:
        name = parameter.opts[0]
        raise click.UsageError(f"{name} is given {len(values)} times ({', '.join(map(str, values))}): give it once.")
    return values[0] if values else None


@contextmanager
def progress(quiet: bool) -> Iterator[Tell]:
    """Yield a function that shows on standard error what is being done, and when a kernel is compiled for it."""
    if quiet:
        yield silent
        return
    from discovery.simulation.kernel.compile import heard_compiling

    if not sys.stderr.isatty():
        last, said = "", 0.0

        def tell(message: str) -> None:
            nonlocal last, said
            kind = message.partition(":")[0]
            ended = isinstance(message, Progress) and message.done >= message.total
            if kind != last or ended or time.monotonic() - said > _AGAIN:
                note(message)
                said = time.monotonic()
            last = kind

        with heard_compiling(lambda: note(_COMPILING)):
            yield tell
        return
    from rich import progress as shown
    from rich.console import Console
    from rich.table import Column

    text = shown.TextColumn("{task.description}", markup=False, table_column=Column(overflow="fold"))
    columns = (shown.SpinnerColumn(), text, shown.TimeElapsedColumn())
    # Standard output that goes to a file stays there.
    to_screen = sys.stdout.isatty()
    with shown.Progress(*columns, console=Console(stderr=True), transient=True, redirect_stdout=to_screen) as bar:
        doing, task = "starting", bar.add_task("starting", total=None)

        def show(message: str) -> None:
            nonlocal doing
            doing = message
            bar.update(task, description=message)

        def compiling(message: str) -> None:
            bar.update(task, description=message)

        with heard_compiling(lambda: compiling(f"{doing}: {_COMPILING}"), lambda: compiling(doing)):
            yield show


def load(
    rig: Path, train: tuple[Path, ...], holdout: tuple[Path, ...], quiet: bool, *, keep_third: bool = True,
    estimate_noise: bool = False,
) -> Dataset:  # fmt: skip
    """Read the rig file and the recordings that a command names, and say what is unusual about them."""
    from discovery.estimation.input_choice import choose_interpolation
    from discovery.recordings.dataset import load_dataset

    dataset = choose_interpolation(
        load_dataset(rig, train, holdout, keep_third=keep_third, estimate_noise=estimate_noise)
    )
    if not quiet:
        tell_unused(dataset.rig, train, holdout)
    for _, experiment in () if quiet else dataset.everything:
        for told in experiment.recording.notes:
            note(f"{experiment.recording.source}: {told}")
    return dataset


def tell_unused(rig: Rig, train: tuple[Path, ...], holdout: tuple[Path, ...]) -> None:
    """Say that the rig file's hold-out takes no part where a command names what to fit, and nothing else."""
    unused = [name for name in ("holdout", "test") if rig.records.get(name)] if train and not holdout else []
    if "holdout" in unused:
        note(f"--train alone leaves out {' and '.join(unused)} of {rig.path}. Name a hold-out with --holdout.")
