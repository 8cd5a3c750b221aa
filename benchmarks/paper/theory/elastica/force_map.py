r"""The inverse of the elastica's map, eq. (6) of the paper: the force that holds the tip at a given position.

A tip that the beam reaches without inflection lies between the circle of the straight beam, :math:`\rho = l`, which
takes an infinite force, and the curve of the beam buckled along its clamped end, :math:`\varphi = \pi`. Near the
straight beam the radial force alone fixes :math:`(1 - \rho) / \delta^2`, the tangential one :math:`\delta`: so Newton's
method works in :math:`F_r` and :math:`F_t / \delta`, in which the map is regular there. Every iterate is an elastica,
given by its parameter z and its direction, and one pair of integrals yields its forces and all derivatives.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from benchmarks.paper.theory.elastica.first_guess import first_guess
from benchmarks.paper.theory.elastica.loads import FORCE_MAX, blockwise
from benchmarks.paper.theory.elastica.polar import polar_force, polar_slopes
from benchmarks.paper.theory.elastica.reach import radius_limits
from discovery.foundation.errors import ComputationError, InputError
from discovery.theory.elastica.integrals import bend

FloatArray = npt.NDArray[np.float64]

_ITERATIONS = 30
# Relative step of the forces and of the position after which Newton's method, whose next error is its square, is done.
_CLOSE = 3e-8
_EPS = 4 * np.finfo(np.float64).eps
# The tip's shortening is known to this over the force, relatively; see `tip_under_load`.
_NOISE = 1e-13


@dataclass(frozen=True)
class PolarForce:
    """The force that holds a tip, and what it does at the clamp; every field has the shape of the positions.

    Parameters
    ----------
    radial : ndarray
        Normalised component ``F_r`` along the tip's radius, outward [-].
    tangential : ndarray
        Normalised component ``F_t`` across it, towards increasing ``delta`` [-].
    moment : ndarray
        Bending moment at the clamp over ``EI / l``, ``rho F_n sin(phi - delta)`` [-]; the coupling torque of eq. (11)
        of the paper is minus this.
    """

    radial: FloatArray
    tangential: FloatArray
    moment: FloatArray


def load_at_tip(rho: npt.ArrayLike, delta: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Force that holds the tip at a position: eq. (6) of the paper, as magnitude and orientation.

    `beam.tip_under_load` returns to the position, ``shape_under_load`` draws the beam.

    Parameters
    ----------
    rho, delta : array_like
        As in :func:`force_components`.

    Returns
    -------
    force : ndarray
        Normalised magnitude ``F_n`` [-].
    direction : ndarray
        Orientation ``phi`` from the undeflected beam [rad], from -pi to pi, with the sign of `delta`. Next to
        compression of a nearly straight beam its rounding moves the tip by a few ``1e-16 / delta`` of its deflection.

    Raises
    ------
    InputError, ComputationError
        As :func:`force_components`.
    """
    radial, stiffness = _held(rho, delta)
    size = np.abs(delta)
    tangential = stiffness * size
    direction = np.minimum(size + np.arctan2(tangential, radial), np.pi)
    return np.minimum(np.hypot(radial, tangential), FORCE_MAX), np.copysign(direction, delta)


def force_components(rho: npt.ArrayLike, delta: npt.ArrayLike) -> PolarForce:
    """Force that holds the tip at a position: eq. (6) of the paper in polar components, and the moment of eq. (11).

    The domain is every tip of the branch without inflection, from the beam pulled straight to the buckled one, with a
    force of at most ``FORCE_MAX``: :func:`benchmarks.paper.theory.elastica.reach.radius_limits` has the radii. Where
    ``delta = 0`` the beam is straight and the force along it undetermined; near there rounding of `rho` moves the
    radial force by about ``2e-14 / delta^2``.

    Parameters
    ----------
    rho : array_like
        Radius ``rho_t / l`` of the tip [-].
    delta : array_like
        Its polar angle ``theta_t - theta_m`` [rad]. Broadcast against `rho`.

    Returns
    -------
    PolarForce
        Fields of the broadcast shape.

    Raises
    ------
    InputError
        If a position is straight, not finite or out of reach; the message names the first and its limits.
    ComputationError
        If Newton's method fails within reach.
    """
    radial, stiffness = _held(rho, delta)
    tangential = stiffness * np.asarray(delta, np.float64)
    return PolarForce(radial, tangential, np.asarray(rho, np.float64) * tangential)


