"""The starts of recordings that are not fitted: all that is free of them where the parameters of a model are known."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from discovery.equations.model import Model
from discovery.estimation.batch import fit_problems
from discovery.estimation.beginning import from_the_beginning, missed
from discovery.estimation.bench import Bench
from discovery.estimation.least_squares import Minimum
from discovery.estimation.natural_units import NaturalUnits
from discovery.estimation.problem import Problem, side_by_side
from discovery.foundation.arrays import FloatArray

#: A state is found within so many steps, to a thousandth of a nat of 2000 readings that are explained to their noise:
#: mostly within six, where a rotor creeps over a tooth within twenty.
_ITERATIONS, _PRECISE = 25, 1e-6


def fitted_states(problems: Sequence[Problem]) -> list[FloatArray]:
    """Return what is free of every recording, see `Problem.states`, of problems with nothing else free.

    Where a motion blows up in one recording, those of the others are fitted all the same.
    """
    starts = [_state_starts(p) for p in problems]
    if not any(each[0].size for each in starts):
        return [first for first, *_ in starts]
    owners = [i for i, each in enumerate(starts) for _ in each]
    ways, begun = [problems[i] for i in owners], [x for each in starts for x in each]
    minima: list[list[Minimum]] = [[] for _ in problems]
    for i, m in zip(owners, _fitted(ways, begun), strict=True):
        minima[i] += [m] if np.isfinite(m.cost) else []
    # A minimum for every swing that is gained or lost: the beginning has one.
    off = [missed(p.bench, own) for p, own in zip(problems, minima, strict=True)]
    led = from_the_beginning(ways, begun, [off[i] for i in owners])
    for way, m in zip(led, _fitted([ways[i] for i in led], list(led.values())), strict=True):
        minima[owners[way]] += [m] if np.isfinite(m.cost) else []
    alone, found = len(problems[0].bench.experiments) == 1, []
    for p, each, own in zip(problems, starts, minima, strict=True):
        found.append(_best(p, own) if own else each[0] if alone else _apart(p))
    return found


def _fitted(problems: Sequence[Problem], starts: Sequence[FloatArray]) -> list[Minimum]:
    return fit_problems(problems, starts, iterations=_ITERATIONS, tolerance=_PRECISE, rough=True)


def held_out(
    candidates: Sequence[tuple[Model, Mapping[str, float]]], bench: Bench, units: NaturalUnits
) -> list[list[FloatArray]]:
    """Return predictions of a bench's recordings, not fitted: parameters held, only the initial state is fitted.

    Returned (n, c): for each candidate, its prediction of each recording.
    """
    problems = [known_problem(model, values, bench, units) for model, values in candidates]
    starts = fitted_states(problems)
    channels = bench.predict(*side_by_side(problems, [x[:, None] for x in starts]))
    return [[c[:, :, i] for c in channels] for i in range(len(candidates))]


def known_problem(model: Model, values: Mapping[str, float], bench: Bench, units: NaturalUnits) -> Problem:
    """Return the problem of what is free of every recording alone: the parameters of a model are known."""
    known = {**model.known, **{n: v for n, v in values.items() if n in model.parameters}}
    return Problem(Model(model.base, model.effects, known), bench, units, {}, reference="")


def _state_starts(problem: Problem) -> list[FloatArray]:
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
    best = np.argmin([[np.sum(m.residual[rows] ** 2) for rows, _ in problem.bench.blocks()] for m in minima], axis=0)
    return np.array([minima[best[state.experiment]].x[i] for i, state in enumerate(problem.states)])


def _apart(problem: Problem) -> FloatArray:
    """Return the same of one problem, each recording fitted by itself."""
    bench = problem.bench
    alone = [replace(problem, bench=Bench(bench.base, bench.effects, [e], bench.step)) for e in bench.experiments]
    return np.concatenate([fitted_states([p])[0] for p in alone])
