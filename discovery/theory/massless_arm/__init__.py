"""The general dynamic model: a point mass on a massless elastica, equations (7) to (9) of the paper.

`model` says what it is, `simulation` moves it, `radau` explains how its stiffness near the straight arm is treated.
The names below load what they need when they are first used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from discovery.foundation.lazy import lazy_names as _lazy_names

if TYPE_CHECKING:
    from discovery.theory.massless_arm.model import GeneralModel as GeneralModel
    from discovery.theory.massless_arm.simulation import simulate_general as simulate_general

_HOMES = {
    "GeneralModel": "discovery.theory.massless_arm.model:GeneralModel",
    "simulate_general": "discovery.theory.massless_arm.simulation:simulate_general",
}

__all__ = list(_HOMES)
__getattr__, __dir__ = _lazy_names(__name__, _HOMES)
