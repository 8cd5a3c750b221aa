"""The names of parameters that some base or effect declares."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from typing import TYPE_CHECKING

from discovery.declarations.registry import catalogue
from discovery.declarations.smooth_force import ExternalForce, SmoothForce
from discovery.foundation.arguments import check_names
from discovery.mechanics import base_names, get_base

if TYPE_CHECKING:
    from discovery.equations.model import Model


@cache
def _declared() -> frozenset[str]:
    """Return the parameters of all bases that are built in and of all effects."""
    effects = [*catalogue().values(), ExternalForce(), SmoothForce()]
    bases = [p.name for name in base_names() for p in get_base(name).parameters()]
    return frozenset([*bases, *(p.name for effect in effects for p in effect.parameters())])


def check_declared(model: Model, names: Iterable[str]) -> None:
    """Refuse names of parameters that neither a model nor the catalogue has.

    What a rig file states serves every model of it: parameters of effects that a model lacks are no mistake, and
    initial states of recordings neither.

    Raises
    ------
    InputError
        With the parameters that the model has.
    """
    unusual = [n for n in names if n not in _declared() and not (isinstance(n, str) and n.endswith("]"))]
    if not unusual:
        return
    places = tuple(f"_{place}" for place in model.mechanics.places())
    own = model.parameters
    strangers = [n for n in unusual if n not in own and not (places and str(n).endswith(places))]
    check_names(strangers, own, "The model", "parameter")
