"""How candidates relate: which remove a residual together, cannot be told apart, or contain a simpler law."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.linalg import orth

from discovery.declarations.effect import Effect
from discovery.declarations.registry import get_effect
from discovery.equations.model import Model
from discovery.estimation.batch import fit_problems
from discovery.estimation.problem import Problem
from discovery.foundation.arrays import FloatArray
from discovery.screening.attribution import Candidate
from discovery.screening.refits import Refit


def likely_pairs(
    scored: Sequence[Candidate], target: FloatArray, keep: int, *, pliable: bool
) -> list[tuple[Candidate, Candidate]]:
    """Return the pairs of candidates whose best sensitivities together remove most of a residual, to first order.

    `scored`: from `screen`. `target` (n,): the residual around which they were screened. `keep`: number of pairs.
    `pliable`: whether a law that may imitate others is in each of them, or in none.
    """
    flexible = [get_effect(c.effect).pliable for c in scored]
    bases = [c.sensitivity for c in scored]
    edges = np.cumsum([0, *(b.shape[1] for b in bases)])
    everything = np.concatenate(bases, axis=1)
    gram, push = everything.T @ everything, everything.T @ target
    gains = {}
    for i in range(len(scored)):
        for j in range(i):
            if (flexible[i] or flexible[j]) is not pliable:
                continue
            at = np.r_[edges[i] : edges[i + 1], edges[j] : edges[j + 1]]
            solution = np.linalg.lstsq(gram[np.ix_(at, at)], push[at], rcond=1e-9)[0]
            gains[j, i] = float(push[at] @ solution)
    best = sorted(gains, key=lambda pair: -gains[pair])[:keep]
    return [(scored[j], scored[i]) for j, i in best]


def similarity(first: FloatArray, second: FloatArray) -> float:
    """Return the largest principal cosine between two projected sensitivities: 1 when they cannot be told apart.

    What moves nothing is like nothing: 0.
    """
    a, b = (orth(columns) for columns in (first, second))
    return float(np.linalg.svd(a.T @ b, compute_uv=False).max(initial=0.0))


def reduced(fitted: Refit, effect: str) -> list[Refit]:
    """Return refits with each simpler law, that the model does not have yet, in the place of one that contains it.

    A refit of the simpler law by itself may have ended in another minimum: a dry friction whose creep speed is not yet
    known leaves a rough path.

    `fitted`: with the larger law. `effect`: the larger law.
    """
    larger, problem, values, found = get_effect(effect), fitted.problem, fitted.values, []
    for law in sorted(larger.reduces_to - {*problem.model.effects}):
        model = problem.model.without([effect]).with_effect(law)
        gaussian = {n: known for n, known in problem.gaussian.items() if n in model.parameters}
        own = Problem(model, problem.bench, problem.units, gaussian)
        start = {**values, **_alike_values(larger, get_effect(law), values)}
        (minimum,) = fit_problems([own], [own.start(start)], tolerance=1e-6, rough=True)
        found.append(Refit(law, own, minimum))
    return found


def absorbed(fitted: Refit, law: str, model: Model) -> Refit:
    """Return the refit without a law that another of its model contains, from where that has what both held.

    `fitted`: with both. `law`: the one contained, or a constant of the system that is. `model`: without it.
    """
    problem, values = fitted.problem, dict(fitted.values)
    larger = [o for e in problem.model.terms if law in e.reduces_to for o in e.parameters()]
    for p in get_effect(law).parameters() if larger else ():
        twice = [o.name for o in larger if (o.unit, o.shape, o.fixed) == (p.unit, p.shape, p.fixed)]
        if twice and not p.shape:
            values[twice[0]] += values[p.name]
    own = Problem(model, problem.bench, problem.units, problem.gaussian)
    (minimum,) = fit_problems([own], [own.start(values)], tolerance=1e-6, rough=True)
    return Refit(next(reversed(model.effects), ""), own, minimum)


def _alike_values(larger: Effect, smaller: Effect, values: Mapping[str, float]) -> dict[str, float]:
    """Return the values of a simpler law's parameters: those of the larger one's of the same unit and kind."""
    used = [p for p in larger.parameters() if values.get(p.name)]
    found = {}
    for p in smaller.parameters():
        same = next((o for o in used if (o.unit, o.shape, o.fixed) == (p.unit, p.shape, p.fixed)), None)
        if same is not None:
            found[p.name] = values[same.name]
    return found
