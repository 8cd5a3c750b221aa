r"""The paper's general dynamic model: a point mass on a massless elastica, with both components of the tip force.

Equation (7) with viscous friction, :math:`m p_t'' = -\Phi(\rho_t, \theta_t - \theta_m) - \xi m p_t'`, the hub angle
given. :math:`\Phi` is the force on the beam's tip, of components :math:`F_r, F_t` along and across the radius. In polar
form, from (8) with :math:`\theta_t'^2` where the paper prints :math:`\theta_t''^2`,

.. math:: m (\rho_t'' - \rho_t \theta_t'^2 + \xi \rho_t') = -F_r, \quad
          m (\rho_t \theta_t'' + 2 \rho_t' \theta_t' + \xi \rho_t \theta_t') = -F_t.

Lengths in l, forces in :math:`EI / l^2` and times in :math:`T = \sqrt{m l^3 / EI}` make it (9), one equation for all
arms; the paper's :math:`\sqrt m` leaves the other units in. `massless_arm.simulation` solves it in
that form and in polar coordinates; the dimensional and the Cartesian form are views of its result.
`massless_arm.radau` tells how the stiffness near the straight arm is treated, and which of the model's
solutions this is.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from benchmarks.paper.theory.massless_arm.potential import tip_potential
from discovery.foundation.errors import InputError

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class GeneralModel:
    """A massless elastic arm with a point mass at its tip, equations (7) to (9) of the paper.

    Parameters
    ----------
    flexural_rigidity : float
        EI of the rod [N m^2], positive.
    tip_mass : float
        Mass at the tip [kg], positive.
    length : float
        Length of the rod [m], positive.
    xi : float
        Viscous friction of the tip over its mass [1/s], not negative.

    Raises
    ------
    InputError
        If a parameter is out of range.
    """

    flexural_rigidity: float
    tip_mass: float
    length: float = 1.0
    xi: float = 0.0

    def __post_init__(self) -> None:
        positive = np.array([self.flexural_rigidity, self.tip_mass, self.length])
        if not (np.all(np.isfinite(positive) & (positive > 0.0)) and 0.0 <= self.xi < np.inf):
            raise InputError("An arm needs a positive rigidity, tip mass and length, and a friction of at least 0.")

    @property
    def time_scale(self) -> float:
        """Unit ``T`` of time of eq. (9) [s]; a small swing has the angular frequency ``sqrt(3) / T``."""
        return float(np.sqrt(self.tip_mass * self.length**3 / self.flexural_rigidity))

    @property
    def force_scale(self) -> float:
        """Unit ``EI / l^2`` of force [N], that of eq. (5)."""
        return self.flexural_rigidity / self.length**2

    def normalised(self) -> GeneralModel:
        """Return the same arm in the units of eq. (9): rigidity, mass and length 1, ``xi`` in 1/T."""
        return GeneralModel(1.0, 1.0, 1.0, self.xi * self.time_scale)


@dataclass(frozen=True)
class GeneralMotion:
    """Motion of the tip by (7), (8); every array has one value a time.

    Parameters
    ----------
    model : GeneralModel
        The arm.
    time : ndarray, shape (n,)
        Times [s].
    theta_m, theta_t : ndarray, shape (n,)
        Angles of hub and tip [rad].
    rho : ndarray, shape (n,)
        Radius of the tip [m].
    theta_rate, rho_rate : ndarray, shape (n,)
        Their rates [rad/s], [m/s].
    radial, tangential : ndarray, shape (n,)
        Force of the mass on the beam's tip along the radius (tension positive) and across it [N].
    load : ndarray, shape (n,)
        Its radial part without the retarded one, which the shape of the beam follows [N].
    """

    model: GeneralModel
    time: FloatArray
    theta_m: FloatArray
    theta_t: FloatArray
    rho: FloatArray
    theta_rate: FloatArray
    rho_rate: FloatArray
    radial: FloatArray
    tangential: FloatArray
    load: FloatArray

    @property
    def position(self) -> FloatArray:
        """Tip position ``x, y`` in the fixed frame [m], shape (2, n)."""
        return _turned(self.theta_t, self.rho, np.zeros_like(self.rho))

    @property
    def velocity(self) -> FloatArray:
        """Tip velocity ``x', y'`` [m/s], shape (2, n)."""
        return _turned(self.theta_t, self.rho_rate, self.rho * self.theta_rate)

    @property
    def force(self) -> FloatArray:
        """Force ``Phi`` of eq. (7) on the beam's tip in the fixed frame [N], shape (2, n)."""
        return _turned(self.theta_t, self.radial, self.tangential)

    @property
    def polar_acceleration(self) -> tuple[FloatArray, FloatArray]:
        """``theta_t''`` [rad/s^2] and ``rho_t''`` [m/s^2] by the polar form of (7), (8), each of shape (n,)."""
        m, xi = self.model.tip_mass, self.model.xi
        along = self.rho * self.theta_rate**2 - xi * self.rho_rate - self.radial / m
        across = -(2.0 * self.rho_rate + xi * self.rho) * self.theta_rate - self.tangential / m
        return across / self.rho, along

    @property
    def acceleration(self) -> FloatArray:
        """Tip acceleration ``x'', y''`` by eq. (8) [m/s^2], shape (2, n)."""
        turning, along = self.polar_acceleration
        return cartesian_acceleration(self.theta_t, self.rho, self.theta_rate, self.rho_rate, turning, along)

    @property
    def coupling_torque(self) -> FloatArray:
        """Torque of the motor on the arm, ``-F rho_t sin(phi - theta_t)`` of eq. (11) [N m], shape (n,)."""
        return -self.rho * self.tangential

    @property
    def kinetic_energy(self) -> FloatArray:
        """Kinetic energy of the mass [J], shape (n,)."""
        return 0.5 * self.model.tip_mass * (self.rho_rate**2 + (self.rho * self.theta_rate) ** 2)

    @property
    def bending_energy(self) -> FloatArray:
        """Bending energy of the rod [J], shape (n,)."""
        unit = self.model.flexural_rigidity / self.model.length
        return unit * tip_potential().energy(self.theta_t - self.theta_m, self.load / self.model.force_scale)

    def normalised(self) -> GeneralMotion:
        """Return the same motion in the units of eq. (9): times in T, lengths in l, forces in EI / l^2."""
        unit, length, force = self.model.time_scale, self.model.length, self.model.force_scale
        return replace(
            self,
            model=self.model.normalised(),
            time=self.time / unit,
            rho=self.rho / length,
            theta_rate=self.theta_rate * unit,
            rho_rate=self.rho_rate * unit / length,
            radial=self.radial / force,
            tangential=self.tangential / force,
            load=self.load / force,
        )


def cartesian_acceleration(
    theta: FloatArray,
    rho: FloatArray,
    theta_rate: FloatArray,
    rho_rate: FloatArray,
    theta_acceleration: FloatArray,
    rho_acceleration: FloatArray,
) -> FloatArray:
    """Acceleration of a point from its polar coordinates: eq. (8) of the paper, with ``theta_t'^2``.

    Parameters
    ----------
    theta, rho : ndarray, shape (n,)
        Angle [rad] and radius [m].
    theta_rate, rho_rate, theta_acceleration, rho_acceleration : ndarray, shape (n,)
        Their first and second time derivatives.

    Returns
    -------
    ndarray, shape (2, n)
        ``x''`` and ``y''`` [m/s^2].
    """
    along = rho_acceleration - rho * theta_rate**2
    across = rho * theta_acceleration + 2.0 * rho_rate * theta_rate
    return _turned(theta, along, across)


def _turned(angle: FloatArray, along: FloatArray, across: FloatArray) -> FloatArray:
    """Components in the fixed frame (2, n) of a vector given along and across a direction."""
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([along * c - across * s, along * s + across * c])
