"""A simpler law that a fitted one contains, from where that was fitted."""

from __future__ import annotations

from collections.abc import Mapping

from discovery.declarations.effect import Effect
from discovery.declarations.registry import get_effect
from discovery.estimation.batch import fit_problems
from discovery.estimation.problem import Problem
from discovery.screening.refits import Refit

__all__ = ["contained"]


def contained(fitted: Refit, effect: str, simpler: str) -> Refit:
    """Return a refit with a simpler law in the place of one that contains it.

    A refit of the simpler law by itself may have ended in another minimum: a dry friction whose creep speed is not yet
    known leaves a rough path.

    Parameters
    ----------
    fitted : Refit
        With the larger law.
    effect, simpler : str
        The larger law, and one that it contains.
    """
    larger, smaller, problem = get_effect(effect), get_effect(simpler), fitted.problem
    values = fitted.values
    model = problem.model.without([effect]).with_effect(simpler)
    gaussian = {n: known for n, known in problem.gaussian.items() if n in model.parameters}
    reduced = Problem(model, problem.bench, problem.units, gaussian)
    start = {**values, **_alike(larger, smaller, values)}
    (minimum,) = fit_problems([reduced], [reduced.start(start)], tolerance=1e-6, rough=True)
    return Refit(simpler, reduced, minimum)


def _alike(larger: Effect, smaller: Effect, values: Mapping[str, float]) -> dict[str, float]:
    """Return the values of a simpler law's parameters: those of the larger one's of the same unit and kind."""
    used = [p for p in larger.parameters() if values.get(p.name)]
    found = {}
    for p in smaller.parameters():
        same = next((o for o in used if (o.unit, o.shape, o.fixed) == (p.unit, p.shape, p.fixed)), None)
        if same is not None:
            found[p.name] = values[same.name]
    return found
