"""Which effects a model could lack: those of the catalogue that act on its system."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from itertools import product

import sympy as sp

from discovery.declarations.effect import OSCILLATOR, ROTOR, Effect, Mode, Sensor
from discovery.declarations.place import can_be_placed, placed
from discovery.declarations.registry import catalogue, get_effect
from discovery.declarations.symbols import t
from discovery.declarations.units import is_force
from discovery.equations.model import Model
from discovery.mechanics.base import Place

#: What acts on the whole of a declared system, not at one of its places.
_WHOLE = ("drive", "sensor")


def candidates(
    model: Model,
    unit: str = "rad",
    declared: Collection[str] | None = None,
    *,
    turns: bool = True,
    spins: bool = False,
    winds: bool = False,
    several: bool = True,
    dated: bool = True,
) -> tuple[str, ...]:
    """Return the effects that could be missing: those that act on this system, not in the model, not in its base.

    `unit`: unit of an oscillator's coordinate: laws of an angle ask for radians. `declared`: effects of the model that
    its rig file declares, which say whether anything ties the coordinate; all otherwise. `turns`: whether the recorded
    motion turns back, which laws of memory ask for. `spins`: whether it goes on and on through full turns, which no
    law of the place does but one that is the same in each of them. `winds`: whether an angle that is read goes
    farther than half a turn from its zero, which no picture shows as a distance. `several`: whether it was recorded
    several times: in one recording a law whose values differ between them is no other than the one that it contains.
    `dated`: whether an input, or rest before it, says when a motion began: if nothing does, one start is as late as
    another.
    """
    placed_at = model.mechanics.places()
    acting = _at_places(model) if placed_at else _on_the_coordinate(model, unit, declared)
    # Beside a law that contains it, a law has nothing of its own.
    contained = {law for e in model.effects for law in get_effect(e).reduces_to}

    def is_shown(name: str) -> bool:
        effect = get_effect(name)
        turning = (placed_at[effect.place].unit if effect.place else unit) in ("rad", "1")
        held = (effect.anchored or effect.kind == "potential") and not effect.angular
        read = not effect.pictured or not (winds or "/s" in unit or is_force(unit))
        told = (turns or not effect.remembers) and (several or not (effect.own() and effect.reduces_to))
        told = told and (dated or not _is_late(effect))
        return read and told and name not in contained and not (spins and turning and held)

    return tuple(filter(is_shown, acting))


def eventual_candidates(
    model: Model, unit: str = "rad", declared: Collection[str] | None = None, **recorded: bool
) -> tuple[str, ...]:
    """Return the candidates, and those that could be missing once one of them ties the body to a place."""
    models = [
        model,
        *(model.with_effect(e) for e in candidates(model, unit, declared, **recorded) if get_effect(e).ties),
    ]
    return tuple(dict.fromkeys(e for m in models for e in candidates(m, unit, declared, **recorded)))


def _on_the_coordinate(model: Model, unit: str, declared: Collection[str] | None) -> tuple[str, ...]:
    """Return the effects that a system without places could lack."""
    base = model.mechanics
    tied = any(get_effect(e).kind == "potential" for e in (model.effects if declared is None else declared))
    has, provided = base.has - ({ROTOR} if tied else set()), base.provides | (base.provides_tied if tied else set())
    held = base.anchored and (ROTOR not in has or any(get_effect(e).ties for e in model.effects))
    return tuple(
        e
        for e, effect in catalogue().items()
        if base.system in effect.systems
        and e not in model.effects
        and not provided.intersection({e, *effect.reduces_to})
        and (base.system.has_rod or unit == "rad" or not effect.angular)
        and (base.push() is not None or not isinstance(effect, Mode))
        and _is_heard(effect, model)
        and (held or not effect.anchored or (base.anchored and effect.ties))
        and (not effect.needs or effect.needs in has)
    )


def ever_candidates(bases: Iterable[str], unit: str = "rad") -> frozenset[str]:
    """Return the effects that models on some bases may lack, whatever a rig file declares: without a base, at places.

    `bases`: names of bases that are built in; none of them stands for every declared system. `unit`: as in
    `candidates`.

    Examples
    --------
    >>> "cogging" in ever_candidates(["falling_body"]), "cogging" in ever_candidates(["servo"])
    (False, True)
    """
    found = frozenset(e for base in bases for e in eventual_candidates(Model(base, ()), unit))
    return found or frozenset(e for e, effect in catalogue().items() if _has_a_place(effect))


def _is_late(effect: Effect) -> bool:
    """Return whether all of what an instrument reads is as old, whatever else it does."""
    return isinstance(effect, Sensor) and bool(late := sp.sympify(effect.lateness())) and not late.has(t)


def _has_a_place(effect: Effect) -> bool:
    """Return whether some declared system has a place for an effect, or an instrument or an input that it changes."""
    if effect.kind in _WHOLE:
        return OSCILLATOR in effect.systems
    ties = product((False, True), repeat=2)
    return can_be_placed(effect) and any(Place("rad", tied, 1.0, sprung).suits(effect) for tied, sprung in ties)


def _is_heard(effect: Effect, model: Model) -> bool:
    """Return whether an effect of the drive, if it is one, changes an input that there is."""
    if effect.kind != "drive" or model.mechanics.system.has_rod:
        return True
    return model.mechanics.is_pushed and model.known.get("g") != 0.0


def _at_places(model: Model) -> tuple[str, ...]:
    """Return the effects that a declared system could lack: forces at each of its places, and those of instruments."""
    found = []
    for e, effect in catalogue().items():
        if effect.kind in _WHOLE and OSCILLATOR in effect.systems:
            found += [e] if _is_heard(effect, model) else []
        elif can_be_placed(effect):
            found += [placed(e, name) for name, place in model.mechanics.places().items() if place.suits(effect)]
    return tuple(e for e in found if e not in model.effects)
