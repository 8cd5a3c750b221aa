"""What a machine does beside what is declared: at a joint, force against displacement, rate and a slip of its own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import sin, tanh


@dataclass(frozen=True)
class Law:
    """An effect at a joint, or of the drive.

    Parameters
    ----------
    force : callable
        Force on the joint's displacement from displacement, rate and slip, in SI units.
    slip : callable
        Rate of the slip from displacement, rate and slip.
    names : tuple of str
        Effects of the catalogue that say the same.
    truth : mapping of str to float
        Their parameters, without the place, as they should come out, in SI units.
    received : callable
        What the machine receives of the recorded input.
    behind : float
        Time constant with which that arrives [s].
    """

    force: Callable[[float, float, float], float]
    names: tuple[str, ...]
    truth: dict[str, float]
    slip: Callable[[float, float, float], float] = lambda d, v, z: 0.0
    received: Callable[[float], float] = lambda u: u
    behind: float = 0.0


NOTHING = Law(lambda d, v, z: 0.0, (), {})


def dry(size: float, creep: float) -> Law:
    """Dry friction of a size, smooth within a creep rate."""
    return Law(lambda d, v, z: -size * tanh(v / creep), ("coulomb_friction",), {"f_c": size})


def drag(size: float) -> Law:
    """Drag that grows with the square of the rate."""
    return Law(lambda d, v, z: -size * v * abs(v), ("quadratic_drag",), {"c_2": size})


def cubic(size: float) -> Law:
    """A spring that hardens with the cube of the displacement."""
    return Law(lambda d, v, z: -size * d**3, ("cubic_stiffness",), {"beta": size})


def play(half: float, stiffness: float, loss: float) -> Law:
    """Play of a half width: where the parts do not touch, the joint's declared spring and loss do nothing."""

    def force(d: float, v: float, z: float) -> float:
        return stiffness * max(-half, min(half, d)) + (loss * v if abs(d) < half else 0.0)

    return Law(force, ("play",), {"w_b": half})


def hysteresis(stiffness: float, slip: float) -> Law:
    """Surfaces that stick with a stiffness and slip beyond a displacement (Bouc and Wen)."""
    return Law(
        lambda d, v, z: -stiffness * z,
        ("hysteresis",),
        {"w_h": slip},
        lambda d, v, z: v - (abs(v) * abs(z) * z + v * z * z) / (2 * slip**2),
    )


def cogging(size: float, periods: float) -> Law:
    """A torque that comes and goes so many times in a turn."""
    return Law(lambda d, v, z: size * sin(periods * d), ("cogging",), {"N_c": periods, "n_b": size})


def lopsided(size: float, mean: float) -> Law:
    """A damper that resists one way more than the other: the declared loss is the mean of both."""
    return Law(lambda d, v, z: -size * abs(v), ("asymmetric_viscous_damping",), {"a_v": size / mean})


def dead_zone(half: float) -> Law:
    """A drive that does nothing below an input, and lacks that much above it."""
    return Law(
        lambda d, v, z: 0.0, ("input_dead_zone",), {"w_u": half}, received=lambda u: u - max(-half, min(half, u))
    )


def saturation(limit: float) -> Law:
    """A drive that gives no more than its limit."""
    return Law(
        lambda d, v, z: 0.0, ("input_saturation",), {"s_u": 1 / limit}, received=lambda u: max(-limit, min(limit, u))
    )


def lag(time: float) -> Law:
    """A drive that follows its input with a time constant."""
    return Law(lambda d, v, z: 0.0, ("input_lag",), {"tau_u": time}, behind=time)
