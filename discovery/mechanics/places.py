"""Which effects have a place on a system."""

from __future__ import annotations

from discovery.declarations.effect import Effect
from discovery.declarations.place import can_be_placed, placed
from discovery.declarations.registry import catalogue
from discovery.foundation.errors import InputError
from discovery.mechanics.base import Base

#: What changes the whole of a declared system, not a force at one of its places.
_WHOLE = ("drive", "sensor")


def check_place(base: Base, effect: Effect) -> None:
    """Refuse a force without a place where a system has several, and one at a place that it has not.

    Raises
    ------
    InputError
        With the ids that fit.
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
