"""Motor, controller and arm together: the hub angle is a state and the arm pulls at it, eq. (10) of the paper."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.paper.theory.arm_motion import check_start, integrate
from benchmarks.paper.theory.coupling import Arm
from benchmarks.paper.theory.drivetrain.motor import Motor, PositionController
from discovery.simulation.grid import DriveLike

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class DrivenMotion:
    """A motion of motor and arm together by eq. (10), shapes (k,).

    Attributes
    ----------
    time : ndarray
        Times [s].
    command, theta_m, theta_t : ndarray
        Commanded angle, angle of the hub (which a perfect encoder reads) and polar angle of the tip [rad].
    omega_m, alpha_m : ndarray
        Rate [rad/s] and acceleration [rad/s^2] of the hub.
    x, y : ndarray
        Position of the tip [m].
    current : ndarray
        i [A].
    coupling_torque : ndarray
        Gamma_c [N m], whether or not it was fed back.
    states : ndarray, shape (n, k)
        States of the arm's model.
    """

    time: FloatArray
    command: FloatArray
    theta_m: FloatArray
    theta_t: FloatArray
    omega_m: FloatArray
    alpha_m: FloatArray
    x: FloatArray
    y: FloatArray
    current: FloatArray
    coupling_torque: FloatArray
    states: FloatArray


@dataclass(frozen=True)
class _Loop:
    """Motor, controller and arm, whose torque per unit of its own is fed back to the motor."""

    arm: Arm
    motor: Motor
    controller: PositionController
    reference: DriveLike
    feed: float

    @property
    def size(self) -> int:
        return len(self.arm.program.states)

    def balance(self, t: Any, command: Any, hub: Any, state: Any) -> tuple[Any, Any, list]:
        """Return asked current, hub acceleration and the arm's rows for angle, rate and error integral of the hub."""
        motor, size = self.motor, self.size
        angle, speed, integral = hub
        asked = self.controller.current(motor, command, angle, speed, integral)
        torque = motor.hub_constant * np.clip(asked, -motor.current_limit, motor.current_limit) - motor.friction(speed)
        still, moved = (self.arm.rows(t, (angle, speed, a), state) for a in (0.0 * angle, 0.0 * angle + 1.0))
        slope = moved[size] - still[size]
        acceleration = (torque - self.feed * still[size]) / (motor.hub_inertia + self.feed * slope)
        return asked, acceleration, [a + acceleration * (b - a) for a, b in zip(still, moved, strict=True)]

    def slopes(self, t: float, y: FloatArray, left: bool) -> FloatArray:
        """Return the rates of hub, integral and arm."""
        motor, limit = self.motor, self.motor.current_limit
        command = self.reference.evaluate(t, side="left" if left else "right")[:, 0].tolist()
        values = y.tolist()
        asked, acceleration, rows = self.balance(t, command, values[:3], values[3:])
        # At the limit the integral takes back what the motor cannot give: no sudden halt, no windup.
        excess = (asked - min(max(asked, -limit), limit)) * motor.hub_constant
        excess /= motor.hub_inertia * self.controller.bandwidth**2
        return np.array([values[1], acceleration, command[0] - values[0] - excess, *rows[: self.size]], float)


def drive_arm(
    arm: Arm,
    motor: Motor,
    controller: PositionController,
    reference: DriveLike,
    time: FloatArray,
    *,
    coupled: bool = True,
    deflection: float = 0.0,
    rate: float = 0.0,
) -> DrivenMotion:
    """Simulate motor, controller and arm together, eq. (10); the hub starts as the reference does.

    The arm's equations and its coupling torque are linear in the hub's acceleration, so that (10) gives it at once.

    Parameters
    ----------
    arm : Arm
        The arm with its numbers.
    motor, controller
        What drives it.
    reference : DriveLike
        Commanded hub angle.
    time : ndarray, shape (k,)
        Increasing times [s].
    coupled : bool
        False: the motor does not feel the arm (Gamma_c is left out of (10)), the arm follows.
    deflection, rate : float
        Of the arm at the first time [rad], [rad/s].

    Raises
    ------
    InputError
        If there is no reference, or times or initial state cannot be used.
    SimulationFailure
        If the motion blows up.
    """
    time = check_start(reference, time, deflection, rate)
    loop = _Loop(arm, motor, controller, reference, arm.inertia * coupled)
    command = reference.evaluate(time)
    start = np.concatenate([command[:2, 0], [0.0], arm.start(deflection, rate, command[:2, 0])])
    y = integrate(loop.slopes, start, time, np.asarray(reference.kinks, float))
    asked, acceleration, rows = loop.balance(time, command, y[:3], y[3:])
    torque, theta_t, tip_x, tip_y = (np.broadcast_to(np.asarray(row, float), time.shape) for row in rows[loop.size :])
    return DrivenMotion(
        time=time,
        command=command[0],
        theta_m=y[0],
        theta_t=theta_t,
        omega_m=y[1],
        alpha_m=acceleration,
        x=tip_x,
        y=tip_y,
        current=np.clip(asked, -motor.current_limit, motor.current_limit),
        coupling_torque=arm.inertia * torque,
        states=y[3:],
    )
