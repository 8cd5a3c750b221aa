r"""A body with one coordinate, integrated in compiled code: masses on springs, pendulums and drives.

All is per unit of inertia, so that ``q'' = push - resistance``. The laws are those of a laboratory, not those of a
catalogue: springs get their cubic part from geometry, friction changes its sign as an arc tangent, drag has a viscous
rest, a damper that stands across the motion loses with the square of the deflection. Time is stepped by the classical
Runge-Kutta method.
"""

from __future__ import annotations

from math import atan, copysign, exp, pi, sin, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from discovery_datasets.compiled import compiled

FloatArray = NDArray[np.float64]
#: Columns of the tabulated inputs: measured force or reference, other force [q/s^2], inertia over its nominal value.
INPUTS = ("input", "push", "inertia")
#: Coordinate, rate, slipping variable, strain of the relaxing branch, appendage and its rate.
STATES = ("q", "rate", "slip", "strain", "appendage", "appendage_rate")


class Laws(NamedTuple):
    """Coefficients of everything that depends on the state, per unit of inertia; zero is absent."""

    #: Acceleration per unit of input, or of command where a controller is in force.
    gain: float = 0.0
    #: Controller: command = k_v (k_p (input - q) - rate).
    k_p: float = 0.0
    k_v: float = 0.0
    #: Declared mechanics: viscous friction [1/s], spring [1/s^2], gravity -w^2 sin(q) [1/s^2].
    viscous: float = 0.0
    linear: float = 0.0
    gravity: float = 0.0
    #: Springs: two across the motion at a distance, one whose force grows exponentially, one of fifth order.
    across: float = 0.0
    across_reach: float = 1.0
    exponential: float = 0.0
    exponential_reach: float = 1.0
    quintic: float = 0.0
    #: Share by which the spring drifts in the end, and the time in which it does so [s].
    drift: float = 0.0
    drift_time: float = 1.0
    #: Friction: dry, its part at creep that fades over a speed, width of the sign [q/s]; drag and its viscous rest.
    dry: float = 0.0
    creep: float = 0.0
    creep_speed: float = 1.0
    dry_speed: float = 1e-3
    drag: float = 0.0
    drag_rest: float = 0.0
    asymmetry: float = 0.0
    #: Damper across the motion: -loss q^2 / (reach^2 + q^2) v.
    loss: float = 0.0
    loss_reach: float = 1.0
    #: Bouc-Wen force of at most slip_force that yields at slip_reach, and the exponent of its knee.
    slip_force: float = 0.0
    slip_reach: float = 1.0
    slip_knee: float = 1.5
    #: Maxwell branch: stiffness [1/s^2] and time [s].
    relaxing: float = 0.0
    relaxing_time: float = 1.0
    #: Laws in no catalogue: friction |v|^power, dry friction that fades as 1 / (1 + v / speed), a spring with a kink.
    power_loss: float = 0.0
    power: float = 1.0
    fading: float = 0.0
    fading_speed: float = 1.0
    kink: float = 0.0
    kink_at: float = 0.0
    #: A stop on one side, and a place with dry friction or a pull.
    stop: float = 0.0
    stop_at: float = 0.0
    place: float = 0.0
    place_width: float = 1.0
    place_friction: float = 0.0
    place_pull: float = 0.0
    #: A second body on a spring: coupling per unit of the first inertia [1/s^2], mass over the first, own grounding
    #: spring [1/s^2] and friction [1/s].
    coupling: float = 0.0
    share: float = 1.0
    ground: float = 0.0
    ground_loss: float = 0.0


@compiled()
def springs(p: Laws, time: float, q: float) -> float:
    """Force that depends on the place [q/s^2], against growing q."""
    warm = 1.0 + p.drift * (1.0 - exp(-time / p.drift_time)) if p.drift != 0.0 else 1.0
    total = p.linear * warm * q + p.gravity * sin(q) + p.quintic * q**5
    if p.across != 0.0:
        total += 2.0 * p.across * q * (1.0 - p.across_reach / sqrt(p.across_reach**2 + q * q))
    if p.exponential != 0.0:
        x = q / p.exponential_reach
        total += p.exponential * p.exponential_reach * (exp(x) - 1.0 - x)
    if p.kink != 0.0 and abs(q) > p.kink_at:
        total += p.kink * copysign(abs(q) - p.kink_at, q)
    if p.stop != 0.0 and q > p.stop_at:
        total += p.stop * (q - p.stop_at)
    return total


