r"""The static elastica: a clamped, inextensible beam of unit length bent by a force at its tip.

The normalised equation is eq. (5) of the paper,

.. math:: \theta'' = F_n \sin(\theta - \varphi), \quad \theta(0) = 0, \quad \theta'(1) = 0, \quad F_n = F l^2 / EI,

for a force of any magnitude and of any direction :math:`\varphi`, on the branch without inflection (the stable one).
With :math:`v = \varphi - \theta` its first integral is :math:`v'^2 = 4 F_n (w^2 - q^2)`, :math:`w = \sin(v / 2)`, where
:math:`q` is the value of :math:`w` at the tip. Writing :math:`w = q \cosh z` gives two integrals from the tip on,

.. math:: T = \int_0^z \frac{dz}{\Delta} = \sqrt{F_n} (1 - s), \quad
          D = \int_0^z \frac{q^2 \sinh^2 z}{\Delta} dz, \quad \Delta = \sqrt{1 - w^2},

both in Carlson's symmetric forms (B. C. Carlson, Numer. Algorithms 10 (1995) 13; DLMF 19.29), which keep full precision
from the small-deflection limit to strong forces. One equation is left for :math:`z` at the clamp, and Newton's method
solves it: both integrals have simple derivatives.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.special import elliprd, elliprf

from discovery.errors import ComputationError, InputError

__all__ = [
    "DEFLECTION_MAX",
    "FORCE_MAX",
    "BeamShape",
    "TipState",
    "load_at_tip",
    "perpendicular_law",
    "shape_under_load",
    "tip_under_load",
]

FloatArray = npt.NDArray[np.float64]
_Equation = Callable[[FloatArray], tuple[FloatArray, FloatArray]]

FORCE_MAX = 1e4
"""Largest magnitude of the normalised force [-]; beyond it the bent part is a boundary layer of 1 % of the length."""

DEFLECTION_MAX = np.pi / 2
"""Largest tip deflection of :func:`perpendicular_law` [rad]; there the force points back along the clamped end."""

_ITERATIONS = 80
_EPS = 4 * np.finfo(np.float64).eps
# Of central differences: balances the curvature of the map from load to tip and its rounding.
_STEP = 1e-5
# Stands for an absent force: every quotient keeps its limit, and the result is that of the straight beam.
_TINY = 1e-100


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


@dataclass(frozen=True)
class _Load:
    """A force folded to the upper half plane: `sign` restores the side, `w`, `c` are sine and cosine of `phi` / 2."""

    force: FloatArray
    phi: FloatArray
    sign: FloatArray
    w: FloatArray
    c: FloatArray


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
    load = _fold(force, direction)
    z = _clamp_parameter(load)
    x, y, slope = _bend(load, z, np.zeros_like(z))
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
    load = _fold(np.asarray(force)[..., None], np.asarray(direction)[..., None])
    z = _clamp_parameter(load)
    tension = np.sqrt(load.force)

    def equation(fall: FloatArray) -> tuple[FloatArray, FloatArray]:
        c = _half_angle(load, z, fall)[1]
        return tension * (1.0 - s) - _integrals(load, z, z - fall, c)[0], 1.0 / np.maximum(c, load.c)

    # 1 / p <= dT/dz <= 1 / c bounds the fall of z from the clamp to s.
    low = np.minimum(load.c * tension * s, z)
    high = np.minimum(_modulus(load, z) * tension * s, z)
    fall = _increasing_root(equation, low, high, 0.5 * (low + high))
    whole_x, whole_y, whole_slope = _bend(load, z, np.zeros_like(z))
    rest_x, rest_y, rest_slope = _bend(load, z, fall)
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
    size = np.maximum(np.abs(angle), _TINY)
    phi = size + np.pi / 2
    load = _Load(size, phi, np.sign(angle), np.sin(phi / 2), np.cos(phi / 2))

    def equation(z: FloatArray) -> tuple[FloatArray, FloatArray]:
        t, d = _integrals(load, z, z, load.c)
        q2 = (load.w / np.cosh(z)) ** 2
        slope = _clamp_slope(load, z, d)
        return (load.w * np.tanh(z)) ** 2 - d / t - 0.5 * np.sin(size), q2 * np.tanh(z) + d * slope / t**2

    # sqrt(1.5 delta) is the root's small-deflection limit and 0.3 % off at pi / 2.
    guess = np.sqrt(1.5 * size)
    z = _increasing_root(equation, 0.8 * guess, 1.25 * guess, guess)
    t = _integrals(load, z, z, load.c)[0]
    return load.sign * t**2, 2.0 * load.w * np.tanh(z) / t


def load_at_tip(rho: npt.ArrayLike, delta: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Force that holds the tip at a position: both components of eq. (6) of the paper.

    In small deflection the radial component alone fixes ``(1 - rho) / delta^2`` and the tangential one the angle, so
    Newton's method in these components converges from the perpendicular force in a few steps.

    Parameters
    ----------
    rho : array_like
        Radius ``rho_t / l`` of the tip [-], below 1.
    delta : array_like
        Its polar angle ``theta_t - theta_m`` [rad], not 0, at most ``DEFLECTION_MAX`` in magnitude.

    Returns
    -------
    force : ndarray
        Normalised magnitude ``F_n`` [-].
    direction : ndarray
        Orientation ``phi`` from the undeflected beam [rad]. Rounding of `rho` counts ``1 / delta^2`` times.

    Raises
    ------
    InputError
        If a position is straight, out of reach or beyond the domain.
    ComputationError
        If the force is not found: the position needs one beyond ``FORCE_MAX``, or a shape with an inflection.
    """
    radius, angle = np.broadcast_arrays(np.asarray(rho, np.float64), np.asarray(delta, np.float64))
    size = np.abs(angle)
    if not np.all((radius > 0.0) & (radius < 1.0) & (size > 0.0) & (size <= DEFLECTION_MAX)):
        raise InputError(
            "The force at the tip of an elastica is defined for radii between 0 and 1 lengths and deflections of at "
            f"most {DEFLECTION_MAX:.4f} rad that are not 0; check the units, and leave out the straight positions."
        )
    target = np.log((1.0 - radius) / size**2), np.log(size)

    def components(radial: FloatArray, tangential: FloatArray) -> tuple[FloatArray, FloatArray]:
        return np.hypot(radial, tangential * size), size + np.arctan2(tangential * size, radial)

    def error(radial: FloatArray, tangential: FloatArray) -> FloatArray:
        tip = tip_under_load(*components(radial, tangential))
        return np.stack([np.log((1.0 - tip.radius) / tip.angle**2) - target[0], np.log(tip.angle) - target[1]])

    radial, tangential = np.zeros_like(size), perpendicular_law(size)[0] / size
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        for _ in range(_ITERATIONS):
            e = error(radial, tangential)
            if np.all(np.abs(e) < 1e-9 + 1e-15 / size**2):
                force, direction = components(radial, tangential)
                return force, np.sign(angle) * direction
            a, c = (error(radial + _STEP, tangential) - error(radial - _STEP, tangential)) / (2.0 * _STEP)
            b, d = (error(radial, tangential + _STEP) - error(radial, tangential - _STEP)) / (2.0 * _STEP)
            determinant = a * d - b * c
            radial = radial - (d * e[0] - b * e[1]) / determinant
            tangential = tangential - (a * e[1] - c * e[0]) / determinant
            if not np.all(np.hypot(radial, tangential) < FORCE_MAX / 2.0):
                break
    raise ComputationError("No tip force without inflection of the beam was found for at least one of the positions.")


