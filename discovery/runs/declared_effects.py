"""The declared model before a search: in units of the recorded force, its effects sought as candidates are.

The first fit begins each effect at one value, and may end in a poor minimum.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from discovery.declarations.registry import get_effect
from discovery.estimation.fit import Fit
from discovery.screening.attribution import screen
from discovery.screening.finite import finite_starts
from discovery.screening.refits import Refit, finish, held_fixed, refit, relaxed
from discovery.selection.context import Context


def in_its_units(found: Fit, context: Context, whole: Context) -> tuple[Fit, Context, Context]:
    """Return the first fit and the contexts of a search in units that know the size of the recorded force by it."""
    units = found.problem.units.pushed(found.values.get(found.model.mechanics.gain, 0.0))
    fit, known = replace(found, problem=replace(found.problem, units=units)), replace(context, units=units)
    return fit, known, known if whole is context else replace(whole, units=units)


def sought(found: Fit, context: Context) -> Fit:
    """Return the fit of a declared model from the best start of each of its declared effects that have several.

    Each is taken out, screened beside the others and refitted from all of its starts: a frequency or a number of teeth
    has many minima. The fit changes where that gains as many nats as a candidate must.
    """
    declared = [e for e in found.model.effects if e in context.train[0].rig.declared]
    for effect in (e for e in declared if any(p.shape and len(p.starts) > 1 for p in get_effect(e).parameters())):
        best = _again(found, effect)
        if best is not None and best.chi2 < found.chi2 - 2 * context.settings.nats:
            again = context.fit(found.model, best.values, found.problem.gaussian)
            found = again if again.chi2 < found.chi2 else found
    return found


def _again(found: Fit, effect: str) -> Refit | None:
    """Return the best refit of an effect beside the others; None where nothing is finite."""
    without = relaxed(Refit(effect, found.problem, found.minimum), [effect])
    if not np.isfinite(without.chi2):
        return None
    problem, minimum = held_fixed(without.problem, without.minimum)
    names = [effect]
    scored = screen(minimum, problem, names)
    quick = refit(minimum, problem, scored, finite=finite_starts(minimum, problem, names))
    return next(iter(finish(without.problem, without.minimum, quick)), None)
