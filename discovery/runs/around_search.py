"""What a loop does around its search: declared effects sought as candidates are, and what follows the answer.

Before it the declared model is fitted in units of the recorded force. After it, values are tested against the rig, and
manoeuvres are designed between what the recordings cannot tell apart.

"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import nullcontext, suppress
from dataclasses import replace

import numpy as np

from discovery.declarations.registry import get_effect
from discovery.diagnosis.contradiction import ContradictionReport, check_contradictions
from discovery.diagnosis.separation import Separation, separate
from discovery.estimation.fit import Fit, fit_near
from discovery.foundation.errors import ComputationError, InputError
from discovery.screening.attribution import screen
from discovery.screening.finite import finite_starts
from discovery.screening.refits import Refit, finish, held_fixed, refit, relaxed
from discovery.selection.context import Context
from discovery.selection.search import Search
from discovery.selection.verdict import Named


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
    without = relaxed(Refit(effect, found.problem, found.minimum), found.model.without(effect))
    if not np.isfinite(without.chi2):
        return None
    problem, minimum = held_fixed(without.problem, without.minimum)
    names = [effect]
    scored = screen(minimum, problem, names)
    quick = refit(minimum, problem, scored, finite=finite_starts(minimum, problem, names, without.problem.gaussian))
    return next(iter(finish(without.problem, quick)), None)


#: Manoeuvres tried for each group of rivals; fewer, but so many at least, where a motion takes more steps than this.
_DESIGNS, _LONG, _FEWEST = 100, 6_000, 20
#: Rivals of one effect for which a manoeuvre is designed.
_RIVALS = 2


def contradiction_of(after: Fit, search: Search, context: Context, *, complete: bool) -> ContradictionReport:
    """Test the final values against what the rig predicts; an arm's where they explain it or something was added.

    What an arm lacks moves its stiffness as far as an error of the rig file would.
    """
    believed = complete or search.best.added or not context.train[0].system.has_rod
    if not (context.settings.follow_up and believed):
        return ContradictionReport()
    context.progress("comparing with the rig")
    bench = search.best.refit.problem.bench
    rng = np.random.default_rng([context.settings.seed, 1])
    return check_contradictions(after, rng, candidates=None if complete else (), bench=bench, context=context)


def separations(search: Search, found: Mapping[str, Named], context: Context) -> tuple[Separation, ...]:
    """Design a manoeuvre, within what the system has done, for every added effect that others explain as well."""
    first = context.train[0]
    # Of a prescribed motion and of a fall there is nothing to choose.
    given = not first.system.has_rod and (first.rig.view is not None or first.rig.traits.falls)
    if given or not context.settings.follow_up:
        return ()
    made = []
    for effect, own in found.items():
        if not own.rivals:
            continue
        rivals = told_apart(effect, own.group)
        context.progress(f"designing a manoeuvre that tells {effect} from {' and '.join(rivals)}")
        sets = {effect: search.best, **{r: own.rivals[own.group.index(r)] for r in rivals}}
        fits = {name: fit_near(c.refit.problem, c.refit.values) for name, c in sets.items()}
        steps = max(f.problem.bench.seen[0] / f.problem.bench.shortest for f in fits.values())
        rng = np.random.default_rng([context.settings.seed, 2])
        # An input that never moved shows no limits, and what has no place of rest none to start from.
        with nullcontext() if first.system.has_rod else suppress(InputError, ComputationError):
            made.append(separate(fits, rng, evaluations=designs(steps)))
    return tuple(made)


def told_apart(effect: str, group: Sequence[str]) -> list[str]:
    """Return the rivals that a manoeuvre should tell from an effect and from each other.

    Where a law contains another only the readings can: that is asked where there is no other rival.
    """
    chosen = [effect]
    for rival in group:
        own = get_effect(rival).reduces_to
        if not any(other in own or rival in get_effect(other).reduces_to for other in chosen):
            chosen.append(rival)
    return chosen[1 : _RIVALS + 1] or list(group[:_RIVALS])


def designs(steps: float) -> int:
    """Return how many manoeuvres are tried where the motion takes so many steps: play takes a hundred thousand."""
    return int(np.clip(_DESIGNS * _LONG / steps, _FEWEST, _DESIGNS))
