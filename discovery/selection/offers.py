"""What the catalogue offers beside a set of effects: every candidate screened and refitted, and promising pairs."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from discovery.declarations.registry import get_effect, simplicity
from discovery.estimation.batch import near_the_best
from discovery.screening.attribution import Candidate, White, screen
from discovery.screening.beside import refits_beside
from discovery.screening.exchange import exchange_starts
from discovery.screening.finite import FarStart
from discovery.screening.likeness import likely_pairs
from discovery.screening.refits import finish, held_fixed, refit_pairs
from discovery.screening.significance import chance_gains, surrogates
from discovery.selection.contender import Contender, contenders
from discovery.selection.context import Context
from discovery.selection.odds import HELD, Odds
from discovery.selection.settings import LoopSettings

#: Effects and mechanics of a set.
_Key = tuple[frozenset[str], str]


class Offers:
    """What the catalogue offers beside the sets of one search, each made once; nothing that was `given_up` before."""

    def __init__(self, context: Context, given_up: frozenset[str] = frozenset()) -> None:
        self.context, self.given_up = context, given_up
        self._made: dict[_Key, list[Contender]] = {}
        self._instead: dict[tuple[_Key, _Key], list[Contender]] = {}
        self._imitators: dict[_Key, list[Contender]] = {}
        self._pairs: dict[tuple[_Key, bool], list[Contender]] = {}
        self._scored: dict[_Key, tuple[Candidate, ...]] = {}
        self._chance: dict[tuple[Contender, Contender], float] = {}

    def __len__(self) -> int:
        """Return how many sets were extended by every candidate."""
        return len(self._made)

    def has(self, node: Contender) -> bool:
        """Return whether the offer beside a set is made already."""
        return node.key in self._made

    def scored(self, node: Contender) -> tuple[Candidate, ...]:
        """Return every candidate beside a set with its linear score, the largest first."""
        if node.key not in self._scored:
            problem, minimum = held_fixed(node.refit.problem, node.refit.minimum)
            names = [n for n in self.context.candidates(problem.model) if n not in self.given_up]
            beside = f" beside {' and '.join(node.added)}" if node.added else ""
            self.context.progress(f"screening the catalogue{beside} ({len(names)} effects)")
            self._scored[node.key] = tuple(screen(minimum, problem, names))
        return self._scored[node.key]

    def beside(self, node: Contender, found: Contender | None = None) -> list[Contender]:
        """Return a set with one effect more: every candidate refitted, the best of them weighed, most likely first.

        `found`: a set with one effect more, from where what may take its place begins as well; not where the offer is
        made already.
        """
        if node.key not in self._made:
            scored, beside = self.scored(node), f" beside {' and '.join(node.added)}" if node.added else ""
            self.context.progress(f"refitting every candidate{beside}")
            self._made[node.key] = self._weighed(node, scored, self._exchanges(node, found))
        return self._made[node.key]

    def instead(self, node: Contender, found: Contender) -> list[Contender]:
        """Return a set with what may take the place of the one effect that another has more, from where that is."""
        if (key := (node.key, found.key)) not in self._instead:
            self._instead[key] = self._weighed(node, (), self._exchanges(node, found))
        return self._instead[key]

    def _exchanges(self, node: Contender, found: Contender | None) -> list[FarStart]:
        if found is None:
            return []
        more = (e for e in found.added if e not in node.added)
        return [s for e in more for s in exchange_starts(found.refit, e, self.scored(found))]

    def _weighed(self, node: Contender, scored: Sequence[Candidate], starts: Sequence[FarStart]) -> list[Contender]:
        most = self.context.settings.budget.finished
        found = refits_beside(node.refit, scored, starts, keep=most, far=node.is_far, first=not node.added)
        return contenders(self.context, [((*node.added, r.effect), r) for r in found[:most]])

    def imitators(self, node: Contender) -> list[Contender]:
        """Return a set with a law more that an error of its mechanics looks like, of those that contain no other."""
        if node.key not in self._imitators:
            every = {n: get_effect(n) for n in self.context.candidates(node.model)}
            names = [n for n, law in every.items() if law.imitative and not law.reduces_to]
            problem, minimum = held_fixed(node.refit.problem, node.refit.minimum)
            self._imitators[node.key] = self._weighed(node, screen(minimum, problem, names), ()) if names else []
        return self._imitators[node.key]

    def known(self, added: Sequence[str], base: str) -> list[Contender]:
        """Return sets of these effects on a base that were weighed as an extension of another."""
        return [c for offered in self._made.values() for c in offered if c.key == (frozenset(added), base)]

    def containing(self, added: frozenset[str], law: str, base: str) -> list[Contender]:
        """Return sets of these effects beside a law with a number per recording that contains another, as weighed."""
        made = [(c, get_effect(c.added[-1])) for c in self._made.get((added, base), ())]
        return [c for c, last in made if last.own() and law in last.reduces_to]

    def pairs(self, node: Contender, *, pliable: bool = False) -> list[Contender]:
        """Return sets with two effects more that would explain the residual to first order, the most likely first."""
        if (key := (node.key, pliable)) not in self._pairs:
            most = self.context.settings.budget.pairs
            problem, minimum = held_fixed(node.refit.problem, node.refit.minimum)
            likely = likely_pairs(self.scored(node), minimum.residual[: problem.bench.n_rows], most, pliable=pliable)
            self.context.progress("refitting pairs")
            quick = refit_pairs(minimum, problem, likely)
            near = near_the_best([r.chi2 for r in quick], problem.bench.n_data)[: most // 2]
            full = finish(node.refit.problem, [quick[i] for i in near])
            sets = [((*node.added, *r.problem.model.effects[-2:]), r) for r in full]
            self._pairs[key] = contenders(self.context, sets)
        return self._pairs[key]

    def chance(self, smaller: Contender, larger: Contender) -> float:
        """Return the chi-square that noise alone would let the best candidate beside a set remove, at the level asked.

        The noise has the spectrum of what the larger set leaves, under whose model error it counts; smooth, if that is
        the set itself.
        """
        if (smaller, larger) not in self._chance:
            settings, problem, minimum = self.context.settings, larger.refit.problem, larger.refit.minimum
            rng = np.random.default_rng([settings.seed, len(larger.added)])
            residual, alone = minimum.residual[: problem.bench.n_rows], smaller is larger
            noise = surrogates(residual, problem.bench, rng, smooth=alone)
            inherited = [i for i, n in enumerate(problem.names) if n in {*smaller.refit.problem.names}]
            gains = chance_gains(self.scored(smaller), minimum.jacobian[:, inherited], noise, self._white(larger))
            self._chance[smaller, larger] = float(np.quantile(gains, settings.chance))
        return self._chance[smaller, larger]

    def is_chance(self, larger: Contender, smaller: Contender, odds: Odds) -> bool:
        """Return whether chance would gain as much as a larger set does, under the model error that it leaves.

        Chance does not predict: what a set gains held out beyond the least that is asked there counts with it, as much
        as it gains in training at most.
        """
        if odds.gain >= larger.chi2:
            return False  # chance removes no more than all that is left
        rows = larger.refit.problem.bench.n_rows
        both = np.column_stack([c.refit.minimum.residual[:rows] for c in (smaller, larger)])
        before, left = np.square(self._white(larger)(both)).sum(axis=0)
        beyond = min(odds.held, odds.ahead) - HELD * self.context.settings.nats
        gain = before - left + 2 * max(min(odds.train, beyond), 0.0)
        return bool(gain <= self.chance(smaller, larger))

    def _white(self, node: Contender) -> White:
        return partial(node.white, least=self.context.least_error(node.model))


def plain(offered: Sequence[Contender]) -> list[Contender]:
    """Return those sets whose last effect could imitate no others."""
    return [c for c in offered if not any(get_effect(e).pliable for e in c.added[-1:])]


def simplest_first(offered: Sequence[Contender], beside: Contender, settings: LoopSettings) -> list[Contender]:
    """Return sets, the most likely first; of those that serve as well as it, the physically simplest come first.

    Of equally simple ones what predicts best does.
    """
    best = max((c.joint for c in offered), default=-np.inf)

    def key(contender: Contender) -> tuple[object, ...]:
        new = [e for e in contender.added if e not in beside.added]
        if not best - contender.joint < settings.nats:
            return True, -contender.joint
        simple = sorted((simplicity(e, contender.model.mechanics.system) for e in new), reverse=True)
        return False, len(new), simple, -contender.evidence.held

    return sorted(offered, key=key)
