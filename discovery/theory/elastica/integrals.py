r"""Integrals of the elastica under a tip force, and the equation for the parameter of its clamp.

With :math:`v = \varphi - \theta` the first integral of eq. (5) of the paper is :math:`v'^2 = 4 F_n (w^2 - q^2)`,
:math:`w = \sin(v / 2)`, where :math:`q` is the value of :math:`w` at the tip. Writing :math:`w = q \cosh z` gives two
integrals from the tip on,

.. math:: T = \int_0^z \frac{dz}{\Delta} = \sqrt{F_n} (1 - s), \quad
          D = \int_0^z \frac{q^2 \sinh^2 z}{\Delta} dz, \quad \Delta = \sqrt{1 - w^2},

both in Carlson's symmetric forms (B. C. Carlson, Numer. Algorithms 10 (1995) 13; DLMF 19.29). With
:math:`\sigma = 1 / \cosh^2 z`, :math:`p^2 = 1 - q^2`, :math:`c = \Delta(z)` and :math:`f = \sigma c^2 / p^2` these are
:math:`T = \tanh z\, R_F(f, \sigma, 1) / p` and :math:`D = q^2 \tanh^3 z\, R_D(f, 1, \sigma) / 3p`, and the tip's

.. math:: y = \frac{2 w c \tanh^2 z}{3 R_F} \left(R_1 + \frac{w^2}{c^2} f R_f\right), \quad
          1 - x = \frac{2 w^2 \tanh^2 z}{3 R_F} \left(R_1 - f R_f\right),

:math:`R_1 = R_D(f, \sigma, 1)`, :math:`R_f = R_D(\sigma, 1, f)`: nothing cancels in y, and in 1 - x nothing as long as
the force is finite, however straight the beam. Any part of the beam up to its tip is such a beam again.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.special import elliprd

from discovery.foundation.errors import ComputationError, InputError

__all__ = [
    "FORCE_MAX",
    "TINY",
    "Bend",
    "Load",
    "Slopes",
    "bend",
    "blockwise",
    "clamp_parameter",
    "fold",
    "increasing_root",
    "slopes",
]

FloatArray = npt.NDArray[np.float64]
_Equation = Callable[..., tuple[FloatArray, FloatArray]]

FORCE_MAX = 1e4
"""Largest magnitude of the normalised force [-]; beyond it the bent part is a boundary layer of 1 % of the length."""

_ITERATIONS = 80
_EPS = 4 * np.finfo(np.float64).eps
# Relative steps after which Newton's (error squared) and Halley's method (cubed) are done.
_NEWTON, _HALLEY = 1e-8, 3e-6
# Elements of a block: its arrays stay in the processor's cache.
_BLOCK = 4096
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


@dataclass(frozen=True)
class Bend:
    """A beam bent by a force at its tip: arguments and moduli, then the integrals `t`, `d` and the tip over its length.

    The frame is that of the clamp, `shortening` is 1 - x / l and `y` is y / l; `sigma`, `p2`, `q2` are those of the
    module, `tau` = tanh(z) and `j` = D / w^2.
    """

    w: FloatArray
    c: FloatArray
    tau: FloatArray
    sigma: FloatArray
    p2: FloatArray
    q2: FloatArray
    t: FloatArray
    j: FloatArray
    y: FloatArray
    shortening: FloatArray

    @property
    def d(self) -> FloatArray:
        """The integral D."""
        return self.w**2 * self.j

    @property
    def turn(self) -> FloatArray:
        """Orientation of the tip [rad]."""
        return 2.0 * np.arcsin(self.w * self.tau**2 / (np.sqrt(self.p2) + self.c * np.sqrt(self.sigma)))

    @property
    def radial_shortening(self) -> FloatArray:
        """The tip's 1 - rho / l, without the cancellation near the straight beam."""
        square = self.shortening * (2.0 - self.shortening) - self.y**2
        return square / (1.0 + np.sqrt(1.0 - square))

    @property
    def t_z(self) -> FloatArray:
        """DT/dz for a fixed direction of the force."""
        return (self.c + self.tau * self.d) / self.p2

    @property
    def t_phi(self) -> FloatArray:
        """DT/dphi for a fixed parameter."""
        return 0.5 * self.w * (self.tau - self.c * self.j) / self.p2


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