def _held(rho: npt.ArrayLike, delta: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return the radial force and the tangential one over delta."""
    radius, angle = np.broadcast_arrays(np.asarray(rho, np.float64), np.asarray(delta, np.float64))
    size = np.abs(angle)
    if not (np.isfinite(radius).all() and np.isfinite(angle).all()):
        raise InputError("The radius or deflection of the tip is not finite somewhere; leave out the gaps (NaN).")
    if not np.all((radius > 0.0) & (radius < 1.0) & (size > 0.0) & (size < np.pi)):
        raise InputError(
            "The force at the tip of an elastica is defined for radii between 0 and 1 lengths and deflections between "
            "0 and pi rad, in magnitude, both exclusive; check the units, and leave out the straight positions."
        )
    radial, stiffness = blockwise(_newton, 1.0 - radius, size)
    # Rounding of the radius next to the limit moves the force by this.
    lost = ~(np.hypot(radial, stiffness * size) <= FORCE_MAX * (1.0 + _EPS / (1.0 - radius)))
    if np.any(lost):
        low, high = radius_limits(size[lost])
        r, d = radius[lost], angle[lost]
        out = (r < low + _EPS) | (r > high - _EPS)
        if not np.any(out):
            raise ComputationError("The force on the tip of the elastica was not found for at least one position.")
        k = int(np.argmax(out))
        raise InputError(
            f"The tip of an elastica without inflection, under a force of at most {FORCE_MAX:g} EI / l^2, has a radius "
            f"from {low[k]:.6g} to {high[k]:.8g} lengths at a deflection of {d[k]:.4g} rad; got {r[k]:.8g}."
        )
    return radial, stiffness


def _half_direction(
    radial: FloatArray, tangential: FloatArray, sine: FloatArray, cosine: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return sine and cosine of phi / 2, from those of delta / 2, and the root of the force."""
    force = np.hypot(radial, tangential)
    large = np.sqrt(0.5 * (force + np.abs(radial)) / force)
    small = 0.5 * tangential / (force * large)
    pull = radial > 0.0
    sin, cos = np.where(pull, small, large), np.where(pull, large, small)
    # Beyond pi, where the beam would have an inflection, the direction stays at pi.
    return sin * cosine + cos * sine, np.maximum(cos * cosine - sin * sine, 1e-17), np.sqrt(force)


@np.errstate(all="ignore")
def _newton(shortening: FloatArray, delta: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the radial force and the tangential one over delta, NaN where they are not found; delta is positive."""
    out = np.full((2, delta.size), np.nan)
    left = np.arange(delta.size)
    radial, stiffness = first_guess(shortening, delta)
    sine, cosine = np.sin(0.5 * delta), np.cos(0.5 * delta)
    w, c, root = _half_direction(radial, stiffness * delta, sine, cosine)
    # The clamp's moment is exact; towards strong forces, where it fixes no z, T - z has a limit.
    tau = (1.0 - shortening) * stiffness * delta / (2.0 * root * w)
    z = np.where(tau < 0.95, np.arctanh(np.minimum(tau, 0.95)), root - np.log(2.0 / (1.0 + c)))
    z = np.clip(z, c * root, root)
    for _ in range(_ITERATIONS):
        b = bend(w, c, z)
        s, angle, shorter = polar_slopes(b), np.arctan2(b.y, 1.0 - b.shortening), b.radial_shortening
        # In the logarithms of delta and (1 - rho) / delta^2 a wrong amplitude of a small deflection is one step away.
        turn, fall = np.log(delta / angle), np.log(shortening / shorter) - 2.0 * np.log(delta / angle)
        turn_z, turn_phi = s.delta_z / angle, s.delta_phi / angle
        fall_z, fall_phi = s.shortening_z / shorter - 2.0 * turn_z, s.shortening_phi / shorter - 2.0 * turn_phi
        determinant = fall_z * turn_phi - fall_phi * turn_z
        dz = (fall * turn_phi - turn * fall_phi) / determinant
        dphi = (turn * fall_z - fall * turn_z) / determinant
        pull, push = polar_force(b)
        stiff = push / angle
        more = s.radial_z * dz + s.radial_phi * dphi
        stiffer = (s.tangential_z * dz + s.tangential_phi * dphi) / angle - stiff * (turn_z * dz + turn_phi * dphi)
        radial, stiffness = pull + more, np.maximum(stiff + stiffer, 0.1 * stiff)
        close = _CLOSE + _NOISE / b.t**2
        found = (np.abs(more) <= close * (8.0 + np.abs(radial))) & (np.abs(stiffer) <= close * stiffness)
        found &= np.maximum(np.abs(turn), np.abs(fall)) <= close
        out[:, left[found]] = radial[found], stiffness[found]
        if np.all(found):
            break
        keep = ~found
        left = left[keep]
        shortening, delta, sine, cosine, radial, stiffness = (
            a[keep] for a in (shortening, delta, sine, cosine, radial, stiffness)
        )
        before = w[keep], c[keep]
        w, c, root = _half_direction(radial, stiffness * delta, sine, cosine)
        dphi = 2.0 * np.arctan2(w * before[1] - c * before[0], c * before[1] + w * before[0])
        z = np.clip(z[keep] + (root - b.t[keep] - b.t_phi[keep] * dphi) / b.t_z[keep], c * root, root)
    return out[0], out[1]
