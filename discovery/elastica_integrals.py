r"""Integrals of the elastica under a tip force, and the equation for the parameter of its clamp.

With :math:`v = \varphi - \theta` the first integral of eq. (5) of the paper is :math:`v'^2 = 4 F_n (w^2 - q^2)`,
:math:`w = \sin(v / 2)`, where :math:`q` is the value of :math:`w` at the tip. Writing :math:`w = q \cosh z` gives two
integrals from the tip on,

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
    "FORCE_MAX",
    "TINY",
    "Load",
    "bend",
    "clamp_parameter",
    "clamp_slope",
    "fold",
    "half_angle",
    "increasing_root",
    "integrals",
    "modulus",
]

FloatArray = npt.NDArray[np.float64]
_Equation = Callable[[FloatArray], tuple[FloatArray, FloatArray]]

FORCE_MAX = 1e4
"""Largest magnitude of the normalised force [-]; beyond it the bent part is a boundary layer of 1 % of the length."""

_ITERATIONS = 80
_EPS = 4 * np.finfo(np.float64).eps
# Stands for an absent force: every quotient keeps its limit, and the result is that of the straight beam.
TINY = 1e-100


@dataclass(frozen=True)
class Load:
    """A force folded to the upper half plane: `sign` restores the side, `w`, `c` are sine and cosine of `phi` / 2."""

    force: FloatArray
    phi: FloatArray
    sign: FloatArray
    w: FloatArray
    c: FloatArray


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


def modulus(load: Load, z: FloatArray) -> FloatArray:
    """Modulus p of the integrals: the cosine of v / 2 at the tip, where z is the clamp's parameter."""
    return np.sqrt(load.c**2 + (load.w * np.tanh(z)) ** 2)


def half_angle(load: Load, z: FloatArray, fall: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Sine and cosine of v / 2 where the parameter has fallen from z by `fall`, without cancellation near w = 1."""
    w = load.w * np.cosh(z - fall) / np.cosh(z)
    return w, np.sqrt(load.c**2 + (load.w / np.cosh(z)) ** 2 * np.sinh(fall) * np.sinh(2.0 * z - fall))


def integrals(load: Load, z: FloatArray, here: FloatArray, c: FloatArray) -> tuple[FloatArray, FloatArray]:
    """T and D from the tip to the parameter `here`, where the cosine of v / 2 is c; z is the clamp's."""
    p = modulus(load, z)
    tanh, sech2 = np.tanh(here), 1.0 / np.cosh(here) ** 2
    first = sech2 * (c / p) ** 2
    t = tanh / p * elliprf(first, sech2, 1.0)
    d = (load.w / np.cosh(z)) ** 2 * tanh**3 / (3.0 * p) * elliprd(first, 1.0, sech2)
    return t, d


def clamp_slope(load: Load, z: FloatArray, d: FloatArray) -> FloatArray:
    """DT/dz at the clamp, for a fixed direction of the force."""
    return (load.c + np.tanh(z) * d) / modulus(load, z) ** 2


def clamp_parameter(load: Load) -> FloatArray:
    """Parameter z of the clamp under a load: the root of T(z) = sqrt(F_n)."""
    tension = np.sqrt(load.force)

    def equation(z: FloatArray) -> tuple[FloatArray, FloatArray]:
        t, d = integrals(load, z, z, load.c)
        return t - tension, clamp_slope(load, z, d)

    # 1 <= T / z <= 1 / c, with equality at phi = 0.
    return increasing_root(equation, load.c * tension, tension, tension)


def bend(load: Load, z: FloatArray, fall: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Displacement and turn of the beam from the point where the parameter has fallen by `fall`, to the tip."""
    here = z - fall
    w, c = half_angle(load, z, fall)
    p = modulus(load, z)
    t, d = integrals(load, z, here, c)
    tension = np.sqrt(load.force)
    q2 = (load.w / np.cosh(z)) ** 2
    along = (t * (1.0 - 2.0 * q2) - 2.0 * d) / tension
    across = 2.0 * w * np.tanh(here) / tension
    turn = 2.0 * np.arcsin(w * np.tanh(here) ** 2 / (p + c / np.cosh(here)))
    cos, sin = np.cos(load.phi), np.sin(load.phi)
    return cos * along + sin * across, load.sign * (sin * along - cos * across), load.sign * turn


def increasing_root(equation: _Equation, low: FloatArray, high: FloatArray, start: FloatArray) -> FloatArray:
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