def bend(w: FloatArray, c: FloatArray, z: FloatArray) -> Bend:
    """Integrals and tip of a beam with clamp parameter z under a force whose half direction has sine w, cosine c."""
    tau, sigma = np.tanh(z), 1.0 / np.cosh(z) ** 2
    p2 = c**2 + (w * tau) ** 2
    p = np.sqrt(p2)
    f = sigma * c**2 / p2
    r_1, r_sigma = elliprd(f, sigma, 1.0), elliprd(f, 1.0, sigma)
    # The three R_D of the same arguments have a sum without integrals (DLMF 19.21.8); this one is the largest.
    r_f = 3.0 * p / (c * sigma) - r_1 - r_sigma
    three_r = f * r_f + sigma * r_sigma + r_1  # 3 R_F
    scale = 2.0 * w * tau**2 / three_r
    return Bend(
        w,
        c,
        tau=tau,
        sigma=sigma,
        p2=p2,
        q2=w**2 * sigma,
        t=tau * three_r / (3.0 * p),
        j=sigma * tau**3 * r_sigma / (3.0 * p),
        y=scale * c * (r_1 + w**2 * sigma / p2 * r_f),
        shortening=scale * w * (r_1 - f * r_f),
    )


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


def increasing_root(
    equation: _Equation,
    low: FloatArray,
    high: FloatArray,
    start: FloatArray,
    parameters: tuple[FloatArray, ...],
    close: float = _NEWTON,
) -> FloatArray:
    """Root of an increasing function, elementwise: Newton's method, kept in its bracket by geometric bisection.

    `equation` takes z and the `parameters`, all vectors of the elements not yet `close`, and returns value and slope.
    """
    shape = np.shape(start)
    left, out = np.arange(np.size(start)), np.empty(np.size(start))
    # Wider than the bounds by more than rounding: a root on a bound is still reached by Newton's steps.
    z, low, high, *rest = (np.broadcast_to(a, shape).ravel() for a in (start, low, high, *parameters))
    low, high = low * (1.0 - 1e-9), high * (1.0 + 1e-9)
    for _ in range(_ITERATIONS):
        value, slope = equation(z, *rest)
        low, high = np.where(value < 0.0, z, low), np.where(value > 0.0, z, high)
        step = z - value / slope
        # A bracket that noise has closed is as good as a short step.
        found = (np.abs(step - z) <= close * np.abs(z)) | (high <= low * (1.0 + _EPS))
        inside = (step >= low) & (step <= high)
        z = np.where(inside, step, np.sqrt(low * high))
        out[left] = z
        if np.all(found):
            return out.reshape(shape)
        if np.any(found):
            left, z, low, high = left[~found], z[~found], low[~found], high[~found]
            rest = [a[~found] for a in rest]
    raise ComputationError("Newton's method for the elastica did not converge for at least one of the loads.")


def blockwise(work: Callable[..., tuple[FloatArray, ...]], *arrays: FloatArray) -> tuple[FloatArray, ...]:
    """Apply an elementwise function of vectors to arrays of any common shape, block after block."""
    shape = np.broadcast_shapes(*(np.shape(a) for a in arrays))
    flat = [np.broadcast_to(a, shape).ravel() for a in arrays]
    starts = range(0, max(flat[0].size, 1), _BLOCK)
    parts = [work(*(a[k : k + _BLOCK] for a in flat)) for k in starts]
    return tuple(np.concatenate(column).reshape(shape)[()] for column in zip(*parts, strict=True))
