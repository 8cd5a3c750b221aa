r"""The elastica seen from its tip: one potential for force, radius and energy, smooth through the straight beam.

For a deflection :math:`\delta` and a radial force :math:`F_r` on the tip (unit length, unit EI, tension positive) let

.. math:: W(\delta, F_r) = \min_\theta \tfrac12 \int_0^1 \theta'^2 ds - F_r \rho, \quad \text{tip at the angle } \delta.

Its derivatives are the map (6) of the paper, solved for what stays regular: :math:`\rho = -\partial W / \partial F_r`,
and the moment of the tip force about the hub, :math:`\rho F_t = \partial W / \partial \delta`. The other way round,
:math:`F_r(\rho, \delta)`, breaks down at the straight beam, where every radial force belongs to the one radius 1. In
:math:`W = -F_r + \delta^2 w(\delta^2, F_r)` the function :math:`w` is analytic, there and across the load of buckling:
a polynomial of degree 13 and 29 represents it, and a model made of it conserves energy exactly.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt
from numpy.polynomial import chebyshev, legendre

from discovery.foundation.errors import ComputationError

FloatArray = npt.NDArray[np.float64]

DEFLECTION_LIMIT = 1.4
"""Largest deflection of the tip that is covered [rad]."""
RADIAL_LIMITS = (-8.0, 24.0)
"""Radial forces that are covered, ``F_r l^2 / EI`` [-]; the straight beam cannot bear -20.19 (clamped and pinned)."""

_DEGREES = (13, 29)  # in delta^2 and F_r
_MODES, _NODES = 14, 24
_ITERATIONS = 20


@dataclass(frozen=True)
class TipPotential:
    """The function ``w`` of the module as a polynomial.

    Parameters
    ----------
    coefficients : ndarray, shape (8, 14, 30)
        Of the powers of ``s = delta^2`` and ``F_r``, each scaled to [-1, 1]: ``w`` and its derivatives ``w_s, w_ss,
        w_F, w_FF, w_sF, w_ssF, w_sFF``.
    """

    coefficients: FloatArray

    def tip(self, delta: FloatArray, radial: FloatArray) -> FloatArray:
        """Radius and moment of the tip force, with derivatives.

        Parameters
        ----------
        delta, radial : ndarray, shape (n,)
            Deflection [rad] and radial force [EI / l^2].

        Returns
        -------
        ndarray, shape (7, n)
            ``rho`` and its derivatives by delta and by F_r, the moment ``rho F_t`` and its derivative by delta (that
            by F_r is minus the first of rho's), and of the first derivative of rho those by delta and by F_r. Units of
            l and EI.
        """
        s = delta * delta
        w, w_s, w_ss, w_f, w_ff, w_sf, w_ssf, w_sff = self._expand(s, radial)
        return np.stack(
            [
                1.0 - s * w_f,
                -2.0 * delta * (w_f + s * w_sf),
                -s * w_ff,
                2.0 * delta * (w + s * w_s),
                2.0 * w + s * (10.0 * w_s + 4.0 * s * w_ss),
                -2.0 * w_f - s * (10.0 * w_sf + 4.0 * s * w_ssf),
                -2.0 * delta * (w_ff + s * w_sff),
            ]
        )

    def energy(self, delta: FloatArray, radial: FloatArray) -> FloatArray:
        """Bending energy ``W + F_r rho`` [EI / l] at deflections [rad] and radial forces [EI / l^2], shape (n,)."""
        s = delta * delta
        w, _, _, w_f, *_ = self._expand(s, radial)
        return s * (w - radial * w_f)

    def _expand(self, s: FloatArray, radial: FloatArray) -> FloatArray:
        low, high = RADIAL_LIMITS
        x = 2.0 * s / DEFLECTION_LIMIT**2 - 1.0
        f = (2.0 * radial - low - high) / (high - low)
        first = x[:, None] ** np.arange(_DEGREES[0] + 1)
        second = f[:, None] ** np.arange(_DEGREES[1] + 1)
        result: FloatArray = ((first @ self.coefficients) * second).sum(-1)
        return result


@lru_cache(maxsize=1)
def tip_potential() -> TipPotential:
    """Return the potential behind the map (6) on the whole domain, solved once at Chebyshev points (some 50 ms).

    Raises
    ------
    ComputationError
        If Newton's method does not find the shapes.
    """
    low, high = RADIAL_LIMITS
    first, second = (chebyshev.chebpts1(n + 1) for n in _DEGREES)
    delta = DEFLECTION_LIMIT * np.sqrt((1.0 + first) / 2.0)
    radial = (low + high + (high - low) * second) / 2.0
    grid = np.meshgrid(delta, radial, indexing="ij")
    w = _reduced_potential(grid[0].ravel(), grid[1].ravel()).reshape(grid[0].shape)
    left, right = (np.linalg.inv(chebyshev.chebvander(x, x.size - 1)) for x in (first, second))
    # Powers are well conditioned here: the nearest singularity lies outside the unit circle of the scaled variables.
    series = _powers(first.size) @ left @ w @ right.T @ _powers(second.size).T
    by_s = np.diag(np.arange(1.0, first.size), 1) * 2.0 / DEFLECTION_LIMIT**2
    by_f = np.diag(np.arange(1.0, second.size), 1).T * 2.0 / (high - low)
    slope, load_slope = by_s @ series, series @ by_f
    return TipPotential(
        np.stack(
            [
                series,
                slope,
                by_s @ slope,
                load_slope,
                load_slope @ by_f,
                slope @ by_f,
                by_s @ slope @ by_f,
                slope @ by_f @ by_f,
            ]
        )
    )


def _powers(count: int) -> FloatArray:
    """Matrix (count, count) from Chebyshev coefficients to those of powers."""
    return np.stack(
        [np.pad(chebyshev.cheb2poly(row[: k + 1]), (0, count - 1 - k)) for k, row in enumerate(np.eye(count))], 1
    )


def _reduced_potential(delta: FloatArray, radial: FloatArray) -> FloatArray:
    """Minimise the energy over curvatures that are polynomials; shapes (n,) in and out."""
    x, weights = legendre.leggauss(_NODES)
    s, weights = (x + 1.0) / 2.0, weights / 2.0
    legendres = legendre.legvander(x, _MODES).T
    order = np.arange(1, _MODES)
    # Angles: integrals from the clamp of the Legendre polynomials of the curvature.
    shapes = np.vstack([s, (legendres[2:] - legendres[:-2]) / (4.0 * order + 2.0)[:, None]])
    stiffness = 1.0 / (2.0 * np.arange(_MODES) + 1.0)
    products = shapes[:, None] * shapes * weights
    # Small deflection under a perpendicular force: curvature 3 delta (1 - s), force 3 delta.
    q = np.zeros((delta.size, _MODES))
    q[:, 0], q[:, 1] = 1.5 * delta, -1.5 * delta
    k = np.full((delta.size, 1), 3.0)
    scale = delta[:, None]
    for _ in range(_ITERATIONS):
        bend = q @ shapes - scale
        along, across = np.cos(bend), np.sin(bend)
        j_rho, j_cross = -(across * weights) @ shapes.T, (along * weights) @ shapes.T
        tangential = k * scale
        residual = q * stiffness - radial[:, None] * j_rho - tangential * j_cross
        hessian = np.zeros((delta.size, _MODES + 1, _MODES + 1))
        pull = radial[:, None] * along + tangential * across
        hessian[:, :-1, :-1] = np.diag(stiffness) + np.einsum("nm,klm->nkl", pull, products)
        hessian[:, :-1, -1] = -j_cross * scale
        hessian[:, -1, :-1] = j_cross / scale
        error = np.concatenate([residual, across @ weights[:, None] / scale], 1)
        move = np.linalg.solve(hessian, error[..., None])[..., 0]
        q, k = q - move[:, :-1], k - move[:, -1:]
        if np.max(np.abs(move) / scale) < 1e-11:
            shortening = 2.0 * np.sin((q @ shapes - scale) / 2.0) ** 2 @ weights
            result: FloatArray = (0.5 * q**2 @ stiffness + radial * shortening) / delta**2
            return result
    raise ComputationError("The shapes of the elastica behind its tip potential were not found.")
