"""The catalogue of effects, as a command, with its formulas as one line that a console can show."""

from __future__ import annotations

import inspect
import re
from collections import deque
from collections.abc import Iterator
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
        from discovery.report.references import paper_numbers

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


_TOKEN = re.compile(r"\\[A-Za-z]+|\\.|\s+|.", re.DOTALL)
_WORDS = {
    r"\,": " ", r"\ ": " ", r"\to": " -> ", r"\le": " <= ", r"\approx": " ~ ", r"\dots": "...", r"\int": " integral",
    r"\varrho": " rho", r"\varphi": " phi", r"\left": "", r"\right": "", r"\Bigl": "", r"\Bigr": "",
}  # fmt: skip
_FRACTIONS = (r"\frac", r"\tfrac")
_FUNCTIONS = (r"\sin", r"\cos", r"\arctan", r"\max")
_DOTS = {r"\dot": "'", r"\ddot": "''"}


def plain_text(docstring: str) -> str:
    """Return a docstring without its markup: formulas as plain text, displayed ones indented, each on its line."""

    def shown(found: re.Match[str]) -> str:
        return "\n".join(f"    {plain_formula(part)}" for part in re.split(r",?\\qquad", found[1]))

    text = re.sub(r"^\.\. math:: ?(.*(?:\n {4,}.*)*)", shown, docstring, flags=re.MULTILINE)
    return re.sub(r":math:`([^`]*)`|``([^`]*)``", lambda m: plain_formula(m[1]) if m[1] else m[2], text)


def plain_formula(latex: str) -> str:
    r"""Return a formula in LaTeX as plain text; a dot over a symbol becomes a prime.

    Examples
    --------
    >>> plain_formula(r"D = \tfrac13\, c_2\, v_t^3"), plain_formula(r"F = -\frac{g}{l}\, \dot\theta_t^2")
    ('D = 1/3 c_2 v_t^3', "F = -g/l theta_t'^2")
    """
    text = "".join(_pieces(deque(_TOKEN.findall(latex))))
    text = re.sub(r"('+)\s*(_(?:\w|\(\w+\))+)", r"\2\1", text)  # the prime of theta_t stands last
    text = re.sub(r"\s*([_^'),;\]])", r"\1", text)
    text = re.sub(r"([_^(\[])\s+", r"\1", text)
    text = re.sub(r"\| *([\w']+) *\|", r"|\1|", text)
    return re.sub(r"(^|[=(,] *)- ", r"\1-", " ".join(text.split()))


def _pieces(tokens: deque[str], end: str = "") -> Iterator[str]:
    while tokens:
        token = tokens.popleft()
        if token == end:
            return
        yield _piece(token, tokens)


def _piece(token: str, tokens: deque[str]) -> str:
    """Return what a token and its arguments stand for."""
    if token == "{":
        return "".join(_pieces(tokens, "}"))
    if token in _FRACTIONS:
        return f" {_whole(_argument(tokens))}/{_whole(_argument(tokens))} "
    if token == r"\sqrt":
        first = _argument(tokens)
        if first != "[":
            return f" sqrt({first.strip()})"
        degree = "".join(_pieces(tokens, "]"))
        return f" {_whole(_argument(tokens))}^(1/{degree})"
    if token in _DOTS:
        return f" {_argument(tokens).strip()}{_DOTS[token]} "
    if token == r"\operatorname" or token in _FUNCTIONS:
        name = token[1:] if token in _FUNCTIONS else _argument(tokens)
        of = tokens and tokens[0] in _FRACTIONS
        return f" {name}({_argument(tokens).strip()})" if of else f" {name}{_space(tokens)}"
    if token in (r"\mathrm", r"\text"):
        return _argument(tokens)
    if token in ("_", "^"):
        found = _argument(tokens).strip()
        return token + (found if found.isalnum() else f"({found})")
    if token in _WORDS or not token.startswith("\\"):
        return _WORDS.get(token, token)
    return f" {token[1:]}{_space(tokens)}"


def _argument(tokens: deque[str]) -> str:
    while tokens and not tokens[0].strip():
        tokens.popleft()
    return _piece(tokens.popleft(), tokens) if tokens else ""


def _space(tokens: deque[str]) -> str:
    """Return the blank after a word that something else than a bracket or an index follows."""
    return " " if tokens and re.match(r"\\?[A-Za-z0-9]", tokens[0]) else ""


def _whole(text: str) -> str:
    """Put what is more than one factor in brackets."""
    text = " ".join(text.split())
    return text if re.fullmatch(r"[\w^']*|\w+\([^()]*\)", text) else f"({text})"
