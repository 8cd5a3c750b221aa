"""What a loop starts from, as commands: a rig file drafted and looked at, the twin, and the public measured data."""

from __future__ import annotations

import inspect
import os
from dataclasses import MISSING, asdict, fields
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from discovery.cli.effects import effects
from discovery.cli.folders import writable
from discovery.cli.options import KINDS, PATH, SEED, note, options, print_files, print_json, tell_unused

if TYPE_CHECKING:
    from collections.abc import Mapping

    from discovery_datasets.disturbances import Disturbance


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
    from discovery.drafting.rig_text import drafted
    from discovery.foundation.errors import InputError
    from discovery.foundation.io import atomic_write
    from discovery.recordings.dataset import load_dataset

    place = recordings[0].parent / "rig.toml" if out is None else out
    if os.path.exists(place):
        raise InputError(f"{place} is there already. Change it, or name another file with --out.")
    if time is not None and rate is not None:
        raise InputError("--time names a column of times and --rate says that there is none: give one of both.")
    chosen = {"time": time, "input": given, "output": output}
    writable(place.parent)
    text, unused = drafted(recordings, place.parent, holdout=holdout, kind=kind, rate=rate, chosen=chosen)
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
    if "--" in unused:
        click.echo(f"not used: {unused}")
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
    from discovery.foundation.io import atomic_write
    from discovery.plots.axes import detached_axes
    from discovery.recordings.dataset import load_dataset

    if opened and plot is None:
        raise click.UsageError("--open needs --plot FILE: the picture is opened from there.")
    if plot is not None and plot.suffix.lower() not in _PICTURES:
        raise click.UsageError(f"--plot {plot}: a picture is one of {', '.join(_PICTURES)}.")
    dataset = load_dataset(rig, train, holdout, estimate_noise=estimate_noise)
    tell_unused(dataset.rig, train, holdout)
    content: Mapping[str, Any] = overview(dataset)
    if plot is not None:
        figure, axes = detached_axes(len(dataset.with_test))
        dataset.plot_recordings(axes)
        with atomic_write(plot) as beside:
            figure.savefig(beside)
    if as_json:
        print_json({**content, "files": [] if plot is None else [plot]})
    else:
        for line in overview_lines(dataset, content):
            click.echo(line)
        if plot is not None:
            click.echo(f"written: {plot}")
    if opened and click.launch(str(plot)):
        note(f"{plot}: no program was found that opens it.")


#: Manoeuvres of the twin, named here so that the help is there at once.
MANOEUVRES = ("train_paper", "train_large", "holdout_inside", "holdout_beyond")


def _parameters(kind: type[Disturbance]) -> dict[str, float | None]:
    """Return the parameters of what the twin can hide with their defaults, None where a value must be given."""
    return {f.name: None if f.default is MISSING else f.default for f in fields(kind)}


def _hidden(text: str) -> Disturbance:
    """Return what one ``--effect`` names; InputError with the parameters of the effect, if they are not those given."""
    from discovery_datasets.disturbances import DISTURBANCES

    from discovery.foundation.errors import InputError, suggestion

    effect_id, _, rest = text.partition(":")
    if effect_id not in DISTURBANCES:
        raise InputError(
            f"The twin has no effect {effect_id!r}.{suggestion(effect_id, DISTURBANCES)} It has "
            f"{', '.join(DISTURBANCES)}."
        )
    known = _parameters(DISTURBANCES[effect_id])
    form = ",".join(f"{n}=VALUE" if default is None else f"{n}={default:g}" for n, default in known.items())
    remedy = f"Write it as {effect_id}:{form}; what has a value here may be left out."
    values: dict[str, float] = {}
    for part in filter(None, rest.split(",")):
        name, _, number = (word.strip() for word in part.partition("="))
        if name not in known:
            raise InputError(
                f"--effect {text!r}: {effect_id} has no parameter {name!r}.{suggestion(name, known)} {remedy}"
            )
        try:
            value = float(number)
        except ValueError:
            value = float("nan")
        if not isfinite(value) or name in values:
            fault = "is given twice" if name in values else f"is {number!r}, which is no number"
            raise InputError(f"--effect {text!r}: the parameter {name!r} {fault}. {remedy}")
        values[name] = value
    lacking = [repr(n) for n, default in known.items() if default is None and n not in values]
    if lacking:
        raise InputError(f"--effect {text!r} lacks the parameter {' and '.join(lacking)}. {remedy}")
    return DISTURBANCES[effect_id](**values)


