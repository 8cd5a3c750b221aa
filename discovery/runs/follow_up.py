"""What follows an answer: its values against the rig, and manoeuvres between what it cannot tell apart."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import nullcontext, suppress

import numpy as np

from discovery.declarations.registry import get_effect
from discovery.diagnosis.contradiction import ContradictionReport, check_contradictions
from discovery.diagnosis.separation import Separation, separate
from discovery.estimation.fit import Fit, fit_near
from discovery.foundation.errors import ComputationError, InputError
from discovery.selection.context import Context
from discovery.selection.search import Search
from discovery.selection.verdict import Named

#: Manoeuvres tried for each group of rivals; fewer, but so many at least, where a motion takes more steps than this.
_DESIGNS, _LONG, _FEWEST = 100, 6_000, 20
#: Rivals of one effect for which a manoeuvre is designed.
_RIVALS = 2


def contradiction_of(after: Fit, search: Search, context: Context, *, complete: bool) -> ContradictionReport:
    """Test the final values against what the rig predicts, where they explain the motion or something was added."""
    if not context.settings.follow_up or not (complete or search.best.added):
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
