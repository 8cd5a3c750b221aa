"""An added effect that reads like an error of what the rig file states."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from discovery.declarations.registry import catalogue, get_effect
from discovery.diagnosis.caution import Caution
from discovery.estimation.fit import Fit
from discovery.estimation.problem import STATED
from discovery.rigs.quantities import QUANTITIES

#: Springs that pull alike to both sides: the sine of an angle is such a one, too, where it is read as a length.
_SYMMETRIC = ("cubic_stiffness", "quintic_stiffness")


@dataclass(frozen=True)
class StandIn:
    """An effect whose only parameter reads like a relative error of a quantity of the rig file."""

    #: effect, parameter: its id, and the name of its parameter.
    effect: str
    parameter: str
    quantity: str  # key of the rig file without its unit
    share: float  # the parameter
    #: stated, sd: what the rig file says of the quantity [SI].
    stated: float
    sd: float
    unit: str  # their unit

    @property
    def value(self) -> float:
        """What the rig file would have to state for the same motion without the effect [SI]."""
        return self.stated * (1 + self.share)

    @property
    def relative_sd(self) -> float:
        """Standard deviation of the parameter that comes from the rig file."""
        return self.sd / self.stated

    @property
    def z(self) -> float:
        """By how many of its standard deviations the rig file would have to err."""
        return self.share / self.relative_sd

    @property
    def doubtful(self) -> bool:
        """Whether the rig file may err by as much: it would contradict nothing."""
        return abs(self.z) <= STATED

    def summary(self) -> dict[str, Any]:
        """Return a JSON-ready description."""
        return {
            "quantity": self.quantity,
            "unit": self.unit,
            "value": self.value,
            "stated": self.stated,
            "sd": self.sd,
            "z": self.z,
            "doubtful": self.doubtful,
        }


def stand_in(fitted: Fit, effect: str) -> StandIn | None:
    """Return what an added effect may stand for; None where the rig file is surely right, or does not say."""
    experiment = fitted.problem.bench.experiments[0]
    quantity = get_effect(effect).stands_for if experiment.system.has_rod and effect in catalogue() else ""
    stated = getattr(experiment.rig, quantity) if quantity else None
    if stated is None or not stated.sd:
        return None
    (parameter,) = get_effect(effect).parameters()
    share, unit = fitted.values[parameter.name], QUANTITIES[quantity].unit
    return StandIn(effect, parameter.name, quantity=quantity, share=share, stated=stated.value, sd=stated.sd, unit=unit)


def seen_aside(fitted: Fit, added: Iterable[str]) -> Caution | None:
    """Return an added spring that gives way, in metres, as a bob seen from the side seems to; None without one."""
    experiment = fitted.problem.bench.experiments[0]
    system = experiment.system
    if experiment.drive is not None or system.has_rod or experiment.rig.system or experiment.coordinate_unit != "m":
        return None
    springs = {p.name: e for e in added if e in _SYMMETRIC for p in get_effect(e).parameters()}
    soft = next((name for name in springs if fitted.values[name] < 0.0), None)
    return None if soft is None else Caution("seen_aside", soft, springs[soft])
