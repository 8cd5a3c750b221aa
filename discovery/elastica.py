r"""The static elastica: a clamped, inextensible beam of unit length bent by a force at its tip.

The normalised equation is eq. (5) of the paper,

.. math:: \theta'' = F_n \sin(\theta - \varphi), \quad \theta(0) = 0, \quad \theta'(1) = 0, \quad F_n = F l^2 / EI,

for a force of any magnitude and of any direction :math:`\varphi`, on the branch without inflection (the stable one).
`discovery.elastica_integrals` solves it; here are the tip, the shape and the law of a perpendicular force.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from discovery.elastica_integrals import (
    TINY,
    Load,
    bend,
    clamp_parameter,
    clamp_slope,
    fold,
    half_angle,
    increasing_root,
    integrals,
    modulus,
)
from discovery.errors import InputError

__all__ = [
    "DEFLECTION_MAX",
    "BeamShape",
    "TipState",
    "perpendicular_law",
    "shape_under_load",
    "tip_under_load",
]

FloatArray = npt.NDArray[np.float64]

DEFLECTION_MAX = np.pi / 2
"""Largest tip deflection of :func:`perpendicular_law` [rad]; there the force points back along the clamped end."""


@dataclass(frozen=True)
class TipState:
    """The tip of a beam of unit length, in the frame of the clamp; every field has the shape of the loads.

    Parameters
    ----------
    x, y : ndarray
        Position along and across the undeflected beam [lengths].
    slope : ndarray
        Orientation of the beam at its tip [rad].
    radius : ndarray
        Distance from the clamp, ``rho_t / l`` [-].
    angle : ndarray
        Polar angle ``delta = theta_t - theta_m`` [rad].
    """

    x: FloatArray
    y: FloatArray
    slope: FloatArray
    radius: FloatArray
    angle: FloatArray


@dataclass(frozen=True)
class BeamShape:
    """The bent line of a beam of unit length; points run along the last axis.

    Parameters
    ----------
    arc : ndarray, shape (k,)
        Arc length from the clamp [lengths].
    slope : ndarray, shape (..., k)
        Orientation of the beam [rad].
    x, y : ndarray, shape (..., k)
        Position [lengths].
    """

    arc: FloatArray
    slope: FloatArray
    x: FloatArray
    y: FloatArray


def tip_under_load(force: npt.ArrayLike, direction: npt.ArrayLike) -> TipState:
    """Tip of the elastica under a tip force (the map behind eq. (6) of the paper).

    Parameters
    ----------
    force : array_like
        Normalised force ``F_n = F l^2 / EI`` on the tip [-]; a negative one points the other way.
    direction : array_like
        Its orientation ``phi`` from the undeflected beam [rad]: pi/2 pushes sideways, 0 pulls, pi compresses.
        Broadcast against `force`. At exactly pi and above the Euler load pi^2/4 the beam buckles to positive ``y``.

    Returns
    -------
    TipState
        Fields of the broadcast shape.

    Raises
    ------
    InputError
        If a load is not finite or its magnitude exceeds ``FORCE_MAX``.
    """
    load = fold(force, direction)
    z = clamp_parameter(load)
    x, y, slope = bend(load, z, np.zeros_like(z))
    return TipState(x, y, slope, np.hypot(x, y), np.arctan2(y, x))


def shape_under_load(force: npt.ArrayLike, direction: npt.ArrayLike, arc: npt.ArrayLike | None = None) -> BeamShape:
    """Shape of the elastica under a tip force.

    Parameters
    ----------
    force, direction : array_like
        As in :func:`tip_under_load`.
    arc : array_like, shape (k,), optional
        Arc lengths in [0, 1] at which the shape is wanted [lengths]; 101 equal steps by default.

    Returns
    -------
    BeamShape
        Fields of the broadcast shape of the loads, followed by ``k``.

    Raises
    ------
    InputError
        As :func:`tip_under_load`, or if `arc` is not a vector within [0, 1].
    """
    s = np.linspace(0.0, 1.0, 101) if arc is None else np.asarray(arc, dtype=np.float64)
    if s.ndim != 1 or not np.all((s >= 0.0) & (s <= 1.0)):
        raise InputError("The arc lengths of an elastica must be a vector of numbers from 0 (clamp) to 1 (tip).")
    load = fold(np.asarray(force)[..., None], np.asarray(direction)[..., None])
    z = clamp_parameter(load)
    tension = np.sqrt(load.force)

    def equation(fall: FloatArray) -> tuple[FloatArray, FloatArray]:
        c = half_angle(load, z, fall)[1]
        return tension * (1.0 - s) - integrals(load, z, z - fall, c)[0], 1.0 / np.maximum(c, load.c)

    # 1 / p <= dT/dz <= 1 / c bounds the fall of z from the clamp to s.
    low = np.minimum(load.c * tension * s, z)
    high = np.minimum(modulus(load, z) * tension * s, z)
    fall = increasing_root(equation, low, high, 0.5 * (low + high))
    whole_x, whole_y, whole_slope = bend(load, z, np.zeros_like(z))
    rest_x, rest_y, rest_slope = bend(load, z, fall)
    return BeamShape(s, whole_slope - rest_slope, whole_x - rest_x, whole_y - rest_y)


def perpendicular_law(delta: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Force and radius of a tip deflected by a force perpendicular to its radius vector.

    The position of the tip has no component along such a force, so one equation in one unknown is left; to lowest
    orders ``F_n = 3 delta + (13/70) delta^3`` and ``rho / l = 1 - delta^2 / 10``.

    Parameters
    ----------
    delta : array_like
        Deflection ``theta_t - theta_m`` of the tip [rad], at most ``DEFLECTION_MAX`` in magnitude.

    Returns
    -------
    force : ndarray
        Normalised force ``F_n`` [-], with the sign of `delta`.
    rho : ndarray
        Radius ``rho_t / l`` [-].

    Raises
    ------
    InputError
        If a deflection is not finite or larger than ``DEFLECTION_MAX``.
    """
    angle = np.asarray(delta, dtype=np.float64)
    if not np.all(np.abs(angle) <= DEFLECTION_MAX):
        raise InputError(
            f"The elastica under a perpendicular tip force is defined up to a deflection of {DEFLECTION_MAX:.4f} rad; "
            f"got values from {np.min(angle):.4g} to {np.max(angle):.4g} rad. Check the unit of the deflection."
        )
    size = np.maximum(np.abs(angle), TINY)
    phi = size + np.pi / 2
    load = Load(size, phi, np.sign(angle), np.sin(phi / 2), np.cos(phi / 2))

    def equation(z: FloatArray) -> tuple[FloatArray, FloatArray]:
        t, d = integrals(load, z, z, load.c)
        q2 = (load.w / np.cosh(z)) ** 2
        slope = clamp_slope(load, z, d)
        return (load.w * np.tanh(z)) ** 2 - d / t - 0.5 * np.sin(size), q2 * np.tanh(z) + d * slope / t**2

    # sqrt(1.5 delta) is the root's small-deflection limit and 0.3 % off at pi / 2.
    guess = np.sqrt(1.5 * size)
    z = increasing_root(equation, 0.8 * guess, 1.25 * guess, guess)
    t = integrals(load, z, z, load.c)[0]
    return load.sign * t**2, 2.0 * load.w * np.tanh(z) / t
