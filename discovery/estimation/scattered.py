"""Starts of a declared system far from its guesses: many are simulated over the first swings, the best are followed.

A free run with a stiffness or a loss that is off by several times has minima that explain nothing, or blows up. Over
the first swings there are few, and one batched simulation of some hundred starts costs no more than a step of a fit.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.stats import qmc

from discovery.equations.model import Model
from discovery.estimation.batch import fit_problems
from discovery.estimation.bench import Bench
from discovery.estimation.least_squares import Minimum
from discovery.estimation.natural_units import NaturalUnits
from discovery.estimation.problem import Problem
from discovery.estimation.residual import explains
from discovery.foundation.arrays import FloatArray
from discovery.foundation.sampling import median_step
from discovery.recordings.experiment import Experiment

#: Starts, a power of two, and by which factor they lie about a guess at most; so many of the best are followed.
_STARTS, _FACTOR, _FOLLOWED = 512, 12.0, 8
#: Periods of the dominant frequency in the first part, and by how much each part is longer than the one before.
_SWINGS, _LONGER = 3.0, 3.0
_FEWEST, _ITERATIONS = 64, 15
#: Steps in the time in which the fastest motion seen turns by one radian.
_STEPS = 10.0
#: A fit that leaves less than this part of the variance of the motion explains it.
_LEFT = 0.1


def start_of_system(
    model: Model, experiments: Sequence[Experiment], units: NaturalUnits, gaussian: Mapping[str, tuple[float, float]]
) -> dict[str, float]:
    """Return start values of a declared system: its guesses where a fit leads anywhere from there, else others.

    Parameters
    ----------
    model : Model
        Its free constants keep the sign of their guesses.
    experiments : sequence of Experiment
        Recordings.
    units : NaturalUnits
        Natural units.
    gaussian : mapping of str to (float, float)
        Constants that are known within a standard deviation: they stay there.

    Returns
    -------
    dict of str to float
        Empty where the guesses are the best start there is.
    """
    step = min([units.time / _STEPS, *(median_step(e.recording.time) for e in experiments)])
    known = {n: g for n, g in gaussian.items() if n in model.parameters}
    lengths = [e.recording.time[e.fitted].size for e in experiments]

    def begun(count: int) -> Problem:
        """Return the problem of the first readings of every recording."""
        sizes = [min(max(count, _FEWEST), size) for size in lengths]
        first = [e.first(n) for e, n in zip(experiments, sizes, strict=True)]
        return Problem(model, Bench(model.base, model.effects, first, step), units, known)

    whole = begun(max(lengths))
    (guessed,) = _followed(whole, [whole.start({})])
    if explains(whole, 2 * guessed.cost, _LEFT):
        return {}
    samples = _SWINGS * 2 * np.pi * units.time / median_step(experiments[0].recording.time)
    count, problem = round(samples), begun(round(samples))
    points = _points(problem)
    while True:
        with np.errstate(over="ignore", invalid="ignore"):
            costs = problem.bench.chi2(*problem.expand(points)).sum(axis=0)
        best = [i for i in np.argsort(costs)[:_FOLLOWED] if np.isfinite(costs[i])]
        minima = [m for m in _followed(problem, list(points[:, best].T)) if np.isfinite(m.cost)]
        if not minima:
            return {}
        if count >= max(lengths):
            found = min(minima, key=lambda m: m.cost)
            return problem.named(found.x) if not guessed.cost <= found.cost else {}
        points, count = np.array([m.x for m in minima]).T, round(_LONGER * count)
        problem = begun(count)


def _followed(problem: Problem, starts: Sequence[FloatArray]) -> list[Minimum]:
    """Return where some steps of a fit lead from starts."""
    return fit_problems([problem] * len(starts), starts, iterations=_ITERATIONS, tolerance=1e-3, rough=True)


def _points(problem: Problem) -> FloatArray:
    """Return starts about the guesses, shape (m, k), the guesses themselves first."""
    start = problem.start({})
    own = [i for i, n in enumerate(problem.free) if problem.model.parameters[n].physical and n not in problem.gaussian]
    points = np.repeat(start[:, None], _STARTS, axis=1)
    powers = 2 * qmc.Sobol(len(own), seed=1).random(_STARTS).T - 1
    powers[:, 0] = 0.0
    points[own] *= _FACTOR**powers
    lower, upper = problem.bounds
    return np.clip(points, lower[:, None], upper[:, None])
