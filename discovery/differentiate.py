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
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.interpolate import BSpline
from scipy.linalg import LinAlgError, cho_solve_banded, cholesky_banded
from scipy.optimize import minimize_scalar

from discovery.errors import InputError

if TYPE_CHECKING:
    from discovery.recording import Recording
    from discovery.rig import Rig

FloatArray = NDArray[np.float64]

DEGREE = 5
"""Degree of the spline: its second derivative is still a cubic spline."""


class Evaluable(Protocol):
    """Anything that gives value, first and second derivative at any time, such as `discovery.drive.Drive`."""

    def evaluate(self, t: FloatArray) -> FloatArray:
        """Return an array (3, n) of value, first and second derivative at the times ``t`` [s]."""
        ...


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
    """One coordinate with its rate and acceleration, from one smoother.

    Attributes
    ----------
    time : ndarray, shape (n,)
        Times of the finite samples [s].
    observed, noise : ndarray, shape (n,)
        The samples themselves and their standard deviations.
    q, q_dot, q_ddot : ndarray, shape (n,)
        Smoothed value, rate and acceleration at ``time``.
    sd : ndarray, shape (3, n)
        Standard deviations of the three (Bayesian intervals of Wahba 1983).
    smoother : Smoother
        Method and bandwidth.
    """

    time: FloatArray
    observed: FloatArray
    noise: FloatArray
    q: FloatArray
    q_dot: FloatArray
    q_ddot: FloatArray
    sd: FloatArray
    smoother: Smoother
    spline: BSpline = field(repr=False, compare=False)

    def evaluate(self, t: FloatArray) -> FloatArray:
        """Return value, rate and acceleration at the times ``t`` [s], shape (3, n)."""
        return np.stack([self.spline(t, nu=order) for order in range(3)])


class _Fit(NamedTuple):
    score: float
    smoothing: float
    coefficients: FloatArray
    factor: FloatArray
    degrees_of_freedom: float
    misfit: float


@dataclass(frozen=True)
class _PenalisedSpline:
    """Banded normal equations of one knot sequence and one order of penalty."""

    knots: FloatArray
    gram: FloatArray
    penalty: FloatArray
    moment: FloatArray
    energy: float
    samples: int
    known_noise: bool

    def solve(self, log_smoothing: float) -> _Fit | None:
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
        return _Fit(float(score), smoothing, coefficients, factor, dof, misfit)

    def best(self) -> _Fit:
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


def _band(matrix: sparse.csr_array) -> FloatArray:
    band = np.zeros((DEGREE + 1, matrix.shape[0]))
    for k in range(DEGREE + 1):
        band[DEGREE - k, k:] = matrix.diagonal(k)
    return band


def _difference(size: int, order: int) -> sparse.csr_array:
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


def _knots(time: FloatArray, segments: int) -> FloatArray:
    step = (time[-1] - time[0]) / segments
    knots = time[0] + step * np.arange(-DEGREE, segments + DEGREE + 1)
    knots[segments + DEGREE] = time[-1]  # exact, so that the last sample is inside
    return knots


def _basis(time: FloatArray, knots: FloatArray, order: int) -> sparse.csr_array:
    """Matrix (n, K) of the ``order``-th derivatives of the quintic B-splines on uniform knots."""
    step, size = knots[1] - knots[0], knots.size - DEGREE - 1
    inner = knots[order : knots.size - order]
    basis = sparse.csr_array(BSpline.design_matrix(time, inner, DEGREE - order))
    return basis @ _difference(size, order) / step**order if order else basis


