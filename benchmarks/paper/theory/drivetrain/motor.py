r"""Motor with reduction gear and its position controller: equation (10) of the paper.

.. math:: \Gamma_m = K i = J n^2 \ddot\theta_m + \nu n^2 \dot\theta_m + \Gamma_c

Every torque of (10) is on the output side of the gear, where the rod is clamped. The rotor turns n times as fast, so
that its own balance is :math:`k_t i = J n\ddot\theta_m + \nu n\dot\theta_m + \Gamma_c / n`; times n it is (10), with
:math:`K = n k_t`. J [kg m^2], nu [N m s] and the torque constant k_t [N m/A] are those of the motor's shaft, and the
inertia that the arm feels is J n^2. The gear has no losses of its own, no play and no elasticity.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from discovery.foundation.errors import InputError


@dataclass(frozen=True)
class Motor:
    """A current-driven motor with a reduction gear, eq. (10); all quantities are on the motor's side of the gear.

    Parameters
    ----------
    inertia : float
        J of rotor and gear [kg m^2].
    viscous_friction : float
        nu [N m s].
    torque_constant : float
        k_t = K / n [N m/A].
    gear_ratio : float
        n, turns of the motor for one of the hub.
    coulomb : float
        Dry friction torque [N m].
    current_limit : float
        Largest current [A].
    creep : float
        Speed of the hub within which dry friction changes its sign smoothly [rad/s].

    Raises
    ------
    InputError
        If a quantity is not positive, or a friction negative.
    """

    inertia: float
    viscous_friction: float
    torque_constant: float
    gear_ratio: float
    coulomb: float = 0.0
    current_limit: float = np.inf
    creep: float = 1e-3

    def __post_init__(self) -> None:
        for name in ("inertia", "torque_constant", "gear_ratio", "current_limit", "creep"):
            if not getattr(self, name) > 0:
                raise InputError(f"The motor's {name} must be positive, not {getattr(self, name)}.")
        for name in ("viscous_friction", "coulomb"):
            if not getattr(self, name) >= 0:
                raise InputError(f"The motor's {name} must not be negative, not {getattr(self, name)}.")

    @property
    def hub_inertia(self) -> float:
        """J n^2 of eq. (10) [kg m^2]."""
        return self.inertia * self.gear_ratio**2

    @property
    def hub_damping(self) -> float:
        """Hub damping nu n^2 of eq. (10) [N m s]."""
        return self.viscous_friction * self.gear_ratio**2

    @property
    def hub_constant(self) -> float:
        """K = n k_t of eq. (10), torque at the hub per current [N m/A]."""
        return self.torque_constant * self.gear_ratio

    def friction(self, rate: Any) -> Any:
        """Return viscous friction (10) and dry friction at the hub [N m] for its rate [rad/s]."""
        dry = self.coulomb * self.gear_ratio
        return self.hub_damping * rate + dry * rate / np.sqrt(rate**2 + self.creep**2)


#: A motor of the size of the paper's. Gear ratio 50 is the paper's (RH-8D-6006 by Harmonic Drive); the paper gives
#: neither J nor nu nor K. The other numbers are assumed, not measured and not from a data sheet: a geared servo of some
#: ten watts, 0.015 kg m^2 and 2 N m/A at the hub. Studies vary them.
ASSUMED_MOTOR = Motor(inertia=6e-6, viscous_friction=1e-5, torque_constant=0.04, gear_ratio=50.0)


@dataclass(frozen=True)
class PositionController:
    r"""A continuous PID controller of the hub angle, with the motor's own inertia and friction fed forward.

    Without arm and limits the error e = command - theta_m obeys
    :math:`\ddot e + 2\zeta\omega_b\dot e + \omega_b^2 (e + \int e\,dt/T_i) = 0`.

    Parameters
    ----------
    bandwidth : float
        omega_b [rad/s].
    damping : float
        zeta [-].
    integral_time : float
        T_i [s]; infinite for a PD controller. Back-calculation keeps the integral from winding up at the limit.
    feed_forward : bool
        Whether the current that moves the motor alone along the command is added.

    Raises
    ------
    InputError
        If a quantity is not positive.
    """

    bandwidth: float
    damping: float = 1.0
    integral_time: float = np.inf
    feed_forward: bool = True

    def __post_init__(self) -> None:
        for name in ("bandwidth", "damping", "integral_time"):
            if not getattr(self, name) > 0:
                raise InputError(f"The controller's {name} must be positive, not {getattr(self, name)}.")

    def current(self, motor: Motor, command: Any, angle: Any, rate: Any, integral: Any) -> Any:
        """Return the current that the controller asks for, before the limit [A].

        Parameters
        ----------
        motor : Motor
            For which it is tuned.
        command : array_like, shape (3,) or (3, k)
            Commanded angle [rad] and its first two derivatives.
        angle, rate, integral : float or ndarray, shape (k,)
            Hub angle [rad], its rate [rad/s], integral of the error [rad s].
        """
        error, error_rate = command[0] - angle, command[1] - rate
        pull = self.bandwidth**2 * (error + integral / self.integral_time)
        torque = motor.hub_inertia * (pull + 2 * self.damping * self.bandwidth * error_rate)
        if self.feed_forward:
            torque = torque + motor.hub_inertia * command[2] + motor.hub_damping * command[1]
        return torque / motor.hub_constant
