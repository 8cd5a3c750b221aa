"""The search: forward by one effect or two, then every member out again or exchanged for another."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from discovery.declarations.forces import SmoothForce
from discovery.declarations.registry import get_effect
from discovery.equations.losses import same_losses
from discovery.estimation.fit import Fit
from discovery.screening.refits import Refit
from discovery.selection.contender import Contender, contenders
from discovery.selection.context import Context
from discovery.selection.decision import Decision
from discovery.selection.final import on_mechanics, settled
from discovery.selection.neighbours import Neighbours
from discovery.selection.odds import HELD, Odds, between_rivals, candidacy, odds_of
from discovery.selection.offers import Offers, plain, simplest_first
from discovery.selection.unknown import Unknown, unknown_force

#: Contenders that are tried in the order of their evidence; records of a decision.
_TRIED, _TOLD = 3, 12
_WORTH = 10.0  #: A refused effect that gains so many times the nats of an accepted one may be half of a pair.


class Search:
    """Finds the set of effects that the recordings ask for.

    Parameters
    ----------
    start : Fit
        The model to which effects are added, on simulators that hold the whole catalogue.
    context : Context
        Recordings, settings, progress.

    Attributes
    ----------
    root, best : Contender
        The declared model, and the set found so far.
    decisions : list of Decision
        What was decided, in order.
    unknown : Unknown or None
        What an unknown force explains beside the set found; None where that leaves noise.
    """

    def __init__(self, start: Fit, context: Context) -> None:
        self.context, self.offers = context, Offers(context)
        self.decisions: list[Decision] = []
        (self.best,) = contenders(context, [((), Refit("", start.problem, start.minimum))])
        self.unknown: Unknown | None = None
        self.root, self.neighbours = self.best, Neighbours(context, self.offers, self.best)

    def run(self) -> None:
        """Search until nothing more is accepted, or what is left is noise."""
        part, exact = self.context.settings.budget.dear_mechanics, self.neighbours.unapproximated
        if self.best.is_far and exact(self.best).evidence.error < part * self.best.evidence.error:
            self._change_mechanics()
        self._settle()
        if self._give_up_a_loss():
            self._settle()
        self._ask_the_unknown()

    def _settle(self) -> None:
        """Add effects, let simpler laws take their places, and take out what is not needed."""
        self._grow()
        grown, told = self.best, len(self.decisions)
        if self._simplify(held=np.inf):  # even where it predicts worse, a simpler law leaves room for others
            self._grow()
            self._unless_likelier(grown, told)
        # What is taken out may have hidden that a simpler law serves.
        for step in (self._simplify, self._integrate, self._prune, self._simplify, self._prune):
            step()

    def _give_up_a_loss(self) -> bool:
        """Let an effect take the place of a declared law that it contains, or, and return True, of a loss."""
        doubled, enough = self.neighbours.without_contained(self.best), self.best.is_enough(self.context)
        declared = doubled or ({} if enough else self.neighbours.without_losses(self.best))
        odds = {n: between_rivals(c, self.best, self.context.settings) for n, (_, c) in declared.items()}
        loss, code = max(odds, key=lambda n: odds[n], default=""), "contained" if doubled else "accepted"
        if not (doubled or (loss and odds[loss] > self.context.settings.nats)):
            return False
        root, self.best = declared[loss]
        self.decisions.append(Decision("exchange", (loss, *self.best.added), True, code, {"odds": odds[loss]}))
        kept = {} if doubled else {self.best.added[-1]: [self.root, *self.offers.beside(self.root)]}
        self.offers = Offers(self.context, same_losses(self.root.model, loss))
        self.neighbours = Neighbours(self.context, self.offers, root, kept)
        return not doubled  # which was settled with it

    def _grow(self) -> None:
        """Add effects until none is accepted, afforded or needed; of sets that give way in turn the likeliest stays."""
        been: dict[tuple[frozenset[str], str], Contender] = {}
        while len(self.best.added) < self.context.settings.budget.most_effects and self.neighbours.affords(self.best):
            if self._is_complete():
                return
            if (before := self.best).key in been:
                self.best = max((c for c in been.values() if len(c.added) == len(before.added)), key=lambda c: c.joint)
                break
            been[before.key] = before
            if self._forward():
                grown, told = self.best, len(self.decisions)
                self._backward(before)
                if any(d.action == "exchange" for d in self.decisions[told:]):
                    self._unless_likelier(grown, told)
                if get_effect(grown.added[-1]).reduces_to.intersection(before.added):  # whose place it takes
                    self._unless_likelier(before, told - 1)
            elif self.best is before and not self._change_mechanics():
                break
        else:
            return self.decisions.append(Decision("stop", (), True, "budget", self.neighbours.work(self.best)))
        self.decisions.append(Decision("stop", (), True, "exhausted"))
        self._change_mechanics()

    def _unless_likelier(self, before: Contender, told: int) -> None:
        """Go back to a set unless decisions led to one as likely: an exchange may make needless what is worth more."""
        if self.best.joint < before.joint:
            self.best = before
            del self.decisions[told:]

    def _simplify(self, held: float | None = None) -> bool:
        """Let a law take the place of one that contains it where the difference is not accepted, and it is itself.

        It is not where it loses more than the nats, or so many, held out, by more than laws idealise.
        """
        before, most = self.best, self.context.settings.nats if held is None else held
        nested = {e: near for e in before.added if (near := get_effect(e).reduces_to - self.offers.given_up)}
        for effect, near in nested.items():
            rest = self.neighbours.without(self.best, effect)
            others = [*self.neighbours.within(self.best, effect), *self.neighbours.instead_of(self.best, effect)]
            for simpler in (c for c in others if near.intersection(c.added)):
                odds, code = self._judged(self.best, simpler)
                stands = code != "accepted" and (code == "size" or odds.held <= most)
                if stands and self._judged(simpler, rest)[1] == "accepted":
                    new = (e for e in simpler.added if e not in self.best.added)
                    self.decisions.append(Decision("exchange", (effect, *new), True, code, odds.numbers))
                    self.best = simpler
                    break
        return self.best is not before

    def confirmed(self, last: Contender, declared: Contender) -> Contender:
        """Return a set after its last fit, without laws that this made others, or that predict worse than none do."""
        searched, self.best, settings = self.best, last, self.context.settings
        self._simplify()
        least, against = self.context.judge.asked(-HELD) * settings.nats, (declared, declared, settings)
        while self.best.added and (odds := odds_of(self.best, *against)).ahead < least:
            sets = {e: settled(self.neighbours.without(self.best, e), self.context) for e in self.best.added}
            effect = max(sets, key=lambda e: sets[e].joint)
            self.decisions.append(Decision("remove", (effect,), True, "predicts_worse", odds.numbers))
            self.best = sets[effect]
            if not self.best.added:  # a loss that was given up is declared again
                self.best, self.offers.given_up = self.root, frozenset()
        if self.best is last:
            self.best = searched
            return last
        self._ask_the_unknown()
        return self.best

    def _integrate(self) -> None:
        """Integrate the set found by importance sampling, and from now on all that are compared with it."""
        if not self.best.added:
            return
        self.context.progress("integrating the last sets by importance sampling")
        self.best = self.neighbours.sampled(self.best)
        if (found := self.best.sampled) is not None:
            code = "sampled" if found.reliable else "laplace"
            self.decisions.append(Decision("integrate", self.best.added, found.reliable, code, found.numbers))

    def _prune(self) -> None:
        """Take out, the least missed first, what is no larger than a model error would be; another effect may serve."""
        for _ in self.best.added:
            smaller = {e: self.neighbours.without(self.best, e) for e in self.best.added}
            judged = {e: self._judged(self.best, c, stays=True) for e, c in smaller.items()}
            weak = [e for e, (_, code) in judged.items() if code != "accepted"]
            if not (effect := max(weak, key=lambda e: smaller[e].joint, default="")):
                return
            self.decisions.append(Decision("remove", (effect,), True, judged[effect][1], judged[effect][0].numbers))
            found, self.best = self.best, smaller[effect]
            self._take(plain(self.neighbours.instead_of(found, effect)))

    def _ask_the_unknown(self) -> None:
        """Weigh an unknown force beside the set found, where more than noise is left."""
        if self.best.leaves_noise(self.context) or not np.isfinite(self.best.joint):
            return
        self.context.progress("weighing an unknown force")
        self.unknown = found = unknown_force(self.context, self.best)
        numbers = {"train": found.train, "held": found.held, "odds": min(found.train, found.train + found.held)}
        if not self.best.added and numbers["odds"] > self.context.settings.nats:
            self.decisions.append(Decision("add", (SmoothForce.id(),), False, "unknown", numbers))

    def _change_mechanics(self) -> bool:
        """Go over to the mechanics that those of the set approximate where the evidence asks for it."""
        other = self.neighbours.unapproximated(self.best)
        if not (gain := other.joint - self.best.joint) > self.context.settings.nats:
            return False
        root = on_mechanics(self.neighbours.root, other.model.base, self.context) if self.best.added else other
        if root is None:
            return False
        self.decisions.append(Decision("mechanics", (other.model.base,), True, "accepted", {"odds": gain}))
        self.best, self.root, self.neighbours = other, root, Neighbours(self.context, self.offers, root)
        for effect in other.added:  # another may have looked like it on what they approximate
            self._exchange(effect)
        return True

    def _is_complete(self) -> bool:
        """Return whether what is left is noise, held out too, and no candidate promises more than chance would."""
        if not self.best.leaves_noise(self.context) or self.best.evidence.misses:
            return False
        promise = max((c.score for c in self.offers.scored(self.best)), default=0.0)
        chance = self.offers.chance(self.best, self.best)
        if promise < chance:
            self.decisions.append(Decision("stop", (), True, "complete", {"promise": promise, "chance": chance}))
        return promise < chance

    def _forward(self) -> bool:
        """Add the effect, or else the two effects, with the highest evidence that is accepted."""
        # A law so flexible that it imitates others is tried where neither plain ones nor two of them serve.
        laws = plain(offered := self.offers.beside(self.best))
        pliable = [c for c in offered if c not in laws]
        if self._take(laws):
            return True
        # What the mechanics approximate may hide an effect, or look like one of the flexible ones.
        if self.best.added and self._change_mechanics():
            return False
        if len(self.best.added) + 2 > self.context.settings.budget.most_effects or self.best.leaves_noise(self.context):
            return self._take(pliable)
        pairs = self.offers.pairs(self.best)
        if self._take(pairs) or any(self._exchange(e, two=True) for e in self.best.added):
            return True
        leading = self._leading(laws)  # effects hide each other: what is refused alone may be right beside another
        if any(self._take(plain(self.offers.beside(c))) for c in leading) or self._take(pliable):
            return True
        if self._take(flexible := self.offers.pairs(self.best, pliable=True)):
            return True
        # Flexible laws and two at once imitate what is not there, and then predict worse.
        leading += self._leading([*offered, *pairs, *flexible], ahead=True)
        return any(self._take(self.offers.beside(c)) for c in leading)

    def _leading(self, offered: Sequence[Contender], *, ahead: bool = False) -> list[Contender]:
        """Return what is refused beside nothing and gains most in training; `ahead`, some score held out, too."""
        settings, alone = self.context.settings, () if self.best.added else offered
        odds = {c: odds_of(c, self.best, self.root, settings) for c in alone if c.chi2 < self.best.chi2}
        found = (c for c, o in odds.items() if o.train > _WORTH * settings.nats and self.neighbours.affords(c))
        kept = [c for c in found if not ahead or max(odds[c].held, odds[c].ahead) > 0]
        return sorted(kept, key=lambda c: -odds[c].train)[: settings.budget.beam]

    def _take(self, offered: Sequence[Contender]) -> bool:
        """Make the most likely set that is accepted, fitted to its end, the best one."""
        settings, before = self.context.settings, self.best
        told = tuple(candidacy(c, before, self.root, settings) for c in offered[:_TOLD])
        for contender in simplest_first(offered, before, settings)[:_TRIED]:
            odds, code = self._judged(contender, before)
            new = tuple(e for e in contender.added if e not in before.added)
            self.decisions.append(Decision("add", new, code == "accepted", code, odds.numbers, told))
            if code == "accepted":
                self.best = max(contender, settled(contender, self.context), key=lambda c: c.evidence.train)
                return True
        return False

    def _judged(self, larger: Contender, smaller: Contender, *, stays: bool = False) -> tuple[Odds, str]:
        """Return the odds of a larger set, and "accepted" or what is missing; `stays` of one that was accepted."""
        settings, least = self.context.settings, self.context.judge.asked(-HELD if stays else HELD)
        code = (odds := self.neighbours.odds(larger, smaller, self.root, least)).code(settings, least)
        if code == "accepted" and np.isfinite(odds.train) and self.offers.is_chance(larger, smaller, odds):
            code = "chance"
        if code == "accepted" and len(new := [e for e in larger.added if e not in smaller.added]) > 1:
            # Neither of two may be needless beside the other.
            each = (self._judged(larger, self.neighbours.without(larger, e), stays=True) for e in new)
            return next((own for own in each if own[1] != "accepted"), (odds, code))
        return odds, code

    def _backward(self, before: Contender) -> None:
        """Take out members that the others make needless; exchange those that another effect serves better."""
        waiting = [*self.best.added[: None if len({*self.best.added} - {*before.added}) > 1 else -1]]
        for effect in waiting:
            if effect not in self.best.added or len(self.best.added) < 2:
                continue
            smaller = self.neighbours.without(self.best, effect)
            odds, code = self._judged(self.best, smaller, stays=True)
            if code != "accepted":
                self.decisions.append(Decision("remove", (effect,), True, code, odds.numbers))
                self.best = smaller
                continue
            self._exchange(effect)
            waiting += [e for e in self.best.added[:-1] if e not in waiting]

    def _exchange(self, effect: str, *, two: bool = False) -> bool:
        """Let another effect, accepted by itself, or `two`, accepted as two more would be, take a member's place."""
        before, settings, rest = self.best, self.context.settings, self.neighbours.without(self.best, effect)
        may = self.neighbours.affords(rest) and (np.isfinite(rest.joint) if two else not before.is_far)
        ways = (self.offers.pairs(rest) if two else self.offers.beside(rest, before)) if may else []
        offered = [c for c in plain(ways) if not (two and effect in c.added)]
        judged = (c for c in offered[:_TRIED] if self._judged(c, before if two else rest)[1] == "accepted")
        gain = (new := next(judged, before)).joint - before.joint
        if effect not in new.added and gain > settings.nats:
            told = tuple(candidacy(c, rest, self.root, settings) for c in offered[:_TOLD])
            effects = (effect, *new.added[-1 - two :])
            self.decisions.append(Decision("exchange", effects, True, "accepted", {"odds": gain}, told))
            self.best = new
        return self.best is not before
