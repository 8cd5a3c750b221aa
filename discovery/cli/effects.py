"""The catalogue of effects, as a command."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from discovery.cli.options import KINDS, options, print_json

if TYPE_CHECKING:
    from collections.abc import Collection


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
    help="List only what a loop tries on a kind of system, and what its declared model has.",
)
@options("json")
def effects(name: str | None, system: str | None, as_json: bool) -> None:
    """List the catalogue of effects and the steps of the mechanics, or show the card of one.

    A loop tries those of its kind that its declared model lacks. The recordings decide on some: laws of an angle need
    an output in one, faults of an input need a force or a voltage, [view] and [controller] replace the mechanics, and
    at a place of a declared system springs and angles decide.
    """
    from discovery.declarations.registry import catalogue, get_effect
    from discovery.mechanics.upgrades import UPGRADES, Upgrade

    if name is None:
        known = sorted({**catalogue(), **UPGRADES}.items())
        listed = known if system is None else [(n, effect) for n, effect in known if n in _of_kind(system)]
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


def _of_kind(name: str) -> frozenset[str]:
    """Return the effects that a loop may try on a kind of system, with its steps of the mechanics and its model."""
    from discovery.equations.lacking import ever_candidates
    from discovery.mechanics.upgrades import UPGRADES
    from discovery.rigs.kinds import KINDS as TRAITS

    kind = TRAITS[name]
    return ever_candidates(kind.searched, kind.unit or "rad") | {*kind.declared, *(UPGRADES if kind.has_rod else ())}


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
        "is tried there, and docs/ADD_AN_EFFECT.md says how to add a law of your own."
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
