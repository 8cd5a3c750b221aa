"""The verdict: what is named, how sure each name is, and what error the model keeps. It is decided here alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from discovery.declarations.registry import get_effect
from discovery.selection.contender import Contender
from discovery.selection.context import Context
from discovery.selection.odds import HELD, Odds, between_rivals, odds_of
from discovery.selection.search import Search

VERDICTS = ("explained", "partly_explained", "nothing_missing", "unexplained")


@dataclass(frozen=True)
class Named:
    """How sure one named effect is."""

    effect: str  # its id
    odds: Odds  # against its absence
    probability: float  # among its absence and everything else in its place
    group_probability: float  # of it or one of those that serve as well
    group: tuple[str, ...]  # these others
    rivals: tuple[Contender, ...]  # and the sets with them
    force: Mapping[str, float]  # log odds beside an unknown force, and of that instead; none where noise is left
    doubtful: bool  # whether the force explains more in its place, and the effect nothing beside the force


def least_error(contender: Contender, root: Contender, context: Context) -> float:
    """Return the model error up to which a set counts as complete [noise sds].

    It is told from none only above its scale, above what the mechanics states of itself, and above what the added laws
    idealise of all that they move beside the `root`, the model without them.
    """
    n_data = contender.refit.problem.bench.n_data
    moved = np.sqrt(max(root.chi2 - contender.chi2, 0.0) / n_data)
    law = context.settings.law_of(contender.model) * moved
    return float(np.hypot(context.least_error(contender.model), law))


def is_complete(contender: Contender, root: Contender, context: Context) -> bool:
    """Return whether the model error of a set, in training and held out, cannot be told from none."""
    return contender.is_enough(context) or contender.evidence.left <= least_error(contender, root, context)


def verdict_of(added: Sequence[str], geometry: Sequence[str], *, complete: bool) -> str:
    """Return the verdict for the effects that were added, better mechanics among them, and what is left."""
    if complete:
        return "explained" if (*geometry, *added) else "nothing_missing"
    return "partly_explained" if added else "unexplained"


def named(search: Search) -> list[Named]:
    """Return how sure every effect of the set found is: against its absence and against what else serves."""
    settings, complete = search.context.settings, is_complete(search.best, search.root, search.context)
    found, least = [], search.context.judge.asked(-HELD)
    for effect in search.best.added:
        smaller = search.neighbours.without(search.best, effect)
        odds = search.neighbours.odds(search.best, smaller, search.root, least)
        # What predicts worse than nothing in its place serves nobody.
        instead = search.neighbours.rivals(search.best, effect)
        ways = {c: odds_of(c, smaller, search.root, settings) for c in instead}
        others = [c for c in instead if ways[c].code(settings, least) != "held_out"]
        behind = {c: search.best.joint - c.joint for c in others}
        # Another form of a law may look like one that contains it, even where nothing else is left.
        near = [c for c in others if not complete or get_effect(effect).reduces_to.intersection(c.added)]
        for rival in near:
            # What is itself no larger than the model error is no rival that this could hide.
            if ways[rival].against_error >= settings.nats:
                behind[rival] = between_rivals(search.best, rival, settings)
        weights = {c: float(np.exp(-max(behind[c], 0.0))) for c in others}
        total = 1.0 + float(np.exp(-max(odds.total, 0.0))) + sum(weights.values())
        serve = [c for c in others if behind[c] < settings.nats]
        # One that contains another of them is no rival of its own.
        group = [c for c in serve if c.added and not any({*less.added} < {*c.added} for less in serve)]
        names = tuple([e for e in c.added if e not in smaller.added][-1] for c in group)
        shared = 1.0 + sum(weights[c] for c in serve)
        force, doubtful = {}, False
        if search.unknown is not None and effect in search.unknown.kept:
            kept, other = search.unknown.kept[effect], search.unknown.instead[effect]
            force, doubtful = {"beside_force": kept, "force_instead": other}, bool(other > settings.nats > kept)
        found.append(Named(effect, odds, 1.0 / total, shared / total, names, tuple(group), force, doubtful))
    return found
