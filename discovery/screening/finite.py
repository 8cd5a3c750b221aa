"""Starts at finite sizes for effects that trade with the stiffness: linear ones slip by whole swings.

A compliant base of 5 % of the rod's compliance moves the stiffness by 15 %, while a change by 1 % already turns a
recording of a dozen swings by half a radian. So the stiffness is scanned beside every effect of a finite size, all in
one batched simulation.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from discovery.declarations.registry import get_effect
from discovery.estimation.least_squares import Minimum
from discovery.estimation.problem import Problem
from discovery.screening.attribution import grid_of

__all__ = ["MOST_SHAPES", "FarStart", "declared_starts", "finite_starts"]

FloatArray = NDArray[np.float64]
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
    """Return starts of refits with the stiffness `alpha` that goes with each.

    Parameters
    ----------
    minimum, problem : Minimum, Problem
        The fit so far.
    names : sequence of str
        Candidate effects.

    Returns
    -------
    list of FarStart
        At most two for each effect, the best sizes by chi-square.
    """
    if "alpha" not in problem.free:
        return []
    points = _points(problem, names, _KINDS)
    if not points:
        return []
    base = problem.expand(minimum.x[:, None])
    alphas = minimum.x[problem.names.index("alpha")] * _FACTORS
    best = alphas[_costs(problem, base, points, np.tile(alphas, (len(points), 1))).argmin(axis=1)]
    beside = best[:, None] * _BESIDE
    table = _costs(problem, base, points, beside)
    stiffness = beside[np.arange(len(points)), table.argmin(axis=1)]
    system = problem.model.mechanics.system
    return [
        (points[i][0], _vector(*points[i], system), {"alpha": float(stiffness[i])})
        for i in _best(points, table.min(axis=1), _KEPT)
    ]


def _points(problem: Problem, names: Sequence[str], kinds: Sequence[str] | None = None) -> list[_Point]:
    """Return effects, all or of some kinds, with the finite values of their grids where these are few."""
    found: list[_Point] = []
    for name in names:
        effect = get_effect(name)
        grid = grid_of(effect, problem.model.mechanics.system, problem.units)
        if (kinds is None or effect.kind in kinds) and len(grid) <= 2 * MOST_SHAPES:
            found += [(name, values) for values in grid]
    return found


def _best(points: Sequence[_Point], costs: FloatArray, most: int) -> list[int]:
    """Return so many points of each effect at most, those with the smallest finite chi-squares."""
    found: list[int] = []
    for name in dict.fromkeys(n for n, _ in points):
        own = [i for i, (n, _) in enumerate(points) if n == name and np.isfinite(costs[i])]
        found += sorted(own, key=lambda i: costs[i])[:most]
    return found


def _costs(
    problem: Problem, base: tuple[FloatArray, FloatArray], points: Sequence[_Point], alphas: FloatArray | None = None
) -> FloatArray:
    """Return chi-square of points beside parameters and initial states, shape (points, stiffnesses of each)."""
    bench, each = problem.bench, 1 if alphas is None else alphas.shape[1]
    columns = np.repeat(base[0], len(points) * each, axis=1)
    for i, (_, values) in enumerate(points):
        for parameter, value in values.items():
            columns[bench.names.index(parameter), i * each : (i + 1) * each] = value
    if alphas is not None:
        columns[bench.names.index("alpha")] = alphas.ravel()
    cost = bench.chi2(columns, np.repeat(base[1], columns.shape[1], axis=2)).sum(axis=0)
    return np.asarray(cost.reshape(len(points), each))


def declared_starts(problem: Problem, names: Sequence[str], most: int) -> list[FarStart]:
    """Return starts at the declared finite values of effects, none of one with more than so many, all else as it is."""
    system = problem.model.mechanics.system
    grids = {name: grid_of(get_effect(name), system, problem.units) for name in names}
    return [(n, _vector(n, values, system), {}) for n, grid in grids.items() if len(grid) <= most for values in grid]


def _vector(name: str, values: Mapping[str, float], system: str) -> FloatArray:
    return np.array([values[p.name] for p in get_effect(name).fitted(system)])
