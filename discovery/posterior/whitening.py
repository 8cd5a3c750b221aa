"""Where a posterior is, and how wide: the start of its sampling, under any noise.

Free numbers and noise are most probable together where they are sought in turns, from wherever least squares ended:
outliers pull it away, at worst to another frequency. Under a known noise the likelihood of the free numbers is a sum of
squares again, of scaled residuals. Physical parameters have the covariance of generalised least squares, from the
Jacobian as the noise model weighs it, with the widths of the priors: it is finite also where a parameter lies on a
bound.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from discovery.declarations.priors import Prior
from discovery.estimation.batch import fit_problems
from discovery.estimation.bench import Bench
from discovery.estimation.fit import Fit
from discovery.estimation.guess import restoring, scan
from discovery.estimation.least_squares import levenberg_marquardt, minimise
from discovery.estimation.natural_units import natural_units
from discovery.estimation.problem import Problem
from discovery.foundation.arrays import FloatArray
from discovery.posterior.noise import Noise
from discovery.recordings.experiment import Experiment

# Turns end when one gains less, as a logarithm of the density.
_TURNS, _GAIN = 12, 0.02
# A reading strays that lies so many usual distances from the median of so many neighbours.
_USUAL, _NEIGHBOURS, _PASSES = 6.0, 5, 3
# Median of the absolute value of a standard normal number.
_MEDIAN = 0.6745
LogDensity = Callable[[FloatArray], FloatArray]

# Steps of differences along a noise parameter, on its scale without bounds, and along whitened coordinates.
_STEP, _WHITE_STEP = 0.05, 0.3
_STRETCHES = np.array([1.5, 1.0, 0.6, 0.3, 0.1, 0.03])
_ROUNDS, _SETTLED = 8, 0.1


@dataclass(frozen=True)
class Mode:
    """Most probable free numbers x (p,) and noise, the parameters of every instrument's.

    `residuals`, each (n, c, 1), are those of every experiment, in stated noises; `log_density` is log likelihood and
    log prior of the noise.
    """

    x: FloatArray
    noises: tuple[FloatArray, ...]
    residuals: tuple[FloatArray, ...]
    log_density: float


def noise_density(
    model: Noise, residuals: Sequence[FloatArray], x: FloatArray, size_prior: Prior
) -> Callable[[FloatArray], FloatArray]:
    """Return the log density of noise parameters (1 + m, k), given free numbers (p,) and what they leave."""
    priors = [size_prior, *(p.prior for p in model.parameters)]

    def density(noise: FloatArray) -> FloatArray:
        k = noise.shape[1]
        total = sum(prior.log_density(row) for prior, row in zip(priors, noise, strict=True))
        for i in model.part.experiments:
            spread = np.broadcast_to(residuals[i], (*residuals[i].shape[:2], k))
            total = total + model.log_likelihood(i, spread, np.repeat(x[:, None], k, axis=1), noise)
        return np.where(np.isfinite(total), total, -1e300)

    return density


def joint_mode(fit: Fit, models: Sequence[Noise], size_prior: Prior) -> Mode:
    """Return the mode of free numbers and noise; where the noise allows for outliers, however far off a fit is.

    The fit's minimum is that of ordinary least squares, `size_prior` that of the logarithm of the size of a noise. Of
    the priors of the free numbers only what is known from the rig counts.
    """
    starts = [fit.minimum.x]
    if any(model.outliers for model in models):
        starts += _without_outliers(fit.problem)
    modes = [_mode(fit.problem, models, x, size_prior) for x in starts]
    return max(modes, key=lambda mode: mode.log_density)


def _mode(problem: Problem, models: Sequence[Noise], x: FloatArray, size_prior: Prior) -> Mode:
    """Return the mode to which turns lead from one start."""
    last = _with_noise(problem, models, x, size_prior, [None] * len(models))
    for _ in range(_TURNS):
        moved = _most_probable(problem, models, last)
        mode = _with_noise(problem, models, moved, size_prior, last.noises)
        gain = mode.log_density - last.log_density
        last = mode if gain > 0 else last
        if gain < _GAIN:
            break
    return last


def _with_noise(
    problem: Problem, models: Sequence[Noise], x: FloatArray, size_prior: Prior, before: Sequence[FloatArray | None]
) -> Mode:
    """Return free numbers with their most probable noise."""
    residuals = residual_blocks(problem, x[:, None])
    seen = [each for _, each in problem.bench.blocks()]
    noises, total = [], 0.0
    for model, start in zip(models, before, strict=True):
        density = noise_density(model, residuals, x, size_prior)
        if start is None:
            grid = _grid(model, np.concatenate([residuals[i][seen[i]].ravel() for i in model.part.experiments]))
            start = grid[:, int(np.argmax(density(grid)))]
        noise, height = _highest(density, start)
        noises.append(noise)
        total += height
    return Mode(x, tuple(noises), tuple(residuals), total)


def _highest(density: Callable[[FloatArray], FloatArray], start: FloatArray) -> tuple[FloatArray, float]:
    """Return the mode of a log density and its value there."""
    from scipy.optimize import minimize

    def cost(noise: FloatArray) -> float:
        return -float(density(noise[:, None])[0])

    found = minimize(cost, start.ravel(), method="Nelder-Mead", tol=1e-3)
    return found.x, -float(found.fun)


def _grid(model: Noise, errors: FloatArray) -> FloatArray:
    """Return noises (1 + m, k) among which to start: as large as the errors are, with outliers and without."""
    squares = np.array([np.mean(errors**2), (np.median(np.abs(errors)) / _MEDIAN) ** 2])
    whole, usual = 0.5 * np.log(np.maximum(squares, np.finfo(float).tiny))
    return np.array(list(product((whole, whole - 1.0, usual), *(p.starts for p in model.parameters)))).T


def _most_probable(problem: Problem, models: Sequence[Noise], at: Mode) -> FloatArray:
    """Return the most probable free numbers (p,) under the noise of a mode."""

    def scaled(x: FloatArray) -> FloatArray:
        with np.errstate(all="ignore"):
            blocks = residual_blocks(problem, x)
            rows = [
                model.scaled(i, blocks[i], at.x, noise).reshape(-1, x.shape[1])
                for model, noise in zip(models, at.noises, strict=True)
                for i in model.part.experiments
            ]
        return np.concatenate([*rows, problem.prior_residuals(x)])

    request = levenberg_marquardt(at.x, *problem.bounds, problem.scale)
    (minimum,) = minimise([request], lambda wanted: [scaled(x) for _, x in wanted])
    return minimum.x


def residual_blocks(problem: Problem, x: FloatArray) -> list[FloatArray]:
    """Return the residuals (n, c, k) of every experiment for free numbers (p, k)."""
    residuals = problem.bench.residuals(*problem.expand(x))
    return [residuals[rows].reshape(*seen.shape, -1) for rows, seen in problem.bench.blocks()]


def _without_outliers(problem: Problem) -> list[FloatArray]:
    """Return where a fit from the beginning ends whose readings do not stray; nothing where none did."""
    bench, model = problem.bench, problem.model
    tamed = [_tamed(e) for e in bench.experiments]
    if all(new is old for new, old in zip(tamed, bench.experiments, strict=True)):
        return []
    start = {} if restoring(model) is None else scan(model, tamed, natural_units(tamed), {})
    alike = Bench(bench.base, bench.effects, tamed, bench.step, bench.leap)
    other = Problem(model, alike, problem.units, problem.gaussian)
    (minimum,) = fit_problems([other], [other.start(start)])
    return [minimum.x] if np.isfinite(minimum.cost) else []


def _tamed(experiment: Experiment) -> Experiment:
    """Return an experiment with the medians of neighbours for readings that stray; the very same where none does.

    Its noise is the scatter that is left.
    """
    from scipy.ndimage import median_filter

    recording = experiment.recording
    output, scatter = recording.output.copy(), recording.noise.copy()
    for c, (channel, noise) in enumerate(zip(output.T, recording.noise, strict=True)):
        seen = np.isfinite(channel)
        # The neighbours of one that strays may stray as well.
        for _ in range(_PASSES):
            middle = median_filter(channel[seen], _NEIGHBOURS)
            off = np.abs(channel[seen] - middle)
            usual = max(float(np.median(off)) / _MEDIAN, float(noise))
            channel[seen] = np.where(off > _USUAL * usual, middle, channel[seen])
        # Fourth differences hold hardly any motion; 70 is the sum of the squares of their coefficients.
        scatter[c] = max(float(noise), float(np.sqrt(np.mean(np.diff(channel[seen], 4) ** 2) / 70)))
    if np.array_equal(output, recording.output, equal_nan=True):
        return experiment
    return replace(experiment, recording=replace(recording, output=output, noise=scatter))


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