def _fold(force: npt.ArrayLike, direction: npt.ArrayLike) -> _Load:
    magnitude, angle = np.broadcast_arrays(np.asarray(force, np.float64), np.asarray(direction, np.float64))
    if not (np.all(np.abs(magnitude) <= FORCE_MAX) and np.all(np.isfinite(angle))):
        raise InputError(
            f"A tip load of the elastica must be finite and at most {FORCE_MAX:g} in units of EI / l^2; "
            f"got forces from {np.min(magnitude):.4g} to {np.max(magnitude):.4g}."
        )
    angle = np.where(magnitude < 0.0, angle + np.pi, angle)
    angle = angle - 2.0 * np.pi * np.round(angle / (2.0 * np.pi))
    phi = np.abs(angle)
    sign = np.where(angle < 0.0, -1.0, 1.0)
    return _Load(np.maximum(np.abs(magnitude), _TINY), phi, sign, np.sin(phi / 2), np.cos(phi / 2))


def _modulus(load: _Load, z: FloatArray) -> FloatArray:
    return np.sqrt(load.c**2 + (load.w * np.tanh(z)) ** 2)


def _half_angle(load: _Load, z: FloatArray, fall: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Sine and cosine of v / 2 where the parameter has fallen from z by `fall`, without cancellation near w = 1."""
    w = load.w * np.cosh(z - fall) / np.cosh(z)
    return w, np.sqrt(load.c**2 + (load.w / np.cosh(z)) ** 2 * np.sinh(fall) * np.sinh(2.0 * z - fall))


def _integrals(load: _Load, z: FloatArray, here: FloatArray, c: FloatArray) -> tuple[FloatArray, FloatArray]:
    """T and D from the tip to the parameter `here`, where the cosine of v / 2 is c; z is the clamp's."""
    p = _modulus(load, z)
    tanh, sech2 = np.tanh(here), 1.0 / np.cosh(here) ** 2
    first = sech2 * (c / p) ** 2
    t = tanh / p * elliprf(first, sech2, 1.0)
    d = (load.w / np.cosh(z)) ** 2 * tanh**3 / (3.0 * p) * elliprd(first, 1.0, sech2)
    return t, d


def _clamp_slope(load: _Load, z: FloatArray, d: FloatArray) -> FloatArray:
    """DT/dz at the clamp, for a fixed direction of the force."""
    return (load.c + np.tanh(z) * d) / _modulus(load, z) ** 2


def _clamp_parameter(load: _Load) -> FloatArray:
    tension = np.sqrt(load.force)

    def equation(z: FloatArray) -> tuple[FloatArray, FloatArray]:
        t, d = _integrals(load, z, z, load.c)
        return t - tension, _clamp_slope(load, z, d)

    # 1 <= T / z <= 1 / c, with equality at phi = 0.
    return _increasing_root(equation, load.c * tension, tension, tension)


def _bend(load: _Load, z: FloatArray, fall: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Displacement and turn of the beam from the point where the parameter has fallen by `fall`, to the tip."""
    here = z - fall
    w, c = _half_angle(load, z, fall)
    p = _modulus(load, z)
    t, d = _integrals(load, z, here, c)
    tension = np.sqrt(load.force)
    q2 = (load.w / np.cosh(z)) ** 2
    along = (t * (1.0 - 2.0 * q2) - 2.0 * d) / tension
    across = 2.0 * w * np.tanh(here) / tension
    turn = 2.0 * np.arcsin(w * np.tanh(here) ** 2 / (p + c / np.cosh(here)))
    cos, sin = np.cos(load.phi), np.sin(load.phi)
    return cos * along + sin * across, load.sign * (sin * along - cos * across), load.sign * turn


def _increasing_root(equation: _Equation, low: FloatArray, high: FloatArray, start: FloatArray) -> FloatArray:
    """Root of an increasing function, elementwise: Newton's method, kept in its bracket by geometric bisection."""
    # Wider than the bounds by more than rounding: a root on a bound is still reached by Newton's steps.
    low, high = low * (1.0 - 1e-9), high * (1.0 + 1e-9)
    z = start
    done = np.zeros(np.shape(z), dtype=bool)
    for _ in range(_ITERATIONS):
        value, slope = equation(z)
        low, high = np.where(value < 0.0, z, low), np.where(value > 0.0, z, high)
        step = z - value / slope
        found = np.abs(step - z) <= _EPS * np.abs(z)
        inside = found | ((step > low) & (step < high))
        z = np.where(done, z, np.where(inside, step, np.sqrt(low * high)))
        # A bracket that noise has closed is as good as a short step.
        done |= found | (high <= low * (1.0 + _EPS))
        if np.all(done):
            return z
    raise ComputationError("Newton's method for the elastica did not converge for at least one of the loads.")
