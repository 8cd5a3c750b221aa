"""The quantities of a rig file, whose keys carry their unit as a suffix."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class QuantityKind:
    """What a rig file may state of one quantity.

    Examples
    --------
    >>> mass = QUANTITIES["tip_mass"]
    >>> mass.unit, mass.usual_sd(2.0)
    ('kg', 0.01)
    """

    unit: str  # SI unit
    #: relative_sd, absolute_sd: standard deviation where the file states none: a share of the value, and a part in SI
    #: units. Both are zero where no standard deviation is used.
    relative_sd: float = 0.0
    absolute_sd: float = 0.0
    largest: float  # largest plausible value, in SI units
    kinds: tuple[str, ...]  # kinds of system in which it means something
    meaning: str  # what it is, and what is done where it is left out: for people, in Markdown

    @property
    def has_sd(self) -> bool:
        """Whether a standard deviation is used."""
        return self.usual_sd(self.largest) > 0.0

    @property
    def symbol(self) -> str:
        """The unit as results have it, with negative powers."""
        return self.unit.replace(" / s^", " s^-").replace(" / s", " s^-1")

    def usual_sd(self, value: float) -> float:
        """Return the standard deviation of a value that is stated without one, in SI units."""
        return self.relative_sd * value + self.absolute_sd


_ARM = ("flexible_arm",)

QUANTITIES: Mapping[str, QuantityKind] = {
    "length": QuantityKind(
        unit="m",
        absolute_sd=1e-3,
        largest=30.0,
        kinds=("flexible_arm", "pendulum"),
        meaning="Of an arm: from the axis of the motor to the tip along the straight rod; it is required. Of a "
        "pendulum: length of the simple pendulum that swings alike; left out, the fitted pull of gravity is not "
        "compared with g / L.",
    ),
    "tip_mass": QuantityKind(
        unit="kg",
        relative_sd=0.005,
        largest=1000.0,
        kinds=_ARM,
        meaning="Mass at the tip. Left out, parameters are not told as forces.",
    ),
    "beam_mass": QuantityKind(
        unit="kg",
        relative_sd=0.02,
        largest=1000.0,
        kinds=_ARM,
        meaning="Mass of the rod. Without it, or without `tip_mass`, the rod counts as light.",
    ),
    "flexural_rigidity": QuantityKind(
        unit="N m^2",
        relative_sd=0.05,
        largest=1e7,
        kinds=_ARM,
        meaning="Flexural rigidity EI of the rod. With the length and both masses it predicts the stiffness that the "
        "fitted one is compared with; left out, nothing is compared.",
    ),
    "mass": QuantityKind(
        unit="kg",
        relative_sd=0.005,
        largest=1e6,
        kinds=("oscillator", "base_excited", "drive", "falling_body"),
        meaning="Mass of what moves along a line. With it, parameters are also told as forces. Where the "
        "input of an oscillator or a drive, or what `[view]` reads, is a force, it is not needed: the mass is then "
        "fitted itself, within this one’s sd unless the recordings overrule it, which is said as a contradiction.",
    ),
    "inertia": QuantityKind(
        unit="kg m^2",
        relative_sd=0.02,
        largest=1e6,
        kinds=("oscillator", "pendulum", "base_excited", "drive"),
        meaning="Moment of inertia of what turns. With it, parameters are also told as torques. Where the "
        "input of an oscillator, a pendulum or a drive, or what `[view]` reads, is a torque, it is not needed: it is "
        "then fitted itself, within this one’s sd unless the recordings overrule it, which is said as a contradiction.",
    ),
    "gravity": QuantityKind(
        unit="m s^-2",
        absolute_sd=0.02,
        largest=30.0,
        kinds=("pendulum", "falling_body"),
        meaning="Acceleration of gravity. Left out, it is 9.80665, with an sd of 0.02.",
    ),
    "position_noise": QuantityKind(
        unit="m",
        largest=0.1,
        kinds=_ARM,
        meaning="Standard deviation of a reading of the tip, along each axis. Left out, it is estimated from the "
        "scatter from reading to reading.",
    ),
    "angle_noise": QuantityKind(
        unit="rad",
        largest=0.2,
        kinds=_ARM,
        meaning="Half width of the uniform error of the encoder, to which the motion of the motor is smoothed. Left "
        "out, it is estimated. It may also be stated of another input, where that is an angle whose interpolation is "
        "`motion`.",
    ),
    "motor_angle_limit": QuantityKind(
        unit="rad",
        largest=15.0,
        kinds=_ARM,
        meaning="Largest angle of the motor in a proposed manoeuvre, to either side of where it starts. Left out, it "
        "is the largest in the recordings.",
    ),
    "motor_speed_limit": QuantityKind(
        unit="rad / s",
        largest=100.0,
        kinds=_ARM,
        meaning="Largest speed of the motor in a proposed manoeuvre. Left out, it is the largest in the recordings.",
    ),
    "motor_acceleration_limit": QuantityKind(
        unit="rad / s^2",
        largest=1e4,
        kinds=_ARM,
        meaning="Largest acceleration of the motor in a proposed manoeuvre. Left out, it is the largest in the "
        "recordings.",
    ),
    "deflection_limit": QuantityKind(
        unit="rad",
        largest=3.0,
        kinds=_ARM,
        meaning="Largest angle between tip and hub that a proposed manoeuvre may cause. Left out, it is a tenth more "
        "than the largest in the recordings.",
    ),
}
"""Every quantity by the stem of its key."""


def key_of(stem: str) -> str:
    """Return the key of a quantity in its SI unit: ``"length"`` gives ``"length_m"``."""
    unit = QUANTITIES[stem].unit.replace(" ", "_").replace("/", "per").replace("^", "").replace("-", "")
    return f"{stem}_{unit}"
