"""Starts of candidates in the place of a member of a set, to first order from where the set with that member is.

Without a member that moves much a set is far from its minimum beside another one, and refits from there stall on the
way. What serves as well as the member is close to where the set with it is.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.linalg import cholesky, solve_triangular
from scipy.optimize import lsq_linear

from discovery.declarations.registry import get_effect, sizes_of
from discovery.estimation.problem import Problem
from discovery.foundation.arrays import FloatArray
from discovery.foundation.start_names import start_of
from discovery.screening.attribution import Candidate, Start
from discovery.screening.finite import FarStart
from discovery.screening.refits import Refit, held_fixed

#: So many are kept, and none that leaves more than this part of what the member removes.
_KEPT, _LEFT = 8, 0.5
#: Of a matrix with ones on its diagonal.
_ROUNDING = 1e-10


def exchange_starts(found: Refit, effect: str, scored: Sequence[Candidate]) -> list[FarStart]:
    """Return the starts, each with the values of all that is fitted beside it, those that leave least first.

    `found`: the set with the member. `effect`: the member. `scored`: candidates screened beside that set.
    """
    problem, minimum = held_fixed(found.problem, found.minimum)
    rows, sizes = problem.bench.n_rows, sizes_of(effect)
    values = {**problem.model.known, **dict(zip(problem.names, minimum.x.tolist(), strict=True))}
    slopes = dict(zip(problem.names, minimum.jacobian[:rows].T, strict=True))
    rest = replace(problem, model=problem.model.without([effect]))
    gone = [n for n in problem.names if n not in rest.names and (start_of(n) or (n,))[0] in sizes]
    absent = minimum.residual[:rows] - sum(values[n] * slopes[n] for n in gone)
    alone, _ = _to_first_order(rest, values, slopes, absent)
    most, ways = 2 * minimum.cost + _LEFT * (alone - 2 * minimum.cost), []
    # What each recording has of its own has no start of this kind.
    for start in (s for c in scored for s in c.starts if not s.own.size):
        other = replace(rest, model=rest.model.with_effect(start.effect))
        added = [p.name for p in get_effect(start.effect).fitted(problem.model.mechanics.system)]
        none = dict(zip(added, np.where(np.isin(np.arange(len(added)), start.sizes), 0.0, start.values), strict=True))
        # What has arrived of an input is where its recording tells, and stays.
        begun = {state.name: state.guess for state in other.states}
        still = {name: np.zeros(rows) for name in begun}
        left, moved = _to_first_order(
            other, begun | values | none, still | slopes | dict(_columns(start, added)), absent
        )
        if left < most:
            ways.append((left, (start.effect, np.array([moved[n] for n in added]), values | moved)))
    return [way for _, way in sorted(ways, key=lambda found: found[0])[:_KEPT]]


def _columns(start: Start, names: Sequence[str]) -> Iterator[tuple[str, FloatArray]]:
    return zip(names, start.columns().T, strict=True)


def _to_first_order(
    problem: Problem, values: Mapping[str, float], slopes: Mapping[str, FloatArray], residual: FloatArray
) -> tuple[float, dict[str, float]]:
    """Return what a step within bounds leaves of a residual, and where it leads.

    A step by the typical size of a value costs as much as one noise variance: two that serve alike do not run away.
    """
    x, columns = (np.array([table[n] for n in problem.names]) for table in (values, slopes))
    gram, push = columns @ columns.T, columns @ residual
    if not x.size or not np.isfinite(gram).all():  # beside a motion that blows up nothing is told
        return np.inf, dict(values)
    stiff = gram + np.diag(problem.scale**-2.0)
    size = np.sqrt(np.diag(stiff))
    factor = cholesky(stiff / np.outer(size, size) + _ROUNDING * np.eye(x.size))
    lower, upper = (size * (bound - x) for bound in problem.bounds)
    target = solve_triangular(factor, -push / size, trans="T")
    within = np.minimum(lower, 0.0), np.maximum(upper, np.finfo(float).tiny)
    step = lsq_linear(factor, target, within, method="bvls").x / size
    left = float(residual @ residual + 2 * push @ step + step @ gram @ step)
    return left, dict(zip(problem.names, (x + step).tolist(), strict=True))
