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

import numpy as np
from scipy import sparse
from scipy.interpolate import BSpline

from discovery.foundation.arrays import FloatArray
from discovery.foundation.errors import InputError
from discovery.signals.penalised_spline import (
    DEGREE,
    PenalisedSpline,
    SplineFit,
    basis_matrix,
    difference_matrix,
    inverse_band,
    uniform_knots,
    upper_band,
)

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
    spline = BSpline(system.knots, fit.coefficients + offset, DEGREE)
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
) -> tuple[SplineFit, int, PenalisedSpline, int]:
    """Return the fit of lowest score with its order of penalty, its system and its number of segments."""
    best: tuple[SplineFit, int, PenalisedSpline, int] | None = None
    segments = max(t.size // 16, 8)
    while segments <= max(t.size // 2, 8):
        knots = uniform_knots(t, segments)
        basis = basis_matrix(t, knots, 0)
        weighted = sparse.csr_array(basis.multiply(weight[:, None]))
        gram = upper_band(sparse.csr_array(weighted.T @ basis))
        moment, energy = weighted.T @ y, float(weight @ y**2)
        before = np.inf if best is None else best[0].score
        for order in _ORDERS:
            rough = difference_matrix(segments + DEGREE, order)
            penalty = upper_band(sparse.csr_array(rough.T @ rough))
            penalty *= gram[-1].sum() / penalty[-1].sum()
            system = PenalisedSpline(
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


def _deviations(t: FloatArray, fit: SplineFit, system: PenalisedSpline) -> FloatArray:
    """Return the deviations of value, rate and acceleration under noise of the weights, shape (3, n)."""
    covariance = inverse_band(fit.factor)
    sd = np.empty((3, t.size))
    for nu in range(3):
        rows = basis_matrix(t, system.knots, nu)
        variance = np.asarray((rows @ covariance).multiply(rows).sum(axis=1)).ravel()
        sd[nu] = np.sqrt(np.maximum(variance, 0.0))
    return sd
