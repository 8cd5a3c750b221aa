"""The catalogue of effects: every class found in `discovery.effects` and behind the entry point group of that name."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from collections.abc import Iterator, Mapping
from functools import cache
from importlib.metadata import entry_points
from types import ModuleType

from discovery.declarations.effect import Effect
from discovery.declarations.forces import ExternalForce, SmoothForce
from discovery.declarations.place import at_place, can_be_placed
from discovery.foundation.arguments import expect
from discovery.foundation.errors import InputError


def _modules() -> Iterator[ModuleType]:
    package = importlib.import_module("discovery.effects")
    for info in pkgutil.iter_modules(package.__path__, "discovery.effects."):
        yield importlib.import_module(info.name)
    for entry in sorted(entry_points(group="discovery.effects"), key=lambda e: e.name):
        yield entry.load()


@cache
def catalogue() -> dict[str, Effect]:
    """Return every known effect by its id, in alphabetical order.

    Other packages add effects through the entry point group ``discovery.effects``, whose members are modules.

    Raises
    ------
    ValueError
        If two classes claim the same id, or two effects a parameter of the same name.

    Examples
    --------
    >>> len(catalogue()) > 40, catalogue()["coulomb_friction"].kind
    (True, 'dissipation')
    """
    found: dict[str, Effect] = {}
    for module in _modules():
        for _, member in inspect.getmembers(module, inspect.isclass):
            if issubclass(member, Effect) and not inspect.isabstract(member) and member.__module__ == module.__name__:
                if member.id() in found:
                    raise ValueError(f"two effects are called {member.id()!r}: {found[member.id()]!r} and {member!r}")
                found[member.id()] = member()
    owner: dict[str, str] = {}
    for name, label in [(p.name, effect.id()) for effect in found.values() for p in effect.parameters()]:
        if owner.setdefault(name, label) != label:
            raise ValueError(f"effects {owner[name]!r} and {label!r} both have a parameter {name!r}: rename one")
    return dict(sorted(found.items()))


def effect_name(effect_id: str) -> str:
    """Return an effect's id, or another one, as words.

    Examples
    --------
    >>> effect_name("coulomb_friction"), effect_name("angle_offset")
    ('Coulomb friction', 'zero offset of the sensor')
    """
    law, at, place = effect_id.partition("_at_")
    effect = catalogue().get(law)
    words = effect.called if effect is not None and effect.called else law
    return f"{words}{at}{place}".replace("_", " ")


def _speaks_of(effect: Effect, word: str) -> bool:
    """Whether the card of an effect holds a word."""
    return word.lower() in f"{effect.id()} {inspect.getdoc(type(effect))} {effect.cite}".lower()


def get_effect(effect_id: str, besides: Mapping[str, Effect] | None = None) -> Effect:
    """Return one effect, a force that no catalogue lists, or one of what is declared besides.

    Parameters
    ----------
    effect_id : str
        Its id, as `catalogue` lists it; ``_at_`` and a place after it for one at a place of a declared system.
    besides : mapping of str to Effect, optional
        Effects beside those of the catalogue, by id.

    Returns
    -------
    Effect

    Raises
    ------
    InputError
        For an unknown id, with the nearest known ones.

    Examples
    --------
    >>> get_effect("quadratic_drag").title()
    'Drag of a body in a still fluid, proportional to the square of its speed'
    """
    import difflib

    expect(effect_id, str, "effect_id", "Give the id of an effect, as `discovery effects` lists them.")
    for unlisted in (ExternalForce, SmoothForce):
        if effect_id == unlisted.id():
            return unlisted()
    known = {**catalogue(), **(besides or {})}
    bare, _, place = effect_id.partition("_at_")
    if place and bare in known and can_be_placed(known[bare]):
        return at_place(known[bare], place)
    if effect_id not in known:
        near = difflib.get_close_matches(effect_id, known, n=3, cutoff=0.4)
        near += [other for other, effect in known.items() if other not in near and _speaks_of(effect, effect_id)]
        hint = f"Did you mean {', '.join(near)}?" if near else "`discovery effects` lists the catalogue."
        raise InputError(f"There is no effect called {effect_id!r}. {hint}")
    return known[effect_id]


def sizes_of(effect_id: str) -> set[str]:
    """Return the parameters of an effect without all of which it is absent: no shapes, conventions and phases."""
    law = get_effect(effect_id)
    return {p.name for p in law.parameters() if not (p.shape or p.fixed) or (p.own and law.reduces_to)}


def simplicity(effect: str, system: str) -> tuple[bool, int, bool, bool]:
    """Return a key that sorts effects, the physically simplest first.

    What imitates others comes last; then no free parameter before one, one before several, a force before a fault of an
    instrument (of the camera, or of the encoder), and a spring or friction before a load that could feed the motion.

    `effect`: id. `system`: kind of system, `discovery.declarations.effect.ARM` or
    `discovery.declarations.effect.OSCILLATOR`.
    """
    declared = get_effect(effect)
    faulty, load = declared.kind in ("sensor", "drive"), declared.kind == "load"
    return declared.pliable, len(declared.fitted(system)), faulty, load
