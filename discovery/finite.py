"""Starts at finite sizes for effects that trade with the stiffness: linear ones slip by whole swings.

A compliant base of 5 % of the rod's compliance moves the stiffness by 15 %, while a change by 1 % already turns a
recording of a dozen swings by half a radian. So the stiffness is scanned beside every effect of a finite size, all in
one batched simulation.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from discovery.attribution import grid_of
from discovery.least_squares import Minimum
from discovery.problem import Problem
from discovery.registry import catalogue

__all__ = ["FarStart", "declared_starts", "finite_starts"]

FloatArray = NDArray[np.float64]
#: A start of a refit: effect, its free values, and values of other free parameters that go with them.
FarStart = tuple[str, FloatArray, Mapping[str, float]]
#: Kinds that carry or return energy, and so move the frequency.
_KINDS = ("shape", "joint", "memory", "potential", "kinetic")
#: Stiffness over the fitted one; a step of 1.8 % keeps the phase of a dozen swings.
_FACTORS = np.geomspace(0.8, 1.6, 40)
#: Laws of more shapes than this are not entangled with the stiffness alone.
_MOST_SHAPES = 12
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
    bench, system = problem.bench, problem.model.mechanics.system
    base, initial = problem.expand(minimum.x[:, None])
    at = bench.names.index("alpha")
    alphas = base[at, 0] * _FACTORS
    points = []
    for name in names:
        effect = catalogue()[name]
        grid = grid_of(effect, system, problem.units)
        if effect.kind in _KINDS and len(grid) <= 2 * _MOST_SHAPES:
            points += [(name, values) for values in grid]
    if not points:
        return []
    columns = np.repeat(base, len(points) * alphas.size, axis=1)
    for i, (_, values) in enumerate(points):
        own = slice(i * alphas.size, (i + 1) * alphas.size)
        for parameter, value in values.items():
            columns[bench.names.index(parameter), own] = value
        columns[at, own] = alphas
    cost = bench.chi2(columns, np.repeat(initial, columns.shape[1], axis=2)).sum(axis=0)
    table = cost.reshape(len(points), alphas.size)
    found: list[FarStart] = []
    for name in dict.fromkeys(n for n, _ in points):
        own_points = [i for i, (n, _) in enumerate(points) if n == name]
        for i in sorted(own_points, key=lambda i: table[i].min())[:_KEPT]:
            if np.isfinite(table[i].min()):
                found.append(
                    (name, _vector(name, points[i][1], system), {"alpha": float(alphas[int(np.argmin(table[i]))])})
                )
    return found


def declared_starts(problem: Problem, names: Sequence[str], most: int) -> list[FarStart]:
    """Return starts at the declared finite values of effects, none of one with more than so many, all else as it is."""
    system = problem.model.mechanics.system
    grids = {name: grid_of(catalogue()[name], system, problem.units) for name in names}
    return [(n, _vector(n, values, system), {}) for n, grid in grids.items() if len(grid) <= most for values in grid]


def _vector(name: str, values: Mapping[str, float], system: str) -> FloatArray:
    return np.array([values[p.name] for p in catalogue()[name].fitted(system)])
