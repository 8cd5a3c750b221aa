"""A quintic B-spline on uniform knots with a penalty on its differences, in banded normal equations.

References
----------
P. H. C. Eilers, B. D. Marx, Statistical Science 11 (1996) 89 (penalised B-splines).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy import sparse
from scipy.interpolate import BSpline
from scipy.linalg import LinAlgError, cho_solve_banded, cholesky_banded
from scipy.optimize import minimize_scalar

from discovery.foundation.arrays import FloatArray

DEGREE = 5
"""Degree of the spline: its second derivative is still a cubic spline."""


class SplineFit(NamedTuple):
    """Solution for one smoothing weight: its score, coefficients (K,) and the factor (6, K) of the normal equations."""

    score: float
    smoothing: float
    coefficients: FloatArray
    factor: FloatArray
    degrees_of_freedom: float
    misfit: float


@dataclass(frozen=True)
class PenalisedSpline:
    """Banded normal equations of one knot sequence and one order of penalty."""

    knots: FloatArray  # (K + 6,), uniform knots
    #: gram, penalty (6, K): weighted Gram matrix of the basis and Gram matrix of the differences, in upper banded
    #: storage.
    gram: FloatArray
    penalty: FloatArray
    moment: FloatArray  # (K,), weighted moments of the samples
    energy: float  # weighted sum of the squared samples
    samples: int  # number of samples
    #: Score by Mallows' C_p, with weights of the true noise; by generalised cross-validation otherwise.
    known_noise: bool

    def solve(self, log_smoothing: float) -> SplineFit | None:
        """Return the spline of one smoothing weight, given as a power of ten; None if the equations are singular."""
        smoothing = 10.0**log_smoothing
        try:
            factor = cholesky_banded(self.gram + smoothing * self.penalty)
            # tr(A^-1 G) is the derivative of log det(mu G + smoothing P) at mu = 1: banded, without an inverse.
            h = 1e-3
            up, down = (cholesky_banded((1.0 + s * h) * self.gram + smoothing * self.penalty)[-1] for s in (1, -1))
        except LinAlgError:
            return None
        coefficients = cho_solve_banded((factor, False), self.moment)
        dof = float(np.sum(np.log(up / down)) / h)
        misfit = max(self.energy - 2.0 * float(coefficients @ self.moment) + _quadratic(self.gram, coefficients), 0.0)
        free = max(self.samples - dof, 1.0)
        score = misfit + 2.0 * dof if self.known_noise else self.samples * np.log(misfit * self.samples / free**2)
        return SplineFit(float(score), smoothing, coefficients, factor, dof, misfit)

    def best(self) -> SplineFit:
        """Smoothing weight with the lowest score: a coarse scan over decades, then a refinement."""
        fits = {level: fit for level in np.arange(-8.0, 11.0) if (fit := self.solve(level)) is not None}
        start = min(fits, key=lambda level: fits[level].score)

        def score(level: float) -> float:
            fit = self.solve(level)
            return np.inf if fit is None else fit.score

        refined = minimize_scalar(score, bounds=(start - 1.0, start + 1.0), method="bounded", options={"xatol": 0.05})
        fit = self.solve(float(refined.x))
        return fit if fit is not None and fit.score < fits[start].score else fits[start]


def _quadratic(band: FloatArray, x: FloatArray) -> float:
    """Return x' A x of a symmetric matrix in upper banded storage."""
    width = band.shape[0] - 1
    total = band[width] @ (x * x)
    for k in range(1, width + 1):
        total += 2.0 * band[width - k, k:] @ (x[k:] * x[:-k])
    return float(total)


def upper_band(matrix: sparse.csr_array) -> FloatArray:
    """Return a symmetric banded matrix (K, K) in upper banded storage, shape (6, K)."""
    band = np.zeros((DEGREE + 1, matrix.shape[0]))
    for k in range(DEGREE + 1):
        band[DEGREE - k, k:] = matrix.diagonal(k)
    return band


def difference_matrix(size: int, order: int) -> sparse.csr_array:
    """Matrix (size - order, size) of the ``order``-th differences."""
    matrix = sparse.eye_array(size, format="csr")
    for _ in range(order):
        matrix = matrix[1:] - matrix[:-1]
    return sparse.csr_array(matrix)


def inverse_band(factor: FloatArray) -> sparse.csr_array:
    """Central band of the inverse of U'U from its banded factor (Takahashi's recursion)."""
    width, size = factor.shape[0] - 1, factor.shape[1]
    band = np.zeros((width + 1, size))
    block = np.zeros((width, width))  # the inverse on the next `width` indices
    row = np.zeros((size, width))
    for k in range(1, width + 1):
        row[: size - k, k - 1] = factor[width - k, k:]
    for i in range(size - 1, -1, -1):
        r = row[i] / factor[width, i]
        z = -block @ r
        variance = 1.0 / factor[width, i] ** 2 - r @ z
        band[0, i], band[1:, i] = variance, z
        block[1:, 1:] = block[:-1, :-1].copy()
        block[0, 0] = variance
        block[0, 1:] = block[1:, 0] = z[:-1]
    upper = sparse.csr_array((size, size))
    for k in range(1, width + 1):
        upper = upper + sparse.diags_array(band[k, : size - k], offsets=k, shape=(size, size), format="csr")
    return sparse.csr_array(upper + upper.T + sparse.diags_array(band[0], format="csr"))


def uniform_knots(time: FloatArray, segments: int) -> FloatArray:
    """Return knots that divide the record into equal segments and reach beyond it on both sides."""
    step = (time[-1] - time[0]) / segments
    knots = time[0] + step * np.arange(-DEGREE, segments + DEGREE + 1)
    knots[segments + DEGREE] = time[-1]  # exact, so that the last sample is inside
    return knots


def basis_matrix(time: FloatArray, knots: FloatArray, order: int) -> sparse.csr_array:
    """Matrix (n, K) of the ``order``-th derivatives of the quintic B-splines on uniform knots."""
    step, size = knots[1] - knots[0], knots.size - DEGREE - 1
    inner = knots[order : knots.size - order]
    basis = sparse.csr_array(BSpline.design_matrix(time, inner, DEGREE - order))
    return basis @ difference_matrix(size, order) / step**order if order else basis
