"""Tip and shape of the elastica under a force of any magnitude and direction, equation (5) of the paper."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from benchmarks.paper.theory.elastica.loads import blockwise, clamp_parameter, fold
from discovery.foundation.errors import InputError
from discovery.theory.elastica.integrals import bend, increasing_root

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class TipState:
    """The tip of a beam of unit length bent by eq. (5), in the clamp's frame; every field has the shape of the loads.

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
    shortening : ndarray
        ``1 - radius`` [-], with the digits that the radius of a nearly straight beam has lost.
    """

    x: FloatArray
    y: FloatArray
    slope: FloatArray
    radius: FloatArray
    angle: FloatArray
    shortening: FloatArray


@dataclass(frozen=True)
class BeamShape:
    """The bent line of a beam of unit length, the solution of eq. (5); points run along the last axis.

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

    Smooth in the components of the force, except where compression along the undeflected beam reaches the Euler load.
    The angle keeps its relative precision however straight the beam; the shortening too, under a finite force along the
    beam, and to about ``1e-14 / F_n`` under a force that vanishes.

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

    def tip(force: FloatArray, direction: FloatArray) -> tuple[FloatArray, ...]:
        load = fold(force, direction)
        b = bend(load.w, load.c, clamp_parameter(load))
        x, y = 1.0 - b.shortening, load.sign * b.y
        return x, y, load.sign * b.turn, np.hypot(x, y), np.arctan2(y, x), b.radial_shortening

    return TipState(*blockwise(tip, np.asarray(force, np.float64), np.asarray(direction, np.float64)))


def shape_under_load(force: npt.ArrayLike, direction: npt.ArrayLike, arc: npt.ArrayLike | None = None) -> BeamShape:
    """Shape of the elastica under a tip force: the solution of eq. (5) of the paper.

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
    whole, tension = bend(load.w, load.c, z), np.sqrt(load.force)
    p = np.sqrt(whole.p2)

    def half_angle(fall: FloatArray, w: FloatArray, c: FloatArray, z: FloatArray) -> tuple[FloatArray, FloatArray]:
        # Without cancellation near w = 1.
        c2 = c**2 + (w / np.cosh(z)) ** 2 * np.sinh(fall) * np.sinh(2.0 * z - fall)
        return w * np.cosh(z - fall) / np.cosh(z), np.sqrt(c2)

    def equation(fall: FloatArray, *parameters: FloatArray) -> tuple[FloatArray, FloatArray]:
        *clamp, rest = parameters
        w, c = half_angle(fall, *clamp)
        return rest - bend(w, c, clamp[2] - fall).t, 1.0 / c

    # 1 / p <= dT/dz <= 1 / c bounds the fall of z from the clamp to s.
    low, high = np.minimum(load.c * tension * s, z), np.minimum(p * tension * s, z)
    fall = increasing_root(equation, low, high, 0.5 * (low + high), (load.w, load.c, z, tension * (1.0 - s)))
    rest = bend(*half_angle(fall, load.w, load.c, z), z - fall)
    slope = whole.turn - rest.turn
    x, y = 1.0 - rest.shortening, rest.y
    return BeamShape(
        s,
        load.sign * slope,
        1.0 - whole.shortening - (1.0 - s) * (np.cos(slope) * x - np.sin(slope) * y),
        load.sign * (whole.y - (1.0 - s) * (np.sin(slope) * x + np.cos(slope) * y)),
    )
