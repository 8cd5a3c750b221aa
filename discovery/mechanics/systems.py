"""The systems that were declared in this process, by the name of their base, and which effects have a place on them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from discovery.declarations.effect import Effect
from discovery.declarations.place import can_be_placed, placed
from discovery.declarations.registry import catalogue
from discovery.declarations.system import SystemDeclaration
from discovery.foundation.errors import InputError
from discovery.mechanics.base import Base
from discovery.mechanics.declared import DeclaredBase
from discovery.mechanics.declared_equations import coordinates_of, is_moved_by_input, read_equations

_DECLARED: dict[str, DeclaredBase] = {}
#: What changes the whole of a declared system, not a force at one of its places.
_WHOLE = ("drive", "sensor")


def declare(declaration: SystemDeclaration) -> str:
    """Make a system known, and return the name of its base, for `discovery.equations.model.Model`.

    Raises InputError where a text of it cannot be read, units do not fit, or a coordinate has no inertia: with the key.
    """
    if declaration.identity not in _DECLARED:
        equations = read_equations(declaration)
        words = {
            "__doc__": DeclaredBase.__doc__,
            "name": declaration.identity,
            "n_coordinates": len(declaration.coordinates),
            "declaration": declaration,
            "equations": equations,
            "input_moves": is_moved_by_input(equations),
        }
        base = type("Declared", (DeclaredBase,), words)()
        _check(base)
        _DECLARED[declaration.identity] = base
    return declaration.identity


def system_base(declaration: SystemDeclaration) -> DeclaredBase:
    """Return the base of a system, which is made known; errors as in `declare`."""
    return _DECLARED[declare(declaration)]


def declared_base(name: str) -> DeclaredBase | None:
    """Return the base of a declared system; None where none of that name was declared."""
    return _DECLARED.get(name)


def declaration_of(base: str) -> SystemDeclaration | None:
    """Return what was declared of a base; None of one that is built in."""
    return _DECLARED[base].declaration if base in _DECLARED else None


def know_system(description: Mapping[str, Any]) -> None:
    """Make the system known that a model's description holds, if it holds one."""
    if "system" in description:
        declare(SystemDeclaration.from_dict(description["system"]))


def _check(base: DeclaredBase) -> None:
    """Refuse a system whose inertia is not that of bodies, or an output that never moves."""
    mass = base.inertia
    if not np.all(np.linalg.eigvalsh(mass) > 0):
        names = ", ".join(base.declaration.coordinates)
        raise InputError(
            f"key 'kinetic': the energy of {names} is not positive for every motion. Give each coordinate an inertia."
        )
    q, rates, accelerations = coordinates_of(len(base.declaration.coordinates))
    read = {"output": base.equations.output, **{f"also.{n}": law for n, (law, _) in base.equations.also.items()}}
    for key, law in read.items():
        if not law.free_symbols & {*q, *rates, *accelerations}:
            raise InputError(f"key {key!r}: no coordinate stands in it. Write what the instrument reads of them.")
        if (order := base.order_of(law)) < base.order and base.slopes(law, order).any():
            raise InputError(
                f"key {key!r}: it is read beside a rate or an acceleration, and is less often differentiated. "
                "Make it the output, and read that beside it: a motion begins where its output does."
            )
    if base.declaration.input is None and not base.gradient.any():
        raise InputError(
            "key 'output': at rest it does not change with any coordinate, and nothing drives the system: it does not "
            "tell where a motion begins. Make another reading the output, as another axis of the sensor, and read this "
            "one beside it, in also."
        )


def check_place(base: Base, effect: Effect) -> None:
    """Refuse a force without a place where a system has several, and one at a place that it has not.

    Raises InputError with the ids that fit.
    """
    places, name = base.places(), effect.id()
    if effect.place and effect.place not in places:
        known = f"Its places are {', '.join(places)}." if places else "Only a system declared in [system] has places."
        raise InputError(f"Effect {name!r} acts at {effect.place!r}, which is no place of the system. {known}")
    if not places or effect.place or name not in catalogue() or effect.kind in _WHOLE:
        return
    if not can_be_placed(effect):
        raise InputError(f"Effect {name!r} has no meaning on a declared system. Remove it.")
    raise InputError(
        f"Effect {name!r} needs a place on a declared system. Write {' or '.join(placed(name, p) for p in places)}."
    )
