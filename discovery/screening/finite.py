"""Starts at finite sizes for effects that trade with the stiffness: linear ones slip by whole swings.

A compliant base of 5 % of the rod's compliance moves the stiffness by 15 %, while a change by 1 % already turns a
recording of a dozen swings by half a radian. So the stiffness is scanned beside every effect of a finite size, all in
one batched simulation.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from discovery.declarations.registry import get_effect
from discovery.estimation.least_squares import Minimum
from discovery.estimation.problem import Problem
from discovery.foundation.arrays import FloatArray
from discovery.screening.along import starts_along
from discovery.screening.attribution import grid_of

#: A start of a refit: effect, its free values, and values of other free parameters that go with them.
FarStart = tuple[str, FloatArray, Mapping[str, float]]
#: An effect with values on its grid.
_Point = tuple[str, Mapping[str, float]]
#: Kinds that carry or return energy, and so move the frequency.
_KINDS = ("shape", "joint", "memory", "potential", "kinetic")
#: Stiffness over the fitted one; a step of 3.6 % finds the phase of a dozen swings, half of it keeps it.
_FACTORS = np.geomspace(0.8, 1.6, 20)
_BESIDE = np.sqrt(_FACTORS[1] / _FACTORS[0]) ** np.array([-1.0, 0.0, 1.0])
#: Laws of more shapes than this are not entangled with the stiffness alone.
MOST_SHAPES = 12
_KEPT = 2


def finite_starts(minimum: Minimum, problem: Problem, names: Sequence[str]) -> list[FarStart]:
    """Return starts of refits with what goes with each: all that is fitted for laws of many shapes, else `alpha`.

    Parameters
    ----------
    minimum, problem : Minimum, Problem
        The fit so far.
    names : sequence of str
        Candidate effects.

    Returns
    -------
    list of FarStart
        At most two for each effect of few shapes, the best sizes by chi-square; of others see `along`.
    """
    system = problem.model.mechanics.system
    own = [get_effect(name) for name in names if get_effect(name).kind in _KINDS]
    grids = {effect.id(): grid_of(effect, system, problem.units) for effect in own}
    many = {name: grid for name, grid in grids.items() if len(grid) > 2 * MOST_SHAPES}
    few = {name: grid for name, grid in grids.items() if name not in many}
    return [*_beside_stiffness(minimum, problem, few), *starts_along(minimum, problem, many)]


def _beside_stiffness(
    minimum: Minimum, problem: Problem, grids: Mapping[str, Sequence[Mapping[str, float]]]
) -> list[FarStart]:
    """Return the best sizes of effects, each with the stiffness that goes with it."""
    if "alpha" not in problem.free:
        return []
    system = problem.model.mechanics.system
    alphas = minimum.x[problem.names.index("alpha")] * _FACTORS
    points: list[_Point] = [(name, values) for name, grid in grids.items() for values in grid]
    if not points:
        return []
    best = alphas[_costs(problem, minimum, points, np.tile(alphas, (len(points), 1))).argmin(axis=1)]
    beside = best[:, None] * _BESIDE
    table = _costs(problem, minimum, points, beside)
    least = table.min(axis=1)
    found: list[FarStart] = []
    for name in dict.fromkeys(n for n, _ in points):
        own_points = [i for i, (n, _) in enumerate(points) if n == name]
        for i in sorted(own_points, key=lambda i: least[i])[:_KEPT]:
            if np.isfinite(least[i]):
                alpha = float(beside[i, table[i].argmin()])
                found.append((name, _vector(name, points[i][1], system), {"alpha": alpha}))
    return found


def _costs(problem: Problem, minimum: Minimum, points: Sequence[_Point], alphas: FloatArray) -> FloatArray:
    """Return chi-square at points with some stiffnesses each, both shapes (points, stiffnesses)."""
    bench = problem.bench
    base, initial = problem.expand(minimum.x[:, None])
    columns = np.repeat(base, alphas.size, axis=1)
    for i, (_, values) in enumerate(points):
        own = slice(i * alphas.shape[1], (i + 1) * alphas.shape[1])
        for parameter, value in values.items():
            columns[bench.names.index(parameter), own] = value
    columns[bench.names.index("alpha")] = alphas.ravel()
    cost = bench.chi2(columns, np.repeat(initial, columns.shape[1], axis=2)).sum(axis=0)
    return np.asarray(cost.reshape(alphas.shape))


def declared_starts(problem: Problem, names: Sequence[str], most: int) -> list[FarStart]:
    """Return starts at the declared finite values of effects, none of one with more than so many, all else as it is."""
    system = problem.model.mechanics.system
    grids = {name: grid_of(get_effect(name), system, problem.units) for name in names}
    return [(n, _vector(n, values, system), {}) for n, grid in grids.items() if len(grid) <= most for values in grid]


def _vector(name: str, values: Mapping[str, float], system: str) -> FloatArray:
    return np.array([values[p.name] for p in get_effect(name).fitted(system)])
