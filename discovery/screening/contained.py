"""Simpler laws that a fitted one contains, from where that was fitted."""

from __future__ import annotations

from collections.abc import Mapping

from discovery.declarations.effect import Effect
from discovery.declarations.registry import get_effect
from discovery.estimation.batch import fit_problems
from discovery.estimation.problem import Problem
from discovery.screening.refits import Refit


def reduced(fitted: Refit, effect: str) -> list[Refit]:
    """Return refits with each simpler law, that the model does not have yet, in the place of one that contains it.

    A refit of the simpler law by itself may have ended in another minimum: a dry friction whose creep speed is not yet
    known leaves a rough path.

    Parameters
    ----------
    fitted : Refit
        With the larger law.
    effect : str
        The larger law.
    """
    laws = sorted(get_effect(effect).reduces_to - {*fitted.problem.model.effects})
    return [_with(fitted, effect, law) for law in laws]


def _with(fitted: Refit, effect: str, simpler: str) -> Refit:
    """Return the refit with one of them."""
    larger, smaller, problem = get_effect(effect), get_effect(simpler), fitted.problem
    values = fitted.values
    model = problem.model.without([effect]).with_effect(simpler)
    gaussian = {n: known for n, known in problem.gaussian.items() if n in model.parameters}
    own = Problem(model, problem.bench, problem.units, gaussian)
    start = {**values, **_alike(larger, smaller, values)}
    (minimum,) = fit_problems([own], [own.start(start)], tolerance=1e-6, rough=True)
    return Refit(simpler, own, minimum)


def _alike(larger: Effect, smaller: Effect, values: Mapping[str, float]) -> dict[str, float]:
    """Return the values of a simpler law's parameters: those of the larger one's of the same unit and kind."""
    used = [p for p in larger.parameters() if values.get(p.name)]
    found = {}
    for p in smaller.parameters():
        same = next((o for o in used if (o.unit, o.shape, o.fixed) == (p.unit, p.shape, p.fixed)), None)
        if same is not None:
            found[p.name] = values[same.name]
    return found
