r"""Integrals of the elastica under a tip force.

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
from scipy.special import elliprd

from discovery.foundation.arrays import FloatArray
from discovery.foundation.errors import ComputationError

_Equation = Callable[..., tuple[FloatArray, FloatArray]]

_ITERATIONS = 80
_EPS = 4 * np.finfo(np.float64).eps
# Relative step after which Newton's method (error squared) is done.
_NEWTON = 1e-8
# Stands for an absent force: every quotient keeps its limit, and the result is that of the straight beam.
TINY = 1e-100


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
