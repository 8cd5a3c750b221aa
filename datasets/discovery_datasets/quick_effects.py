"""Effects in the rod, in the joint at its root, in friction and clock, which only the compiled engine knows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from discovery_datasets.disturbances import Disturbance


@dataclass(frozen=True)
class QuickDisturbance(Disturbance):
    """A disturbance that acts through `physics` or a table, and that `twin.simulate` refuses."""

    quick_only: ClassVar[bool] = True


@dataclass(frozen=True)
class MaterialNonlinearity(QuickDisturbance):
    """Moment EI (kappa + cubic * kappa^3), with `cubic` in m^2."""

    cubic: float
    id: ClassVar[str] = "material_nonlinearity"
    acts: ClassVar[Mapping[str, str]] = {"cubic": "cubic"}


@dataclass(frozen=True)
class QuadraticStiffness(QuickDisturbance):
    """Rod that is stiffer on one side: moment EI (kappa + quadratic * kappa^2), with `quadratic` in m."""

    quadratic: float
    id: ClassVar[str] = "quadratic_stiffness"
    acts: ClassVar[Mapping[str, str]] = {"quadratic": "quadratic"}


@dataclass(frozen=True)
class AmplitudeDependentDamping(QuickDisturbance):
    """Friction that grows with the deflection d: force -loss * d^2 * v, v the tip's velocity over the table.

    `loss` in N s/(m rad^2).
    """

    loss: float
    id: ClassVar[str] = "amplitude_dependent_damping"
    acts: ClassVar[Mapping[str, str]] = {"deflection_friction": "loss"}


@dataclass(frozen=True)
class NonlinearStructuralDamping(QuickDisturbance):
    """Loss in the rod that grows with the deflection d: force -loss * d^2 * v, v the tip's velocity seen from the hub.

    `loss` in N s/(m rad^2).
    """

    loss: float
    id: ClassVar[str] = "nonlinear_structural_damping"
    acts: ClassVar[Mapping[str, str]] = {"deflection_loss": "loss"}


@dataclass(frozen=True)
class Hysteresis(QuickDisturbance):
    """Fibres that rub: a Bouc-Wen moment of at most `moment` [N m], yielding at a `curvature` [1/m], everywhere."""

    moment: float
    curvature: float
    id: ClassVar[str] = "hysteresis"
    acts: ClassVar[Mapping[str, str]] = {"fibre_moment": "moment", "fibre_yield": "curvature"}


@dataclass(frozen=True)
class TipRotaryInertia(QuickDisturbance):
    """Disc whose bearing is stuck: the end of the rod must turn its `inertia` [kg m^2]."""

    inertia: float
    id: ClassVar[str] = "tip_rotary_inertia"
    acts: ClassVar[Mapping[str, str]] = {"rotary_inertia": "inertia"}


@dataclass(frozen=True)
class BaseCompliance(QuickDisturbance):
    """Torsion spring of `stiffness` [N m/rad] between hub and rod."""

    stiffness: float
    id: ClassVar[str] = "base_compliance"

    def physics(self) -> dict[str, float]:
        """See the base class."""
        return {"joint": 1.0, "joint_stiffness": self.stiffness}


@dataclass(frozen=True)
class BaseBacklash(QuickDisturbance):
    """Play of +-`half_width` [rad] between hub and rod.

    The contact has a `stiffness` [N m/rad] and a `damping` [N m s/rad].
    """

    half_width: float
    stiffness: float
    damping: float
    id: ClassVar[str] = "base_backlash"

    def physics(self) -> dict[str, float]:
        """See the base class."""
        return {
            "joint": 1.0,
            "joint_play": self.half_width,
            "joint_stiffness": self.stiffness,
            "joint_damping": self.damping,
        }


@dataclass(frozen=True)
class BaseHysteresis(QuickDisturbance):
    """Clamp that slips: a spring of `stiffness` [N m/rad] beside a Bouc-Wen torque.

    The torque is at most `moment` [N m] and yields at `angle` [rad].
    """

    stiffness: float
    moment: float
    angle: float
    id: ClassVar[str] = "base_hysteresis"

    def physics(self) -> dict[str, float]:
        """See the base class."""
        return {
            "joint": 1.0,
            "joint_stiffness": self.stiffness,
            "joint_moment": self.moment,
            "joint_yield": self.angle,
        }


@dataclass(frozen=True)
class EquilibriumOffset(QuickDisturbance):
    """Rod clamped at an `angle` [rad] to the direction that the encoder means."""

    angle: float
    id: ClassVar[str] = "equilibrium_offset"

    def base_motion(self, angle: Any, rate: Any, acceleration: Any) -> Any:
        """See the base class."""
        return angle + self.angle, rate, acceleration


@dataclass(frozen=True)
class InputGain(QuickDisturbance):
    """Hub that turns (1 + error) times as far as the encoder says."""

    error: float
    id: ClassVar[str] = "input_gain"

    def base_motion(self, angle: Any, rate: Any, acceleration: Any) -> Any:
        """See the base class."""
        return (1 + self.error) * angle, (1 + self.error) * rate, (1 + self.error) * acceleration


@dataclass(frozen=True)
class AngleOffset(QuickDisturbance):
    """Camera turned by `angle` [rad] against the encoder's zero: what it reports is turned as much."""

    angle: float
    id: ClassVar[str] = "angle_offset"

    def reading(self, tip: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """See the base class."""
        return tip * np.exp(1j * self.angle)


@dataclass(frozen=True)
class StribeckFriction(QuickDisturbance):
    """Dry friction that is higher near rest: F = (force + breakaway exp(-(v/stribeck)^2)) tanh(v/speed) [N], [m/s]."""

    force: float
    breakaway: float
    stribeck: float
    speed: float = 2e-3
    id: ClassVar[str] = "stribeck_friction"
    acts: ClassVar[Mapping[str, str]] = {
        "dry": "force",
        "breakaway": "breakaway",
        "stribeck_speed": "stribeck",
        "dry_speed": "speed",
    }


@dataclass(frozen=True)
class AsymmetricViscousDamping(QuickDisturbance):
    """Viscous friction of the disc, greater by `coefficient` [N s/m] as the tip turns forward, else less."""

    coefficient: float
    id: ClassVar[str] = "asymmetric_viscous_damping"
    acts: ClassVar[Mapping[str, str]] = {"asymmetry": "coefficient"}


@dataclass(frozen=True)
class TimeBaseError(QuickDisturbance):
    """Camera whose clock loses `drift` [-], or whose frames wait up to `wait` [s] for a packet sent every `period` [s].

    At time t it reports where the tip was at t - drift * t - wait * frac(t / period).
    """

    drift: float = 0.0
    wait: float = 0.0
    period: float = 1.0
    id: ClassVar[str] = "time_base_error"

    def reading_time(self, time: NDArray[np.float64]) -> NDArray[np.float64]:
        """See the base class."""
        return time - self.drift * time - self.wait * np.mod(time / self.period, 1.0)


@dataclass(frozen=True)
class Taper(QuickDisturbance):
    """Rod whose rigidity is (1 + share) of its mean at the root and (1 - share) at the tip, linear between them."""

    share: float
    id: ClassVar[str] = "taper"
    acts: ClassVar[Mapping[str, str]] = {"taper": "share"}


@dataclass(frozen=True)
class PowerFriction(QuickDisturbance):
    """Friction of the disc of neither kind: force = coefficient * v^power [N], v in m/s."""

    coefficient: float
    power: float
    id: ClassVar[str] = "power_friction"
    acts: ClassVar[Mapping[str, str]] = {"power_loss": "coefficient", "power": "power"}


QUICK_EFFECTS: dict[str, type[Disturbance]] = {
    kind.id: kind
    for kind in (
        MaterialNonlinearity,
        QuadraticStiffness,
        AmplitudeDependentDamping,
        NonlinearStructuralDamping,
        Hysteresis,
        TipRotaryInertia,
        BaseCompliance,
        BaseBacklash,
        BaseHysteresis,
        EquilibriumOffset,
        InputGain,
        AngleOffset,
        StribeckFriction,
        AsymmetricViscousDamping,
        TimeBaseError,
    )
}
"""Further effects by the id that users see."""
