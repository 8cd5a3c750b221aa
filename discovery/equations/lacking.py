"""Which effects a model could lack: those of the catalogue that act on its system."""

from __future__ import annotations

from discovery.declarations.effect import OSCILLATOR, Effect, Mode
from discovery.declarations.place import can_be_placed, placed
from discovery.declarations.registry import catalogue
from discovery.equations.model import Model

__all__ = ["candidates"]


def candidates(model: Model, unit: str = "rad") -> tuple[str, ...]:
    """Return the effects that could be missing: those that act on this system, not in the model, not in its base.

    Parameters
    ----------
    model : Model
        The model.
    unit : str
        Unit of an oscillator's coordinate: laws of an angle ask for radians.
    """
    base = model.mechanics
    if base.places():
        return _at_places(model)
    return tuple(
        e
        for e, effect in catalogue().items()
        if base.system in effect.systems
        and e not in model.effects
        and e not in base.provides
        and (base.system.has_rod or unit == "rad" or not effect.angular)
        and (base.push() is not None or not isinstance(effect, Mode))
        and _is_heard(effect, model)
        and (base.anchored or not effect.anchored)
        and (not effect.needs or effect.needs in base.has)
    )


def _is_heard(effect: Effect, model: Model) -> bool:
    """Return whether an effect of the drive, if it is one, changes an input that there is."""
    if effect.kind != "drive" or model.mechanics.system.has_rod:
        return True
    return model.mechanics.is_pushed and model.known.get("g") != 0.0


def _at_places(model: Model) -> tuple[str, ...]:
    """Return the effects that a declared system could lack: forces at each of its places, and those of instruments."""
    found = []
    for e, effect in catalogue().items():
        if effect.kind in ("drive", "sensor") and OSCILLATOR in effect.systems:
            found += [e] if _is_heard(effect, model) else []
        elif can_be_placed(effect):
            found += [placed(e, name) for name, place in model.mechanics.places().items() if place.suits(effect)]
    return tuple(e for e in found if e not in model.effects)
