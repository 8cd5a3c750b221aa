"""The general dynamic model: a point mass on a massless elastica, equations (7) to (9) of the paper.

`model` says what it is, `simulation` moves it, `radau` explains how its stiffness near the straight arm is treated.
The names below load what they need when they are first used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from discovery.theory.massless_arm.model import GeneralModel as GeneralModel
    from discovery.theory.massless_arm.simulation import simulate_general as simulate_general

_HOMES = {
    "GeneralModel": "discovery.theory.massless_arm.model:GeneralModel",
    "simulate_general": "discovery.theory.massless_arm.simulation:simulate_general",
}

__all__ = [
    "GeneralModel",
    "simulate_general",
]


def __getattr__(name: str) -> Any:
    try:
        home, _, attribute = _HOMES[name].partition(":")
    except KeyError:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}") from None
    value = globals()[name] = getattr(import_module(home), attribute)
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