@compiled()
def losses(p: Laws, q: float, v: float) -> float:
    """Force that depends on the speed [q/s^2], against growing v; with it, whatever acts at a place alone."""
    speed = abs(v)
    total = p.viscous * v
    dry = p.dry + p.creep * exp(-speed / p.creep_speed) + p.fading / (1.0 + speed / p.fading_speed)
    if p.place_friction != 0.0 or p.place_pull != 0.0:
        x = (q - p.place) / p.place_width
        near = exp(-0.5 * x * x)
        dry += p.place_friction * near
        total += p.place_pull * x * near
    if dry != 0.0:
        total += dry * 2.0 / pi * atan(v / p.dry_speed)
    if p.drag != 0.0:
        total += p.drag * v * sqrt(v * v + p.drag_rest**2)
    if p.asymmetry != 0.0:
        total += p.asymmetry * speed
    if p.loss != 0.0:
        total += p.loss * v * q * q / (p.loss_reach**2 + q * q)
    if p.power_loss != 0.0:
        # Straight near rest, where a root has no slope.
        total += p.power_loss * v * (v * v + p.dry_speed**2) ** (0.5 * (p.power - 1.0))
    return total


@compiled()
def memory(p: Laws, v: float, slip: float, strain: float, change: FloatArray) -> float:
    """Force of what remembers the motion [q/s^2]; its rates are written to places 2 and 3 of `change`."""
    change[2] = change[3] = 0.0
    total = 0.0
    if p.slip_force != 0.0:
        rate = v / p.slip_reach
        held = abs(slip) ** p.slip_knee if slip * rate > 0 else 0.0
        change[2] = rate * (1.0 - held)
        total += p.slip_force * slip
    if p.relaxing != 0.0:
        change[3] = v - strain / p.relaxing_time
        total += p.relaxing * strain
    return total


@compiled()
def slope(p: Laws, time: float, inputs: FloatArray, state: FloatArray, change: FloatArray) -> None:
    """Write the rate of the state into `change`."""
    q, v = state[0], state[1]
    command = inputs[0] if p.k_v == 0.0 else p.k_v * (p.k_p * (inputs[0] - q) - v)
    force = p.gain * command + inputs[1]
    force -= springs(p, time, q) + losses(p, q, v) + memory(p, v, state[2], state[3], change)
    change[4] = change[5] = 0.0
    if p.coupling != 0.0:
        pull = p.coupling * (state[4] - q)
        force += pull
        change[4] = state[5]
        change[5] = -pull / p.share - p.ground * state[4] - p.ground_loss * state[5]
    change[0], change[1] = v, force / inputs[2]


@compiled()
def integrate(p: Laws, state: FloatArray, time: FloatArray, inputs: FloatArray, every: int) -> FloatArray:
    """States from the first on, one in `every` steps; `time` (m,) of the steps, `inputs` (m, 3, 3) at their stages."""
    n, steps = state.size, time.size - 1
    out = np.empty((steps // every + 1, n))
    k1, k2, k3, k4 = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    x = state.copy()
    out[0] = x
    for m in range(steps):
        t, h = time[m], time[m + 1] - time[m]
        slope(p, t, inputs[m, 0], x, k1)
        slope(p, t + 0.5 * h, inputs[m, 1], x + 0.5 * h * k1, k2)
        slope(p, t + 0.5 * h, inputs[m, 1], x + 0.5 * h * k2, k3)
        slope(p, t + h, inputs[m, 2], x + h * k3, k4)
        x = x + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        if (m + 1) % every == 0:
            out[(m + 1) // every] = x
    return out


@compiled()
def follow(p: Laws, time: FloatArray, motion: FloatArray, inputs: FloatArray, every: int) -> FloatArray:
    """Force that a given motion takes, one in `every` steps.

    `motion` (m, 3, 3) holds coordinate, rate and acceleration at the three stages of each step.
    """
    steps = time.size - 1
    out = np.empty(steps // every + 1)
    slip = strain = 0.0
    change, later = np.zeros(6), np.zeros(6)
    for m in range(steps + 1):
        i, stage = (m, 0) if m < steps else (steps - 1, 2)
        q, v, a = motion[i, stage]
        force = memory(p, v, slip, strain, change)
        if m % every == 0:
            force += springs(p, time[m], q) + losses(p, q, v)
            out[m // every] = inputs[i, stage, 2] * a + force - inputs[i, stage, 1]
        if m < steps:
            # The midpoint rule: the motion itself is exact.
            h = time[m + 1] - time[m]
            memory(p, motion[m, 1, 1], slip + 0.5 * h * change[2], strain + 0.5 * h * change[3], later)
            slip += h * later[2]
            strain += h * later[3]
    return out
