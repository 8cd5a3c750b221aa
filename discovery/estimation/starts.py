"""Initial states of recordings that were not fitted, for given parameters, and predictions from there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from discovery.equations.model import Model
from discovery.estimation.batch import fit_problems
from discovery.estimation.bench import Bench
from discovery.estimation.least_squares import Minimum
from discovery.estimation.natural_units import NaturalUnits
from discovery.estimation.problem import Problem
from discovery.foundation.arrays import FloatArray

#: A state is found within so many steps.
_ITERATIONS = 12


def fitted_states(problems: Sequence[Problem]) -> list[FloatArray]:
    """Return what is free of every recording, see `Problem.states`, of problems with nothing else free.

    Where a motion blows up in one recording, those of the others are fitted all the same.
    """
    starts = [_starts(p) for p in problems]
    if not any(each[0].size for each in starts):
        return [first for first, *_ in starts]
    minima = fit_problems(
        [p for p, each in zip(problems, starts, strict=True) for _ in each],
        [x for each in starts for x in each],
        iterations=_ITERATIONS,
    )
    alone, found = len(problems[0].bench.experiments) == 1, []
    for p, each in zip(problems, starts, strict=True):
        own, minima = [m for m in minima[: len(each)] if np.isfinite(m.cost)], minima[len(each) :]
        found.append(_best(p, own) if own else each[0] if alone else _apart(p))
    return found


def held_out(
    candidates: Sequence[tuple[Model, Mapping[str, float]]], bench: Bench, units: NaturalUnits
) -> list[list[FloatArray]]:
    """Return predictions of a bench's recordings, not fitted: parameters held, only the initial state is fitted.

    Returns
    -------
    list of list of ndarray, shape (n, c)
        For each candidate, its prediction of each recording.
    """
    problems = []
    for model, values in candidates:
        known = {**model.known, **{n: v for n, v in values.items() if n in model.parameters}}
        problems.append(Problem(Model(model.base, model.effects, known), bench, units, {}, reference=""))
    starts = fitted_states(problems)
    vectors = [p.expand(x[:, None]) for p, x in zip(problems, starts, strict=True)]
    parameters = np.concatenate([v[0] for v in vectors], axis=1)
    initial = np.concatenate([v[1] for v in vectors], axis=2)
    channels = bench.predict(parameters, initial)
    return [[c[:, :, i] for c in channels] for i in range(len(candidates))]


def _starts(problem: Problem) -> list[FloatArray]:
    """Return where the starts of recordings are looked for: from each value of what the recordings do not tell."""
    first = problem.start({})
    ways = max((len(state.starts) for state in problem.states), default=1) or 1
    found = np.repeat(first[None], ways, axis=0)
    for i, state in enumerate(problem.states):
        if state.starts:
            found[:, i] = np.resize(state.starts, ways)
    return list(found)


def _best(problem: Problem, minima: Sequence[Minimum]) -> FloatArray:
    """Return for every recording the start of the minimum that leaves least of it."""
    cost = np.array([[np.sum(m.residual[rows] ** 2) for rows, _ in problem.bench.blocks()] for m in minima])
    best = np.argmin(cost, axis=0)
    return np.array([minima[best[state.experiment]].x[i] for i, state in enumerate(problem.states)])


def _apart(problem: Problem) -> FloatArray:
    """Return the same of one problem, each recording fitted by itself."""
    bench = problem.bench
    alone = [replace(problem, bench=Bench(bench.base, bench.effects, [e], bench.step)) for e in bench.experiments]
    return np.concatenate([fitted_states([p])[0] for p in alone])
