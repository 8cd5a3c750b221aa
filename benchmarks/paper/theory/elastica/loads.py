"""A load of any size and direction on the elastica: the parameter of its clamp, and the slopes of its tip."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from discovery.foundation.errors import InputError
from discovery.theory.elastica.integrals import TINY, Bend, bend, increasing_root

FloatArray = npt.NDArray[np.float64]

FORCE_MAX = 1e4
"""Largest magnitude of the normalised force [-]; beyond it the bent part is a boundary layer of 1 % of the length."""

# Relative step after which Halley's method (error cubed) is done.
_HALLEY = 3e-6
# Elements of a block: its arrays stay in the processor's cache.
_BLOCK = 4096


@dataclass(frozen=True)
class Load:
    """A force folded to the upper half plane: `sign` restores the side, `w`, `c` are sine and cosine of `phi` / 2."""

    force: FloatArray
    phi: FloatArray
    sign: FloatArray
    w: FloatArray
    c: FloatArray


@dataclass(frozen=True)
class Slopes:
    """Derivatives of a bend's tip by its parameter z and by the direction phi of its force."""

    y_z: FloatArray
    y_phi: FloatArray
    shortening_z: FloatArray
    shortening_phi: FloatArray


def fold(force: npt.ArrayLike, direction: npt.ArrayLike) -> Load:
    """Return a load, its direction brought to [0, pi]; refuse one that is not finite or beyond ``FORCE_MAX``."""
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
    return Load(np.maximum(np.abs(magnitude), TINY), phi, sign, np.sin(phi / 2), np.cos(phi / 2))


def slopes(b: Bend) -> Slopes:
    """Differentiate the tip by z and by phi, with the integrals that are there."""
    w, c, tau, sigma, q2, t, t_z, t_phi = b.w, b.c, b.tau, b.sigma, b.q2, b.t, b.t_z, b.t_phi
    sin, cos = 2.0 * w * c, (c - w) * (c + w)
    # The tip's coordinates along the force, 1 - 2 q^2 - 2 D / T, and across it, 2 w tanh(z) / T.
    d, across = b.d / t, 2.0 * w * tau / t
    along_z = 2.0 * q2 * tau + 2.0 * d * t_z / t
    along_phi = -w * (2.0 * c * sigma + (tau - c * sigma * t) / t) + 2.0 * d * t_phi / t
    across_z, across_phi = (2.0 * w * sigma - across * t_z) / t, (c * tau - across * t_phi) / t
    return Slopes(
        sin * along_z - cos * across_z,
        sin * along_phi - cos * across_phi + 1.0 - b.shortening,
        -cos * along_z - sin * across_z,
        -cos * along_phi - sin * across_phi + b.y,
    )


def clamp_parameter(load: Load) -> FloatArray:
    """Parameter z of the clamp under a load: the root of T(z) = sqrt(F_n)."""
    tension = np.sqrt(load.force)

    def equation(z: FloatArray, w: FloatArray, c: FloatArray, tension: FloatArray) -> tuple[FloatArray, FloatArray]:
        b = bend(w, c, z)
        error, slope = b.t - tension, b.t_z
        curvature = (b.sigma * b.d + b.q2 * b.tau * (b.tau * b.t - 2.0 * slope)) / b.p2
        # Halley's method is Newton's with this slope.
        return error, np.maximum(slope - 0.5 * error * curvature / slope, 0.5 * slope)

    # 1 <= T / z <= 1 / c, with equality at phi = 0; T - z tends to log(2 / (1 + c)) as the force grows.
    low = load.c * tension
    start = np.maximum(low, tension - np.log(2.0 / (1.0 + load.c)))
    return increasing_root(equation, low, tension, start, (load.w, load.c, tension), close=_HALLEY)


def blockwise(work: Callable[..., tuple[FloatArray, ...]], *arrays: FloatArray) -> tuple[FloatArray, ...]:
    """Apply an elementwise function of vectors to arrays of any common shape, block after block."""
    shape = np.broadcast_shapes(*(np.shape(a) for a in arrays))
    flat = [np.broadcast_to(a, shape).ravel() for a in arrays]
    starts = range(0, max(flat[0].size, 1), _BLOCK)
    parts = [work(*(a[k : k + _BLOCK] for a in flat)) for k in starts]
    return tuple(np.concatenate(column).reshape(shape)[()] for column in zip(*parts, strict=True))
