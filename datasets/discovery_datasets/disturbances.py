"""Effects that an experimenter did not declare: what the twin can hide in a recording.

Each class is one effect with its physical parameters in SI units, and overrides only the hook at which it acts: a force
on the tip, gravity, the rod's rest shape or material, the motion that the base really makes, or what an instrument
reports. Positions, velocities and forces in the plane are complex numbers ``x + 1j * y``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import cos, sin, tanh
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

STANDARD_GRAVITY = 9.80665  # m/s^2


@dataclass(frozen=True)
class Disturbance:
    """No effect; the hooks and their neutral values."""

    id: ClassVar[str] = ""
    quick_only: ClassVar[bool] = False  # acts through the compiled engine alone
    #: Coefficients of `engine.Physics`, with the parameters here that they are.
    acts: ClassVar[Mapping[str, str]] = {}

    def tip_force(self, time: float, position: complex, velocity: complex) -> complex:
        """Force on the disc [N]."""
        return 0j

    def gravity(self) -> complex:
        """Acceleration of free fall in the plane [m/s^2]."""
        return 0j

    def rest_curvature(self) -> float:
        """Uniform curvature of the unloaded rod [1/m]."""
        return 0.0

    def stiffness_factor(self, time: Any) -> Any:
        """Flexural rigidity over its nominal value, at one time or many."""
        return 1.0

    def retardation_time(self) -> float:
        """Kelvin-Voigt time: moment per curvature rate over flexural rigidity [s]."""
        return 0.0

    def relaxation(self) -> tuple[float, float]:
        """Relaxing part of the flexural rigidity over the lasting part, and relaxation time [s]."""
        return 0.0, 1.0

    def base_motion(self, angle: Any, rate: Any, acceleration: Any) -> tuple[Any, Any, Any]:
        """Angle [rad], rate and acceleration of the base where the encoder reads the given ones, once or often."""
        return angle, rate, acceleration

    def physics(self) -> dict[str, float]:
        """Coefficients of `engine.Physics` that are not zero."""
        return {coefficient: getattr(self, own) for coefficient, own in self.acts.items()}

    def push(self, time: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Force on the disc that depends on time alone [N]."""
        return np.zeros(time.shape, complex)

    def friction_factor(self, time: NDArray[np.float64]) -> NDArray[np.float64]:
        """Viscous friction of the disc over its nominal value."""
        return np.ones(time.shape)

    def lost_mass(self, time: NDArray[np.float64]) -> NDArray[np.float64]:
        """Mass that the tip has lost [kg]."""
        return np.zeros(time.shape)

    def tension(self, hub_angle: NDArray[np.float64]) -> NDArray[np.float64]:
        """Tension of the cable [N] at an angle of the hub."""
        return np.zeros(hub_angle.shape)

    def reading_delay(self) -> float:
        """Time by which the camera is late [s]."""
        return 0.0

    def reading_time(self, time: NDArray[np.float64]) -> NDArray[np.float64]:
        """Time at which the tip was where the camera reports it at `time` [s]."""
        return time - self.reading_delay()

    def reading(self, tip: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """Tip position that the camera reports [m] where the tip is at `tip`."""
        return tip


@dataclass(frozen=True)
class CoulombFriction(Disturbance):
    """Dry friction between disc and table, against the velocity v: F = force * tanh(v / speed).

    `force` [N]; `speed` [m/s] is the width of the regularised sign.
    """

    force: float
    speed: float = 2e-3
    id: ClassVar[str] = "coulomb_friction"
    acts: ClassVar[Mapping[str, str]] = {"dry": "force", "dry_speed": "speed"}

    def tip_force(self, time: float, position: complex, velocity: complex) -> complex:
        """See the base class."""
        v = abs(velocity)
        ratio = tanh(v / self.speed) / v if v > 1e-12 else 1 / self.speed
        return -self.force * ratio * velocity


@dataclass(frozen=True)
class QuadraticDrag(Disturbance):
    """Drag of the disc against its velocity v: F = coefficient * v^2, with `coefficient` in N s^2/m^2."""

    coefficient: float
    id: ClassVar[str] = "quadratic_drag"
    acts: ClassVar[Mapping[str, str]] = {"drag": "coefficient"}

    def tip_force(self, time: float, position: complex, velocity: complex) -> complex:
        """See the base class."""
        return -self.coefficient * abs(velocity) * velocity


@dataclass(frozen=True)
class PeriodicDisturbance(Disturbance):
    """Force on the disc in a fixed direction: F = amplitude * sin(frequency * t + phase).

    `amplitude` [N], `frequency` [rad/s], `phase` [rad], `direction` [rad] from the x axis.
    """

    amplitude: float
    frequency: float
    phase: float = 0.0
    direction: float = np.pi / 2
    id: ClassVar[str] = "periodic_disturbance"

    def tip_force(self, time: float, position: complex, velocity: complex) -> complex:
        """See the base class."""
        strength = self.amplitude * sin(self.frequency * time + self.phase)
        return strength * complex(cos(self.direction), sin(self.direction))

    def push(self, time: NDArray[np.float64]) -> NDArray[np.complex128]:
        """See the base class."""
        return self.amplitude * np.exp(1j * self.direction) * np.sin(self.frequency * time + self.phase)


@dataclass(frozen=True)
class TableTilt(Disturbance):
    """Table out of level: gravity pulls rod and disc downhill.

    `x` and `y` [rad] are the slopes along the axes, positive where the table falls towards growing coordinate.
    """

    x: float = 0.0
    y: float = 0.0
    id: ClassVar[str] = "table_tilt"

    def gravity(self) -> complex:
        """See the base class."""
        return STANDARD_GRAVITY * complex(sin(self.x), sin(self.y))


@dataclass(frozen=True)
class InitialCurvature(Disturbance):
    """Rod that is bent when unloaded, with uniform `curvature` [1/m]."""

    curvature: float
    id: ClassVar[str] = "initial_curvature"

    def rest_curvature(self) -> float:
        """See the base class."""
        return self.curvature


@dataclass(frozen=True)
class StiffnessDrift(Disturbance):
    """Flexural rigidity that changes by the part `rate` [1/s] of its nominal value each second."""

    rate: float
    id: ClassVar[str] = "stiffness_drift"

    def stiffness_factor(self, time: Any) -> Any:
        """See the base class."""
        return 1.0 + self.rate * time


@dataclass(frozen=True)
class StructuralDamping(Disturbance):
    """Kelvin-Voigt rod: moment EI (kappa + time * d kappa / dt), with the retardation `time` in s."""

    time: float
    id: ClassVar[str] = "structural_damping"

    def retardation_time(self) -> float:
        """See the base class."""
        return self.time


@dataclass(frozen=True)
class ViscoelasticRelaxation(Disturbance):
    """Standard linear solid: moment EI (kappa + ratio * (kappa - z)), time * dz/dt = kappa - z; `time` in s."""

    ratio: float
    time: float
    id: ClassVar[str] = "viscoelastic_relaxation"

    def relaxation(self) -> tuple[float, float]:
        """See the base class."""
        return self.ratio, self.time


@dataclass(frozen=True)
class EncoderRipple(Disturbance):
    """Base that leads the encoder's angle a by amplitude * (sin(cycles * a + phase) - sin(phase)).

    `amplitude` [rad], `cycles` per turn of the motor's shaft, `phase` [rad]. The encoder is set to zero with the base.
    """

    amplitude: float
    cycles: float
    phase: float = 0.0
    id: ClassVar[str] = "encoder_ripple"

    def base_motion(self, angle: Any, rate: Any, acceleration: Any) -> tuple[Any, Any, Any]:
        """See the base class."""
        argument = self.cycles * angle + self.phase
        ripple, slope = self.amplitude * np.sin(argument), self.amplitude * self.cycles * np.cos(argument)
        led = ripple - self.amplitude * np.sin(self.phase)
        return angle + led, rate * (1 + slope), acceleration * (1 + slope) - self.cycles**2 * ripple * rate**2


@dataclass(frozen=True)
class SensorDelay(Disturbance):
    """Camera that is late: at time t it reports where the tip was at t - delay; `delay` [s] is not negative."""

    delay: float
    id: ClassVar[str] = "sensor_delay"

    def reading_delay(self) -> float:
        """See the base class."""
        return self.delay


@dataclass(frozen=True)
class CameraOriginOffset(Disturbance):
    """Camera whose origin is not the hub: it reports the tip shifted by (x, y) [m]."""

    x: float = 0.0
    y: float = 0.0
    id: ClassVar[str] = "camera_origin_offset"

    def reading(self, tip: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """See the base class."""
        return tip + complex(self.x, self.y)


@dataclass(frozen=True)
class PositionScale(Disturbance):
    """Camera whose scale is wrong: it reports (1 + error) times the position."""

    error: float
    id: ClassVar[str] = "position_scale"

    def reading(self, tip: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """See the base class."""
        return (1 + self.error) * tip


DISTURBANCES: dict[str, type[Disturbance]] = {
    kind.id: kind
    for kind in (
        CoulombFriction,
        QuadraticDrag,
        PeriodicDisturbance,
        TableTilt,
        InitialCurvature,
        StiffnessDrift,
        StructuralDamping,
        ViscoelasticRelaxation,
        EncoderRipple,
        SensorDelay,
        CameraOriginOffset,
        PositionScale,
    )
}
"""Every effect by the id that users see."""
