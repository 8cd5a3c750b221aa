"""The static laws of the elastica: spring, torque and radius against the deflection, and their cubic and cosine."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np
import numpy.typing as npt
from scipy.optimize import least_squares

from discovery.foundation.errors import InputError
from discovery.theory.elastica.beam import DEFLECTION_MAX, perpendicular_law

__all__ = [
    "SMALL_DEFLECTION",
    "StaticLaw",
    "fitted_law",
    "radius_law",
    "spring_law",
    "static_law",
    "torque_law",
    "usable_deflections",
]

FloatArray = npt.NDArray[np.float64]

_SMALLEST_DEFLECTION = 1e-3


@dataclass(frozen=True)
class StaticLaw:
    """Cubic force law and radius law of the elastica, as in (15) and (16) of the paper.

    Parameters
    ----------
    stiffness : float
        Linear stiffness over that of the small-deflection beam, ``3 EI / l^3`` [-].
    cubic : float
        Cubic stiffness over the same [-].
    gamma : float
        Coefficient of the radius law, eq. (16) of the paper [-].
    """

    stiffness: float
    cubic: float
    gamma: float


SMALL_DEFLECTION = StaticLaw(1.0, float(Fraction(13, 210)), 1.0 / np.sqrt(5.0))
"""The law to third order in the deflection."""


def static_law(delta_max: float | None = None, deflection: npt.ArrayLike | None = None) -> StaticLaw:
    """Least-squares cubic of (15) and cosine of (16) through the elastica's force and radius.

    Parameters
    ----------
    delta_max : float, optional
        Largest deflection that counts [rad].
    deflection : array_like, optional
        Deflections at which the laws are compared, as a recording has them [rad]; NaN is left out. By default they are
        equally spaced up to `delta_max`.

    Raises
    ------
    InputError
        If neither is given, no deflection is left, or they reach beyond the elastica's domain or less than 1e-3 rad.
    """
    return fitted_law(usable_deflections(delta_max, deflection))


def spring_law(delta: npt.ArrayLike) -> FloatArray:
    """Tangential force of the elastica (5) over its linear stiffness, ``F_n / 3``; comparable with the spring of (15).

    Comparable with the discovered ``delta + (beta / alpha) delta^3`` of eq. (14) of the paper.

    Parameters
    ----------
    delta : array_like
        Deflection [rad], within the domain of :func:`discovery.theory.elastica.beam.perpendicular_law`.

    Returns
    -------
    ndarray
        Normalised force [rad].
    """
    return perpendicular_law(delta)[0] / 3.0


def torque_law(delta: npt.ArrayLike) -> FloatArray:
    """Torque (11) of the elastica's tip force about the clamp over its linear stiffness, ``rho F_n / (3 l)``.

    It is the generalised force of the dynamic reduction: the derivative of the bending energy along the tip's curve.

    Parameters
    ----------
    delta : array_like
        Deflection [rad], as in :func:`spring_law`.

    Returns
    -------
    ndarray
        Normalised torque [rad].
    """
    force, rho = perpendicular_law(delta)
    return rho * force / 3.0


def radius_law(delta: npt.ArrayLike) -> FloatArray:
    """Radius of the elastica's tip, ``rho_t / l``; comparable with ``cos(gamma delta)`` of eq. (16) of the paper.

    Parameters
    ----------
    delta : array_like
        Deflection [rad], as in :func:`spring_law`.

    Returns
    -------
    ndarray
        Normalised radius [-].
    """
    return perpendicular_law(delta)[1]


def usable_deflections(delta_max: float | None, deflection: npt.ArrayLike | None) -> FloatArray:
    """Return the deflections [rad] at which the laws are compared, none negative; see :func:`static_law`."""
    if deflection is None and delta_max is None:
        raise InputError("The least-squares law of the elastica needs the largest deflection or the deflections.")
    if deflection is None:
        delta = np.linspace(0.0, np.float64(delta_max), 401)
    else:
        delta = np.abs(np.ravel(np.asarray(deflection, dtype=np.float64)))
        delta = delta[np.isfinite(delta)]
        delta = delta if delta_max is None else delta[delta <= delta_max]
    if not delta.size or not _SMALLEST_DEFLECTION <= np.max(delta) <= DEFLECTION_MAX:
        raise InputError(
            f"The least-squares law of the elastica needs deflections that reach between {_SMALLEST_DEFLECTION:g} and "
            f"{DEFLECTION_MAX:.4f} rad; got {f'{np.max(delta):.4g} rad' if delta.size else 'none'}. Check their unit."
        )
    return delta


def fitted_law(delta: FloatArray) -> StaticLaw:
    """Return the least-squares cubic and cosine through the elastica's force and radius at deflections (n,) [rad]."""
    force, rho = perpendicular_law(delta)
    (stiffness, cubic), *_ = np.linalg.lstsq(np.stack([delta, delta**3], axis=1), force / 3.0)

    def error(gamma: FloatArray) -> FloatArray:
        return np.cos(gamma * delta) - rho

    def slope(gamma: FloatArray) -> FloatArray:
        return -(delta * np.sin(gamma * delta))[:, None]

    fit = least_squares(error, [SMALL_DEFLECTION.gamma], jac=slope, gtol=1e-15)
    return StaticLaw(float(stiffness), float(cubic), float(fit.x[0]))