def smooth(
    time: FloatArray, values: FloatArray, noise: float | FloatArray | None = None, *, orders: tuple[int, ...] = (3, 4)
) -> Trajectory:
    """Smooth samples of one coordinate.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Strictly increasing times [s], irregular if need be.
    values : ndarray, shape (n,)
        Samples; NaN marks a gap.
    noise : float or ndarray, shape (n,), optional
        Standard deviation of the samples. Without it the bandwidth is chosen by generalised cross-validation.
    orders : tuple of int
        Orders of the penalised derivative to choose from (at most 5).

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
    best: tuple[_Fit, int, _PenalisedSpline, int] | None = None
    segments = max(t.size // 16, 8)
    while segments <= max(t.size // 2, 8):
        knots = _knots(t, segments)
        basis = _basis(t, knots, 0)
        weighted = sparse.csr_array(basis.multiply(weight[:, None]))
        gram = _band(sparse.csr_array(weighted.T @ basis))
        moment, energy = weighted.T @ (y - offset), float(weight @ (y - offset) ** 2)
        before = np.inf if best is None else best[0].score
        for order in orders:
            rough = _difference(segments + DEGREE, order)
            penalty = _band(sparse.csr_array(rough.T @ rough))
            penalty *= gram[-1].sum() / penalty[-1].sum()
            system = _PenalisedSpline(knots, gram, penalty, moment, energy, t.size, noise is not None)
            fit = system.best()
            # Of equal scores the finer knots: the penalty, not the knots, shall set the bandwidth.
            if best is None or fit.score < best[0].score + (2.0 if segments > best[3] else 0.0):
                best = fit, order, system, segments
        if best is None or before - best[0].score < 2.0:  # finer knots no longer pay for one degree of freedom
            break
        segments *= 2
    if best is None:
        raise InputError("The normal equations of the smoother are singular; look for gaps longer than the signal.")
    fit, order, system, segments = best
    scale = 1.0 if noise is not None else float(np.sqrt(fit.misfit / max(t.size - fit.degrees_of_freedom, 1.0)))
    covariance = _inverse_band(fit.factor)
    spline = BSpline(system.knots, fit.coefficients + offset, DEGREE)
    sd = np.empty((3, t.size))
    for nu in range(3):
        rows = _basis(t, system.knots, nu)
        variance = np.asarray((rows @ covariance).multiply(rows).sum(axis=1)).ravel()
        sd[nu] = scale * np.sqrt(np.maximum(variance, 0.0))
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
    return Trajectory(t, y, sigma * scale, q, q_dot, q_ddot, sd, smoother, spline)


class State(NamedTuple):
    """Kinematic state at some times, each of shape (n,): SI units, radians."""

    q: FloatArray  # theta_t of an arm, the output of an oscillator
    q_dot: FloatArray
    q_ddot: FloatArray
    delta: FloatArray  # theta_t - theta_m of an arm, q itself of an oscillator
    delta_dot: FloatArray
    input: FloatArray | None  # input of an oscillator; None for an arm or a free decay


@dataclass(frozen=True)
class Motion:
    """A recording as motion: the coordinate, what drives it, and for an arm the radius over its length.

    Attributes
    ----------
    name : str
        Name of the recording.
    kind : str
        "flexible_arm" or "oscillator".
    coordinate : Trajectory
        theta_t [rad] of an arm, the output of an oscillator.
    drive : Evaluable or None
        theta_m [rad] of an arm, the input of an oscillator.
    radius : Trajectory or None
        rho_t / l of an arm whose tip was recorded in x and y.
    """

    name: str
    kind: str
    coordinate: Trajectory
    drive: Evaluable | None
    radius: Trajectory | None = None

    def state(self, t: FloatArray) -> State:
        """Return the state at the times ``t`` [s]."""
        q, q_dot, q_ddot = self.coordinate.evaluate(t)
        driven = None if self.drive is None else self.drive.evaluate(t)
        if self.kind != "flexible_arm":
            return State(q, q_dot, q_ddot, q, q_dot, None if driven is None else driven[0])
        base, base_rate = (np.zeros_like(q), np.zeros_like(q)) if driven is None else (driven[0], driven[1])
        return State(q, q_dot, q_ddot, q - base, q_dot - base_rate, None)


def _angle_of_deflection(deflection: FloatArray) -> FloatArray:
    """Invert y'/l = cos(delta / sqrt 5) sin(delta), the elastica's radius law for small angles (equation 16)."""
    delta = np.linspace(-1.3, 1.3, 2001)  # monotone here
    return np.interp(deflection, np.cos(delta / np.sqrt(5.0)) * np.sin(delta), delta, left=np.nan, right=np.nan)


def motion_of(recording: Recording, rig: Rig, drive: Evaluable | None) -> Motion:
    """Smooth a recording.

    Parameters
    ----------
    recording : Recording
        Samples; gaps are NaN.
    rig : Rig
        Kind and, for an arm, the length [m].
    drive : Evaluable or None
        The smooth input, as `discovery.drive.build_drive` makes it.

    Returns
    -------
    Motion
        theta_t = atan2(y, x), unwrapped, and rho_t / l for an arm; the output itself for an oscillator.

    Raises
    ------
    InputError
        If an arm has no length, or its tip deflection comes without a motor angle.
    """
    time, output, noise = recording.time, recording.output, recording.noise
    if rig.kind != "flexible_arm":
        return Motion(recording.name, rig.kind, smooth(time, output[:, 0], noise[0]), drive)
    if rig.length is None:
        raise InputError(f"{recording.name}: the rig file gives no length; add `length_m`.")
    length, radius = rig.length.value, None
    if recording.channels == ("tip_x", "tip_y"):
        seen = np.isfinite(output).all(axis=1)
        x, y = output[seen].T
        rho, sd = np.hypot(x, y), float(np.sqrt(np.mean(noise**2)))
        angle = smooth(time[seen], np.unwrap(np.arctan2(y, x)), sd / rho)
        radius = smooth(time[seen], rho / length, sd / length)
    elif recording.channels == ("tip_angle",):
        angle = smooth(time, output[:, 0], noise[0])
    elif drive is None:
        raise InputError(f"{recording.name}: a tip deflection needs the motor angle; add a column `motor_angle_rad`.")
    else:
        delta = _angle_of_deflection(output[:, 0] / length)
        angle = smooth(time, delta + drive.evaluate(time)[0], noise[0] / length)
    return Motion(recording.name, rig.kind, angle, drive, radius)
