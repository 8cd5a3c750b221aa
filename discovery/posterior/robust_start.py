"""Where free numbers and noise are most probable together, from wherever least squares ended.

Outliers pull least squares away, at worst to another frequency. Under a known noise the likelihood of the free numbers
is a sum of squares again, of scaled residuals; free numbers and noise are sought in turns.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from discovery.declarations.parameters import Prior
from discovery.estimation.batch import fit_problems
from discovery.estimation.bench import Bench
from discovery.estimation.guess import restoring, scan
from discovery.estimation.least_squares import levenberg_marquardt, minimise
from discovery.estimation.natural_units import natural_units
from discovery.estimation.problem import Problem
from discovery.foundation.arrays import FloatArray
from discovery.posterior.noise import Noise

if TYPE_CHECKING:
    from discovery.estimation.fit import Fit
    from discovery.recordings.experiment import Experiment

# Turns end when one gains less, as a logarithm of the density.
_TURNS, _GAIN = 12, 0.02
# A reading strays that lies so many usual distances from the median of so many neighbours.
_USUAL, _NEIGHBOURS, _PASSES = 6.0, 5, 3
# Median of the absolute value of a standard normal number.
_MEDIAN = 0.6745


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
