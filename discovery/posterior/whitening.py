"""Where a posterior is, and how wide: the start of its sampling, under any noise.

Physical parameters have the covariance of generalised least squares, from the Jacobian as the noise model weighs it,
with the widths of the priors: it is finite also where a parameter lies on a bound.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from discovery.declarations.parameters import Prior
from discovery.estimation.batch import fit_problems
from discovery.foundation.arrays import FloatArray
from discovery.posterior.noise import Noise
from discovery.posterior.robust_start import joint_mode, noise_density

if TYPE_CHECKING:
    from discovery.estimation.fit import Fit

LogDensity = Callable[[FloatArray], FloatArray]

# Steps of differences along a noise parameter, on its scale without bounds, and along whitened coordinates.
_STEP, _WHITE_STEP = 0.05, 0.3
_STRETCHES = np.array([1.5, 1.0, 0.6, 0.3, 0.1, 0.03])
_ROUNDS, _SETTLED = 8, 0.1


def information_covariance(jacobian: FloatArray, widths: FloatArray) -> FloatArray:
    """Return the inverse of the information of a whitened Jacobian (n, p) and of priors of some widths (p,)."""
    # In units of the priors' widths first: the sizes of the parameters differ by many orders.
    normal = (jacobian * widths).T @ (jacobian * widths) + np.eye(widths.size)
    size = np.sqrt(np.diag(normal))
    return np.linalg.inv(normal / np.outer(size, size)) * np.outer(widths / size, widths / size)


def cholesky(covariance: FloatArray) -> FloatArray:
    """Return the lower Cholesky factor of a covariance (d, d) whose sizes differ by many orders."""
    spread = np.sqrt(np.diag(covariance))
    return spread[:, None] * np.linalg.cholesky(covariance / np.outer(spread, spread))


def refined_start(
    fit: Fit, models: Sequence[Noise], widths: FloatArray, size_prior: Prior
) -> tuple[FloatArray, FloatArray]:
    """Return centre (d,) and covariance (d, d) of the sampled vector from the residual and the Jacobian of a fit.

    The fit's minimum is that of ordinary least squares; `models` is the noise of every instrument, `widths` (p,) are
    those of the priors of the free numbers, and `size_prior` is that of the logarithm of the size of a noise. The
    vector has the free numbers, the log size of every noise, then the other parameters of every noise; noise and free
    numbers are uncorrelated.
    """
    mode = joint_mode(fit, models, size_prior)
    x = mode.x
    # The Jacobian there, of the plain residuals.
    (plain,) = fit_problems([fit.problem], [x], iterations=0)
    jacobians = [plain.jacobian[rows].reshape(*seen.shape, -1) for rows, seen in fit.problem.bench.blocks()]
    found, whitened = [], []
    for model, noise in zip(models, mode.noises, strict=True):
        found.append((noise, _noise_covariance(model, mode.residuals, x, noise, size_prior)))
        for i in model.part.experiments:
            whitened.append(model.whitened(i, jacobians[i], x, noise).reshape(-1, x.size))
    centre = [x, *(noise[:1] for noise, _ in found), *(noise[1:] for noise, _ in found)]
    p, d = x.size, sum(part.size for part in centre)
    covariance = np.zeros((d, d))
    covariance[:p, :p] = information_covariance(np.concatenate(whitened), widths)
    extra = p + len(models)
    for k, (noise, spread) in enumerate(found):
        where = [p + k, *range(extra, extra + noise.size - 1)]
        covariance[np.ix_(where, where)] = spread
        extra += noise.size - 1
    return np.concatenate(centre), covariance


def _noise_covariance(
    model: Noise, residuals: Sequence[FloatArray], x: FloatArray, best: FloatArray, size_prior: Prior
) -> FloatArray:
    """Return the covariance of the most probable noise of fixed residuals."""
    priors = [size_prior, *(p.prior for p in model.parameters)]
    density = noise_density(model, residuals, x, size_prior)
    m = best.size
    steps = _STEP * np.eye(m)
    pairs = [(i, j) for i in range(m) for j in range(i + 1)]
    corners = [best + a * steps[i] + b * steps[j] for i, j in pairs for a, b in ((1, 1), (1, -1), (-1, 1), (-1, -1))]
    values = density(np.array(corners).T).reshape(-1, 4) @ [1.0, -1.0, -1.0, 1.0] / (4 * _STEP**2)
    hessian = np.empty((m, m))
    for (i, j), value in zip(pairs, values, strict=True):
        hessian[i, j] = hessian[j, i] = -value
    # No wider than the prior, and never of the wrong sign.
    least = np.array([prior.width**-2 for prior in priors])
    curvature, axes = np.linalg.eigh(hessian / np.sqrt(np.outer(least, least)))
    inverse = (axes / np.maximum(curvature, 1.0)) @ axes.T
    return np.asarray(inverse / np.sqrt(np.outer(least, least)))


def settled(
    density: Callable[[FloatArray, FloatArray], LogDensity], centre: FloatArray, factor: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the mode of a posterior by scoring steps in whitened coordinates, and the factor scaled to its curvature.

    `density` gives the log density at whitened points (k, d) for a centre (d,) and a lower triangular factor (d, d).
    """
    d = centre.size
    points = np.concatenate([np.zeros((1, d)), _WHITE_STEP * np.eye(d), -_WHITE_STEP * np.eye(d)])
    for _ in range(_ROUNDS):
        log_density = density(centre, factor)
        here, up, down = np.split(log_density(points), [1, d + 1])
        # Where a step along an axis leaves the support, nothing is known of it.
        inside = np.isfinite(here) & np.isfinite(up) & np.isfinite(down)
        up, down = up[inside], down[inside]
        slope, bend = np.zeros(d), np.ones(d)
        slope[inside] = (up - down) / (2 * _WHITE_STEP)
        bend[inside] = (2 * here - up - down) / _WHITE_STEP**2
        bend = np.clip(bend, 0.1, 10.0)
        step = slope / bend
        trials = _STRETCHES[:, None] * step
        values = log_density(trials)
        best = int(np.argmax(values))
        if np.abs(step).max() < _SETTLED or not values[best] > here[0]:
            break
        centre = centre + factor @ trials[best]
    return centre, factor / np.sqrt(bend)
