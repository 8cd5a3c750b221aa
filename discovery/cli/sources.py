"""What a run starts from, as commands: the catalogue of effects, the twin, the public measured data."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from discovery.cli.options import KINDS, PATH, SEED, options, print_files, print_json

if TYPE_CHECKING:
    from collections.abc import Collection

    from discovery_datasets.disturbances import Disturbance

__all__ = ["COMMANDS", "MANOEUVRES"]

#: Manoeuvres of the twin, named here so that the help is there at once.
MANOEUVRES = ("train_paper", "train_large", "holdout_inside", "holdout_beyond")


def _names(context: click.Context, _: click.Parameter, begun: str) -> list[str]:
    """Return the effects whose names begin so, for completion in a shell."""
    from discovery.declarations.registry import catalogue
    from discovery.mechanics.upgrades import UPGRADES

    return [name for name in sorted({**catalogue(), **UPGRADES}) if name.startswith(begun)]


@click.command()
@click.argument("name", required=False, shell_complete=_names)
@click.option(
    "--system",
    type=click.Choice(KINDS),
    help="List only what applies to a kind of system; the laws of all but the flexible arm are the same.",
)
@options("json")
def effects(name: str | None, system: str | None, as_json: bool) -> None:
    """List the catalogue of effects and the steps of the mechanics, or show the card of one.

    A loop screens those of its system that neither its mechanics nor its declared model contain.
    """
    from discovery.declarations.registry import catalogue, get_effect
    from discovery.declarations.systems import System
    from discovery.mechanics.upgrades import UPGRADES, Upgrade

    if name is None:
        known = sorted({**catalogue(), **UPGRADES}.items())
        listed = [(name, effect) for name, effect in known if system is None or System.of(system) in effect.systems]
        if as_json:
            print_json([_card(effect_id, effect) for effect_id, effect in listed])
            return
        for effect_id, effect in listed:
            click.echo(f"{effect_id:28} {effect.kind:12} {effect.title()}")
        return
    if system is not None:
        raise click.UsageError("--system picks from the list; the card of one effect says where it applies.")
    import inspect

    from discovery.cli.plain_formula import plain_text

    effect = get_effect(name, UPGRADES)
    if as_json:
        print_json(_card(name, effect))
        return
    click.echo(f"{name} ({effect.kind}; {', '.join(sorted(effect.systems))})\n")
    described = inspect.getdoc(type(effect)) or ""
    click.echo(plain_text(described))
    if "\\dot" in described or "\\ddot" in described:
        click.echo("\nx' is the rate of x.")
    if isinstance(effect, Upgrade):
        click.echo(f"\n{effect.switch()}")
    click.echo(f"\nSource: {effect.cite}")
    if "source paper" in effect.cite:
        from discovery.report.paper import paper_numbers

        click.echo(f"The paper: {paper_numbers()['source']}")
    click.echo(f"{_applies(effect.systems)}\n")
    _print_parameters(effect)


def _print_parameters(effect: Any) -> None:
    """Print the parameters of an effect, in radians where only an arm has it, and what q and u in a unit are."""
    from discovery.declarations.units import in_coordinate

    parameters, own = effect.parameters(), set(effect.systems) == {"flexible_arm"}
    units = {p.name: in_coordinate(p.unit, "rad" if own else "q") for p in parameters}
    for p in parameters:
        click.echo(f"  {p.name:10} [{units[p.name]}]  {p.meaning}; from {p.bounds[0]:g} to {p.bounds[1]:g}")
    symbols = {"q": "q is the unit of the coordinate", "u": "u is the unit of the input"}
    used = {factor.partition("^")[0] for unit in units.values() for factor in unit.split()}
    click.echo(
        "\n  Bounds are in units of the motion itself: 1/omega of its small swings, its and the input's amplitude."
    )
    if told := [words for symbol, words in symbols.items() if symbol in used]:
        click.echo("\n  " + "; ".join(told) + ".")


def _applies(systems: Collection[str]) -> str:
    """Say where an effect applies, and what to do where it does not."""
    words = {"flexible_arm": "a flexible arm", "oscillator": "any other system"}
    where = f"Applies to {' and to '.join(words[system] for system in sorted(systems))}."
    others = sorted({*words} - {*systems})
    if not others:
        return where
    return (
        f"{where} On {words[others[0]]} it cannot be declared: `discovery effects --system {others[0]}` lists what "
        "can, and docs/ADD_AN_EFFECT.md says how to add a law of your own."
    )


def _card(effect_id: str, effect: Any) -> dict[str, Any]:
    """Return what the catalogue says of an effect or an upgrade of the mechanics."""
    from discovery.mechanics.upgrades import Upgrade

    parameters = [
        {"name": p.name, "unit": p.unit, "meaning": p.meaning, "bounds": list(p.bounds)} for p in effect.parameters()
    ]
    told = {"id": effect_id, "kind": effect.kind, "title": effect.title(), "systems": sorted(effect.systems)}
    switch = effect.switch() if isinstance(effect, Upgrade) else None
    return {**told, "source": effect.cite, "parameters": parameters, "switch": switch}


def _parameters(kind: type[Disturbance]) -> dict[str, float | None]:
    """Return the parameters of what the twin can hide with their defaults, None where a value must be given."""
    from dataclasses import MISSING, fields

    return {f.name: None if f.default is MISSING else f.default for f in fields(kind)}


def _hidden(text: str) -> Disturbance:
    """Return what one ``--effect`` names.

    Raises
    ------
    InputError
        With the parameters of the effect, if they are not those that are given.
    """
    from math import isfinite

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
    import inspect

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


COMMANDS: tuple[click.Command, ...] = (effects, simulate, data)