def _list_hidden(context: click.Context, _: click.Parameter, wanted: bool) -> None:
    """List what the twin can hide, each as ``--effect`` takes it, and leave."""
    if not wanted:
        return
    from discovery_datasets.disturbances import DISTURBANCES

    for effect_id, kind in DISTURBANCES.items():
        names = ",".join(n + ("" if default is None else f"={default:g}") for n, default in _parameters(kind).items())
        click.echo(f"{effect_id}:{names}")
        click.echo(f"    {' '.join((inspect.getdoc(kind) or '').split())}")
    context.exit()


@click.command(epilog=f"MANOEUVRE is one of {', '.join(MANOEUVRES)}.")
@click.argument("manoeuvre")
@click.option(
    "--effect",
    "effects_",
    multiple=True,
    metavar="ID:NAME=VALUE[,NAME=VALUE]",
    help="Hidden effect of the twin, for example coulomb_friction:force=6e-4; repeat for several. "
    "--list-effects lists them.",
)
@click.option(
    "--list-effects",
    is_flag=True,
    is_eager=True,
    expose_value=False,
    callback=_list_hidden,
    help="List the effects that the twin can hide with their parameters, and exit.",
)
@click.option("--out", required=True, type=PATH, help="CSV file to write.")
@click.option("--seed", default=1, show_default=True, type=SEED, help="Seed of the noise.")
@options("json")
def simulate(manoeuvre: str, effects_: tuple[str, ...], out: Path, seed: int, as_json: bool) -> None:
    """Record the twin in one of its MANOEUVREs, with any of its hidden effects."""
    from discovery_datasets.recordings import MANOEUVRES, make_recording
    from discovery_datasets.twin import write_csv

    from discovery.foundation.errors import InputError

    if manoeuvre not in MANOEUVRES:
        raise InputError(f"The twin knows no manoeuvre {manoeuvre!r}; it knows {', '.join(MANOEUVRES)}.")
    if out.is_dir():
        raise InputError(f"{out} is a folder; name the file to write with --out, as {out / f'{manoeuvre}.csv'}.")
    hidden = tuple(_hidden(text) for text in effects_)
    made = make_recording(manoeuvre, seed, disturbances=hidden)
    try:
        write_csv(made, out)
    except OSError as error:
        raise InputError(f"{out} cannot be written: {error.strerror}. Give another file with --out.") from None
    told = {"manoeuvre": manoeuvre, "seed": seed, "columns": list(made), "samples": len(made)}
    planted = [{"id": text.partition(":")[0], **asdict(effect)} for text, effect in zip(effects_, hidden, strict=True)]
    print_files([out], as_json, {**told, "effects": planted})


@click.group()
def data() -> None:
    """Public measured data: list, fetch, check."""


@data.command("list")
@click.argument("name", required=False)
@options("json")
def data_list(name: str | None, as_json: bool) -> None:
    """List the registered files with origin and licence, or show the card of the set or file NAME."""
    from discovery_datasets import registry

    from discovery.foundation.errors import InputError

    if name is not None:
        try:
            card = registry.card(name)
        except registry.DataUnavailable as error:
            raise InputError(str(error)) from None
        if as_json:
            print_json({"name": name, "card": card})
        else:
            click.echo(card)
        return
    if as_json:
        print_json([{"name": key, **asdict(entry)} for key, entry in registry.FILES.items()])
        return
    for key, entry in registry.FILES.items():
        derived = " (derived from it; not fetched)" if entry.derived else ""
        click.echo(f"{key:50} {entry.licence}\n    {entry.url}{derived}")


@data.command("fetch")
@click.argument("name")
@options("json")
def data_fetch(name: str, as_json: bool) -> None:
    """Fetch one file from its public origin."""
    from discovery_datasets import registry

    from discovery.foundation.errors import InputError

    try:
        fetched = registry.fetch(name)
    except (registry.DataUnavailable, KeyError) as error:
        raise InputError(str(error.args[0])) from None
    print_files([fetched], as_json, {"name": name, **asdict(registry.entry_of(name))})


@data.command("check")
@options("json")
def data_check(as_json: bool) -> None:
    """Check which registered files are present and unaltered."""
    from discovery_datasets import registry

    if as_json:
        print_json([{"name": state.name, "state": state.state} for state in registry.check()])
        return
    for state in registry.check():
        click.echo(f"{state.state:8} {state.name}")


COMMANDS: tuple[click.Command, ...] = (init, check, effects, simulate, data)
