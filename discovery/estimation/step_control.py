"""Step control: a tolerance goes in, simulators come out that keep it, or more accurate ones, or their error."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from discovery.equations.model import Model
from discovery.estimation.batch import fit_problems
from discovery.estimation.bench import Bench
from discovery.estimation.least_squares import Minimum
from discovery.estimation.natural_units import NaturalUnits
from discovery.estimation.problem import Problem
from discovery.estimation.step import choose_step
from discovery.foundation.arrays import FloatArray
from discovery.foundation.errors import ComputationError
from discovery.recordings.experiment import Experiment

#: Most steps of one recording: dry friction and play would ask for any number.
_MOST_STEPS = 200_000
#: Other mechanics may take so many times the steps: the tip does not feel what rings faster still.
_MORE = 8
#: A candidate may take so many times the steps of the set to which it is added.
_DEAREST = 32
#: Steps are far from blowing up where so many times longer ones do not.
_FARTHER = 1.25
#: Steps that differ by less than this factor are the same.
_SAME = 1.01
#: Where a minimum is on other steps shows within so many iterations.
_ITERATIONS = 10


def more_accurate(bench: Bench) -> Iterator[Bench]:
    """Yield simulators of the same recordings, each on half the steps of the last, until they would take too many."""
    most = min(_MOST_STEPS, _DEAREST * bench.cost)
    while (bench := bench.finer(2)).cost <= most:
        yield bench


def solver_errors(fits: Sequence[tuple[Problem, FloatArray]], bench: Bench) -> FloatArray:
    """Return how far more accurate simulators move the readings of fits, held-out samples too.

    Parameters
    ----------
    fits : sequence of (Problem, ndarray of shape (p,))
        Problems, on simulators of the same recordings, and their values.
    bench : Bench
        Other simulators.

    Returns
    -------
    ndarray, shape (fits,)
        Sum over the samples [noise variances]; infinite where a motion blows up.
    """
    errors = np.zeros(len(fits))
    for own in dict.fromkeys(problem.bench for problem, _ in fits):
        here = [i for i, (problem, _) in enumerate(fits) if problem.bench is own]
        sets = [fits[i][0].expand(fits[i][1][:, None]) for i in here]
        parameters, initial = (np.concatenate(each, axis=-1) for each in zip(*sets, strict=True))
        with np.errstate(over="ignore", invalid="ignore"):
            apart = sum(
                np.square((b - a) / e.recording.noise[:, None]).sum(axis=(0, 1))
                for e, a, b in zip(
                    own.experiments, *(s.predict(parameters, initial) for s in (own, bench)), strict=True
                )
            )
        errors[here] = np.where(np.isfinite(apart), apart, np.inf)
    return errors


def cheapest(problem: Problem, minimum: Minimum, bench: Bench, *, worth: float) -> tuple[Problem, Minimum]:
    """Return the same minimum on simulators that cost less, if it is one there, far from blowing up.

    Parameters
    ----------
    problem, minimum : Problem, Minimum
        Fitted on accurate simulators.
    bench : Bench
        The cheapest that are tried, then such as cost twice as much, and twice as much again.
    worth : float
        So much higher may its chi-square be.
    """
    while problem.bench.cost > _SAME * bench.cost:
        longer = bench.finer(1 / _FARTHER)
        # To begin with, it must be no start that blows up.
        if _bounded(problem, minimum.x, bench) and _bounded(problem, minimum.x, longer):
            other = replace(problem, bench=bench)
            (again,) = fit_problems([other], [minimum.x], iterations=_ITERATIONS, tolerance=1e-4, rough=True)
            if 2 * again.cost < 2 * minimum.cost + worth and _bounded(other, again.x, longer):
                return other, again
        bench = bench.finer(2)
    return problem, minimum


def _bounded(problem: Problem, x: FloatArray, bench: Bench) -> bool:
    """Whether the motion of a fit does not blow up on other simulators."""
    with np.errstate(over="ignore", invalid="ignore"):
        read = bench.predict(*problem.expand(x[:, None]))
    return all(np.isfinite(each).all() for each in read)


def tightened(bench: Bench, error: float, allowed: float) -> Bench | None:
    """Return a bench whose steps are so short that an error of the steps falls below what is allowed.

    By a factor of four at most at once; None where it is allowed already, or where the steps would be too many.
    """
    if not error > allowed:
        return None
    # The error falls with the fourth power of the step.
    found = bench.finer(1 / max(0.25, 0.8 * (allowed / error) ** 0.25))
    return found if found.cost <= _MOST_STEPS else None


def affordable_bench(
    model: Model,
    effects: Sequence[str],
    experiments: Sequence[Experiment],
    units: NaturalUnits,
    values: Mapping[str, float],
    *,
    tolerance: float,
    like: Bench,
) -> Bench | None:
    """Return simulators of another base, on as many more steps than a bench as these ask for, up to a limit.

    Parameters
    ----------
    model, effects, experiments, units, values, tolerance
        As for `discovery.estimation.step.choose_step`.
    like : Bench
        Of the base that is known.

    Returns
    -------
    Bench or None
        None where no step that is tried reaches the tolerance.
    """
    shortest = like.seen[0] / min(_MOST_STEPS, _MORE * like.cost)
    try:
        step = choose_step(model, experiments, units, values, tolerance, effects, shortest=shortest)
    except ComputationError:
        return None
    return Bench(model.base, effects, experiments, step)
