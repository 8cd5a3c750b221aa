"""Positions, rates and accelerations of one smoother, with standard deviations.

A recording is smoothed once: a quintic B-spline on uniform knots with a penalty on its third or fourth derivative.
Samples may be irregular and may miss; the bandwidth is chosen on the data, by the known noise (Mallows' C_p) or,
without it, by generalised cross-validation, and is stored with the result. Value, rate and acceleration always come
from the same curve.

References
----------
P. H. C. Eilers, B. D. Marx, Statistical Science 11 (1996) 89 (penalised B-splines).
G. Wahba, J. R. Statist. Soc. B 45 (1983) 133 (standard deviations of a smoothing spline).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from scipy import sparse
from scipy.interpolate import BSpline
from scipy.linalg import LinAlgError, cho_solve_banded, cholesky_banded
from scipy.optimize import minimize_scalar

from discovery.foundation.arrays import FloatArray
from discovery.foundation.errors import InputError

#: Degree of the spline: its second derivative is still a cubic spline.
_DEGREE = 5
#: Orders of the penalised derivative to choose from.
_ORDERS = (3, 4)


@dataclass(frozen=True)
class Smoother:
    """What was done to the samples, so that it can be repeated."""

    name: str
    criterion: str  # "known noise" or "generalised cross-validation"
    penalty_order: int  # order of the penalised derivative
    segments: int
    smoothing: float  # weight of the penalty relative to the data
    degrees_of_freedom: float
    noise: float  # standard deviation of the samples, in their unit


@dataclass(frozen=True)
class Trajectory:
    """One coordinate with its rate and acceleration, from one smoother."""

    time: FloatArray  # (n,), times of the finite samples [s]
    #: observed, noise (n,): the samples themselves and their standard deviations.
    observed: FloatArray
    noise: FloatArray
    #: q, q_dot, q_ddot (n,): smoothed value, rate and acceleration at ``time``.
    q: FloatArray
    q_dot: FloatArray
    q_ddot: FloatArray
    sd: FloatArray  # (3, n), standard deviations of the three (Bayesian intervals of Wahba 1983)
    smoother: Smoother  # method and bandwidth
    spline: BSpline = field(repr=False, compare=False)

    def evaluate(self, t: FloatArray) -> FloatArray:
        """Return value, rate and acceleration at the times ``t`` [s], shape (3, n)."""
        return np.stack([self.spline(t, nu=order) for order in range(3)])


def smooth(time: FloatArray, values: FloatArray, noise: float | FloatArray | None = None) -> Trajectory:
    """Smooth samples of one coordinate.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Strictly increasing times [s], irregular if need be.
    values : ndarray, shape (n,)
        Samples; NaN marks a gap.
    noise : float or ndarray, shape (n,), optional
        Standard deviation of the samples. Without it the bandwidth is chosen by generalised cross-validation.

    Returns
    -------
    Trajectory
        The curve of lowest score over orders of penalty, knot spacings and smoothing weights.

    Raises
    ------
    InputError
        If fewer than 20 samples are finite, times do not increase, or the noise is not positive.
    """
    finite = np.isfinite(values)
    t, y = np.asarray(time, float)[finite], np.asarray(values, float)[finite]
    if t.size < 20:
        raise InputError(f"{t.size} finite samples are too few to smooth; at least 20 are needed.")
    if np.any(np.diff(t) <= 0.0):
        raise InputError("Times must increase strictly; sort the samples and drop repeated ones before smoothing.")
    sigma = np.broadcast_to(np.asarray(1.0 if noise is None else noise, float), np.shape(values))[finite]
    if not np.all(sigma > 0.0):
        raise InputError("The standard deviation of the samples must be positive.")
    weight = 1.0 / sigma**2
    offset = np.average(y, weights=weight)  # keeps the sums of squares free of cancellation
    fit, order, system, segments = _best_spline(t, y - offset, weight, noise is not None)
    scale = 1.0 if noise is not None else float(np.sqrt(fit.misfit / max(t.size - fit.degrees_of_freedom, 1.0)))
    spline = BSpline(system.knots, fit.coefficients + offset, _DEGREE)
    sd = scale * _deviations(t, fit, system)
    smoother = Smoother(
        name="penalised quintic spline",
        criterion="generalised cross-validation" if noise is None else "known noise",
        penalty_order=order,
        segments=segments,
        smoothing=fit.smoothing,
        degrees_of_freedom=fit.degrees_of_freedom,
        noise=float(np.sqrt(np.mean(sigma**2))) * scale,
    )
    q, q_dot, q_ddot = (spline(t, nu=nu) for nu in range(3))
    return Trajectory(
        t, y, noise=sigma * scale, q=q, q_dot=q_dot, q_ddot=q_ddot, sd=sd, smoother=smoother, spline=spline
    )


def _best_spline(
    t: FloatArray, y: FloatArray, weight: FloatArray, known_noise: bool
) -> tuple[_SplineFit, int, _PenalisedSpline, int]:
    """Return the fit of lowest score with its order of penalty, its system and its number of segments."""
    best: tuple[_SplineFit, int, _PenalisedSpline, int] | None = None
    segments = max(t.size // 16, 8)
    while segments <= max(t.size // 2, 8):
        knots = _uniform_knots(t, segments)
        basis = _basis_matrix(t, knots, 0)
        weighted = sparse.csr_array(basis.multiply(weight[:, None]))
        gram = _upper_band(sparse.csr_array(weighted.T @ basis))
        moment, energy = weighted.T @ y, float(weight @ y**2)
        before = np.inf if best is None else best[0].score
        for order in _ORDERS:
            rough = _difference_matrix(segments + _DEGREE, order)
            penalty = _upper_band(sparse.csr_array(rough.T @ rough))
            penalty *= gram[-1].sum() / penalty[-1].sum()
            system = _PenalisedSpline(
                knots, gram, penalty=penalty, moment=moment, energy=energy, samples=t.size, known_noise=known_noise
            )
            fit = system.best()
            # Of equal scores the finer knots: the penalty, not the knots, shall set the bandwidth.
            if best is None or fit.score < best[0].score + (2.0 if segments > best[3] else 0.0):
                best = fit, order, system, segments
        if best is None or before - best[0].score < 2.0:  # finer knots no longer pay for one degree of freedom
            break
        segments *= 2
    if best is None:
        raise InputError("The normal equations of the smoother are singular; look for gaps longer than the signal.")
    return best


def _deviations(t: FloatArray, fit: _SplineFit, system: _PenalisedSpline) -> FloatArray:
    """Return the deviations of value, rate and acceleration under noise of the weights, shape (3, n)."""
    covariance = _inverse_band(fit.factor)
    sd = np.empty((3, t.size))
    for nu in range(3):
        rows = _basis_matrix(t, system.knots, nu)
        variance = np.asarray((rows @ covariance).multiply(rows).sum(axis=1)).ravel()
        sd[nu] = np.sqrt(np.maximum(variance, 0.0))
    return sd


class _SplineFit(NamedTuple):
    """Solution for one smoothing weight: its score, coefficients (K,) and the factor (6, K) of the normal equations."""

    score: float
    smoothing: float
    coefficients: FloatArray
    factor: FloatArray
    degrees_of_freedom: float
    misfit: float


@dataclass(frozen=True)
class _PenalisedSpline:
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

    def solve(self, log_smoothing: float) -> _SplineFit | None:
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
        return _SplineFit(float(score), smoothing, coefficients, factor, dof, misfit)

    def best(self) -> _SplineFit:
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


def _upper_band(matrix: sparse.csr_array) -> FloatArray:
    """Return a symmetric banded matrix (K, K) in upper banded storage, shape (6, K)."""
    band = np.zeros((_DEGREE + 1, matrix.shape[0]))
    for k in range(_DEGREE + 1):
        band[_DEGREE - k, k:] = matrix.diagonal(k)
    return band


def _difference_matrix(size: int, order: int) -> sparse.csr_array:
    """Matrix (size - order, size) of the ``order``-th differences."""
    matrix = sparse.eye_array(size, format="csr")
    for _ in range(order):
        matrix = matrix[1:] - matrix[:-1]
    return sparse.csr_array(matrix)


def _inverse_band(factor: FloatArray) -> sparse.csr_array:
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


def _uniform_knots(time: FloatArray, segments: int) -> FloatArray:
    """Return knots that divide the record into equal segments and reach beyond it on both sides."""
    step = (time[-1] - time[0]) / segments
    knots = time[0] + step * np.arange(-_DEGREE, segments + _DEGREE + 1)
    knots[segments + _DEGREE] = time[-1]  # exact, so that the last sample is inside
    return knots


def _basis_matrix(time: FloatArray, knots: FloatArray, order: int) -> sparse.csr_array:
    """Matrix (n, K) of the ``order``-th derivatives of the quintic B-splines on uniform knots."""
    step, size = knots[1] - knots[0], knots.size - _DEGREE - 1
    inner = knots[order : knots.size - order]
    basis = sparse.csr_array(BSpline.design_matrix(time, inner, _DEGREE - order))
    return basis @ _difference_matrix(size, order) / step**order if order else basis
