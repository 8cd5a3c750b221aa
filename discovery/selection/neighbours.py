"""The sets next to one that was found: without a member, and with another effect in its place."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache, partial

import numpy as np

from discovery.declarations.registry import get_effect
from discovery.equations.losses import doubled, is_loss, without_losses
from discovery.screening.likeness import absorbed, reduced
from discovery.screening.refits import relaxed
from discovery.selection.contender import Contender, contenders, integrated
from discovery.selection.context import Context
from discovery.selection.final import on_mechanics
from discovery.selection.odds import HELD, Odds, odds_of
from discovery.selection.offers import Offers, plain

#: For a law that took the place of a declared loss: the sets with that loss, as they were offered before.
_Kept = Mapping[str, Sequence[Contender]]
#: Sets so many times the nats of an accepted effect behind are integrated by sampling where the set found is.
_NEAR = 3.0


class Neighbours:
    """The sets next to those of one search, each made once."""

    def __init__(self, context: Context, offers: Offers, root: Contender, kept: _Kept | None = None) -> None:
        self.context, self.offers, self.root, self.kept = context, offers, root, kept or {}
        self._smaller: dict[object, Contender] = {}
        self._simpler: dict[object, list[Contender]] = {}
        #: Returns a set integrated by importance sampling.
        self.sampled: Callable[[Contender], Contender] = cache(partial(integrated, context))
        #: Returns a set on the first of the mechanics that its own approximate on which it is as likely.
        self.unapproximated: Callable[[Contender], Contender] = cache(self._unapproximated)

    def affords(self, node: Contender) -> bool:
        """Return whether the catalogue may be tried beside a set: not where that costs far more than at the start."""
        work = self.work(node)
        return self.offers.has(node) or (work["offers"] < work["most_offers"] and work["cost"] <= work["most_cost"])

    def work(self, node: Contender) -> dict[str, float]:
        """Return a set's members, the sets extended so far, its simulations' cost in those of the start, and limits."""
        most, (here, start) = self.context.settings.budget, (c.refit.problem.bench.charge for c in (node, self.root))
        dearer = max(most.dearer, most.cheap / start)
        limits = {"most_effects": most.most_effects, "most_offers": most.offers, "most_cost": dearer}
        return {"effects": len(node.added), "offers": len(self.offers), "cost": here / start, **limits}

    def without(self, found: Contender, effect: str) -> Contender:
        """Return the best set without one of the members of another, refitted."""
        if (key := (found.key, found.chi2, effect)) not in self._smaller:
            rest = tuple(e for e in found.added if e != effect)
            known = self.offers.known(rest, found.model.base)
            made = contenders(self.context, [(rest, relaxed(found.refit, found.model.without(effect)))])
            # Where a member that stays imitates others, it is another law by the same name.
            made += known if rest else [self.root]
            self._smaller[key] = max(made, key=lambda c: (not c.strays(found), c.evidence.train))
        return self._beside(found, self._smaller[key])

    def lower(self) -> Contender:
        """Return the start, from where the likeliest set beside it leads it if that is a likelier minimum."""
        offered = self.offers.beside(self.root) if self.root.is_far else []
        led = [self.without(c, c.added[-1]) for c in offered[:1] if np.isfinite(c.joint)]
        least = self.root.evidence.train + self.context.settings.nats
        return next((c for c in led if c.evidence.train > least), self.root)

    def _unapproximated(self, found: Contender) -> Contender:
        others = (on_mechanics(found, base, self.context) for base in found.model.mechanics.approximates)
        likely = (c for c in others if c is not None and c.joint > found.joint - self.context.settings.nats)
        return next(likely, found)

    def instead_of(self, found: Contender, effect: str) -> list[Contender]:
        """Return the sets with another effect in the place of a member, the most likely first.

        What is another number in every recording may stand for two laws, the one that it contains and a plain one, or
        these for it.
        """
        smaller, own = self.without(found, effect), frozenset(found.added)
        offered = [*(self.offers.beside if self.affords(smaller) else self.offers.instead)(smaller, found)]
        more = get_effect(effect).own() and len(own) < self.context.settings.budget.most_effects
        for c in self.within(found, effect) if more else ():
            offered += plain(self.offers.beside(c)) if self.affords(c) else []
        for law in own - {effect}:
            offered += self.offers.containing(own - {effect, law}, law, found.model.base)
        others = [c for c in offered if not own <= frozenset(c.added) and np.isfinite(c.joint) and not c.strays(found)]
        likely = sorted((self._beside(found, c) for c in others), key=lambda c: -c.joint)
        return [c for i, c in enumerate(likely) if c.added[-1:] not in [before.added[-1:] for before in likely[:i]]]

    def rivals(self, found: Contender, effect: str) -> list[Contender]:
        """Return the sets with another effect in the place of a member, or with the declared loss that it replaced."""
        kept = (c for c in self.kept.get(effect, ()) if np.isfinite(c.joint) and effect not in c.added)
        return [*self.instead_of(found, effect), *(self._beside(found, c) for c in kept)]

    def within(self, found: Contender, effect: str) -> list[Contender]:
        """Return the sets with a law that a member contains, from where that was fitted."""
        if (key := (found.key, found.chi2, effect)) not in self._simpler:
            rest, laws = [e for e in found.added if e != effect], reduced(found.refit, effect)
            self._simpler[key] = contenders(self.context, [((*rest, r.effect), r) for r in laws])
        return [self._beside(found, c) for c in self._simpler[key]]

    def odds(self, larger: Contender, smaller: Contender, root: Contender, least: float) -> Odds:
        """Return the log odds of a larger set, see `odds_of`, `least` asked held out.

        An error of the mechanics may look like a law that then is refused for its size, as it may be that error. Of one
        effect more the size is judged beside such a law, too: it may be a part of the error that is known.
        """
        settings, odds = self.context.settings, odds_of(larger, smaller, root, self.context.settings)
        new = [e for e in larger.added if e not in smaller.added]
        alone = len(new) == len(larger.added) - len(smaller.added) == 1 and not get_effect(new[0]).imitative
        for both in self.offers.imitators(larger) if alone and odds.code(settings, least) == "size" else ():
            beside = odds_of(both, self.without(both, new[0]), root, settings)
            if beside.code(settings, least) == "accepted":
                odds = replace(odds, size=beside.size, against_error=beside.against_error, beside=True)
        return odds

    def without_losses(self, found: Contender) -> dict[str, tuple[Contender, Contender]]:
        """Return, for a declared loss, the start without it and the likeliest law in its place that is accepted.

        Tried is a loss that beside the declared one is about as likely as the set found.
        """
        settings, offered = self.context.settings, self.offers.beside(self.root) if self.affords(self.root) else []
        lossy = (c for c in plain(offered) if is_loss(c.added[-1]) and {*c.added} != {*found.added})
        near = [c for c in lossy if c.joint > found.joint - _NEAR * settings.nats]
        made: dict[str, tuple[Contender, Contender]] = {}
        for loss, model in without_losses(self.root.model).items() if near else ():
            (rest,) = contenders(self.context, [((), relaxed(self.root.refit, model))])
            other = [c for c in near if loss not in get_effect(c.added[-1]).reduces_to]
            sets = contenders(self.context, [(c.added, relaxed(c.refit, without_losses(c.model)[loss])) for c in other])
            for c in [c for c in sets if odds_of(c, rest, rest, settings).code(settings, HELD) == "accepted"][:1]:
                made[loss] = rest, self._beside(found, c)
        return made

    def without_contained(self, found: Contender) -> dict[str, tuple[Contender, Contender]]:
        """Return, for a declared law that a member of a set contains, and so doubles, start and set without it."""
        declared, held = (doubled(c.model, found.added) for c in (self.root, found))
        made = {}
        for law in sorted(declared):
            rest = relaxed(self.root.refit, declared[law])
            sets = (((), rest), (found.added, absorbed(found.refit, law, held[law])))
            (start,), (less,) = (contenders(self.context, [own]) for own in sets)
            made[law] = start, self._beside(found, less)
        return made

    def _beside(self, found: Contender, other: Contender) -> Contender:
        """Return a set as it is compared with the one found: integrated as that is, unless it is far behind."""
        near = other.joint > found.joint - _NEAR * self.context.settings.nats
        return self.sampled(other) if near and found.sampled is not None else other
