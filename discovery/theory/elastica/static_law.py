r"""The static laws of the elastica: spring, torque and radius against the deflection, and their cubic and cosine.

A clamped, inextensible rod of unit length is bent by a force across the radius of its tip, by eq. (5) of the paper,

.. math:: \theta'' = F_n \sin(\theta - \varphi), \quad \theta(0) = 0, \quad \theta'(1) = 0, \quad F_n = F l^2 / EI,

on the branch without inflection (the stable one). Forces of other directions are in `benchmarks/paper/theory/elastica`.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np
import numpy.typing as npt
from scipy.optimize import least_squares

from discovery.foundation.arrays import FloatArray
from discovery.foundation.errors import InputError
from discovery.theory.elastica.integrals import TINY, bend, increasing_root

DEFLECTION_MAX = np.pi / 2
"""Largest tip deflection of :func:`perpendicular_law` [rad]; there the force points back along the clamped end."""
_SMALLEST_DEFLECTION = 1e-3


@dataclass(frozen=True)
class StaticLaw:
    """Cubic force law and radius law of the elastica, as in (15) and (16) of the paper."""

    stiffness: float  # linear stiffness over that of the small-deflection beam, ``3 EI / l^3`` [-]
    cubic: float  # cubic stiffness over the same [-]
    gamma: float  # coefficient of the radius law, eq. (16) of the paper [-].


SMALL_DEFLECTION = StaticLaw(1.0, float(Fraction(13, 210)), 1.0 / np.sqrt(5.0))
"""The law to third order in the deflection."""


def perpendicular_law(delta: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return force F_n [-] and radius rho_t / l [-] of a tip deflected by a force perpendicular to its radius vector.

    They follow from eq. (5) of the paper. The position of the tip has no component along such a force, so one equation
    in one unknown is left; to lowest orders ``F_n = 3 delta + (13/70) delta^3`` and ``rho / l = 1 - delta^2 / 10``. The
    force has the sign of the deflection ``delta = theta_t - theta_m`` [rad].

    Raises InputError if a deflection is not finite or larger than ``DEFLECTION_MAX``.
    """
    angle = np.asarray(delta, dtype=np.float64)
    if not np.all(np.abs(angle) <= DEFLECTION_MAX):
        raise InputError(
            f"The elastica under a perpendicular tip force is defined up to a deflection of {DEFLECTION_MAX:.4f} rad; "
            f"got values from {np.min(angle):.4g} to {np.max(angle):.4g} rad. Check the unit of the deflection."
        )
    size = np.maximum(np.abs(angle), TINY)
    phi = size + np.pi / 2
    w, c = np.sin(phi / 2), np.cos(phi / 2)

    def equation(z: FloatArray, w: FloatArray, c: FloatArray, half_sine: FloatArray) -> tuple[FloatArray, FloatArray]:
        b = bend(w, c, z)
        along = (b.w * b.tau) ** 2 - b.d / b.t - half_sine
        return along, b.q2 * b.tau + b.d * b.t_z / b.t**2

    # sqrt(1.5 delta) is the root's small-deflection limit and 0.3 % off at pi / 2.
    guess = np.sqrt(1.5 * size)
    z = increasing_root(equation, 0.8 * guess, 1.25 * guess, guess, (w, c, 0.5 * np.sin(size)))
    b = bend(w, c, z)
    return np.sign(angle) * b.t**2, 2.0 * w * b.tau / b.t


def usable_deflections(delta_max: float | None = None, deflection: npt.ArrayLike | None = None) -> FloatArray:
    """Return the deflections at which the laws are compared, none negative [rad].

    They are those of a recording up to `delta_max`, NaN left out, or by default equally spaced up to there.

    Raises InputError if neither is given, no deflection is left, or they reach beyond the elastica's domain or less
    than 1e-3 rad.
    """
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
    """Return the least-squares cubic of (15) and cosine of (16) through force and radius at deflections (n,) [rad]."""
    force, rho = perpendicular_law(delta)
    (stiffness, cubic), *_ = np.linalg.lstsq(np.stack([delta, delta**3], axis=1), force / 3.0)

    def error(gamma: FloatArray) -> FloatArray:
        return np.cos(gamma * delta) - rho

    def slope(gamma: FloatArray) -> FloatArray:
        return -(delta * np.sin(gamma * delta))[:, None]

    fit = least_squares(error, [SMALL_DEFLECTION.gamma], jac=slope, gtol=1e-15)
    return StaticLaw(float(stiffness), float(cubic), float(fit.x[0]))
