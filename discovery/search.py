"""The search of the loop: which set of effects of the catalogue joins the model, and why.

A beam search: every candidate is refitted beside each of a few sets; the sets that an effect joins must pass on the
training and on the held-out recordings. What was found is then tried in reverse: every member is taken out, dropped if
it is idle, and exchanged where another effect serves better in its place.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from discovery.attribution import Candidate, candidates, likely_pairs, screen, similarity
from discovery.case import Case, Step
from discovery.fit import Fit
from discovery.node import Node, merit
from discovery.refits import Refit, finish, held_fixed, refit, refit_pairs, relaxed, unstiffened
from discovery.registry import catalogue
from discovery.significance import chance_gains, surrogates
from discovery.weighing import weigh

__all__ = ["Search"]

#: Added effects, and the model with them.
_Child = tuple[tuple[str, ...], Refit]

#: So many of the best quick refits are finished with everything free;
_FINISHED = 6
#: so many that are equally good are judged on held-out data,
_TRIED = 4
#: and so many sets are extended side by side,
_BEAM = 2
#: with so many pairs that promise most to first order;
_PAIRS = 8
#: a rival only if it leaves at most so many times what the best one leaves.
_RIVAL = 5.0
#: So many rivals of an effect are told apart from it.
_RIVALS = 2
#: Rounds of removal and exchange.
_ROUNDS = 2


@dataclass(frozen=True)
class _Branch:
    """What the catalogue offers beside one set of effects."""

    scored: Mapping[str, Candidate]
    refits: tuple[Refit, ...]


class Search:
    """Finds a set of effects, each of which explains enough of training and held-out data.

    Parameters
    ----------
    start : Fit
        The model to which effects are added.
    case : Case
        Recordings, thresholds, progress.

    Attributes
    ----------
    root, best : Node
        The start, and the set found so far.
    steps : list of Step
        The story.
    evidence, ambiguous : dict
        By added effect.
    """

    def __init__(self, start: Fit, case: Case) -> None:
        self.case = case
        whole = start.problem.bench.effects == case.kernel_effects(start.model)
        start = start if whole else case.fit(start.model, start.values, start.problem.gaussian)
        self.root = self.best = Node.of((), Refit("", start.problem, start.minimum), case)
        self.steps: list[Step] = []
        self.evidence: dict[str, dict[str, float]] = {}
        self.ambiguous: dict[str, tuple[str, ...]] = {}
        self._branches: dict[frozenset[str], _Branch] = {}

    @property
    def added(self) -> tuple[str, ...]:
        """Effects in the order in which they were added."""
        return self.best.added

    def run(self) -> None:
        """Search until both the training and the held-out residual are noise, or nothing passes."""
        self._extend()
        self._refine()
        self._conclude()

    def _quiet(self, node: Node) -> bool:
        """Return whether what a set leaves is noise, on the training and on the held-out recordings."""
        settings = self.case.settings
        return node.rough <= settings.floor and node.held_rough <= settings.limit(self.root.held_rough)

    def _extend(self) -> None:
        """Add effects, one at a time or two together, while they pass."""
        settings = self.case.settings
        beam, level = [self.best], 0
        base: Node | None = None
        while level < settings.most_effects:
            if self._quiet(self.best):
                reason = f"the training residual is noise: its systematic part is {self.best.rough:.2g} noise sds"
                self.steps.append(Step("stop", "", True, reason))
                return
            # Effects hide each other: one may help only once another is there, so a step may fail once.
            if level > len(self.best.added) and self.best.rough <= settings.floor:
                return
            if level > len(self.best.added) + 1:
                return
            level += 1
            children = self._children(beam)
            if base is not None:
                children = sorted([*children, *self._pairs(base)], key=lambda child: child[1].chi2)
            base = self.best
            ranked = self._ordered(children)
            chosen = next((node for node in ranked if self._passes(node)), None)
            if chosen is not None:
                self.best = chosen
            pursued = [node for node in self._distinct(children) if self._worth_pursuing(node)]
            beam = list(dict.fromkeys([*([chosen] if chosen else []), *pursued]))[:_BEAM]
            if not beam:
                return

    def _branch(self, node: Node) -> _Branch:
        """Screen the catalogue and refit every candidate beside a set of effects."""
        key = frozenset(node.added)
        if key not in self._branches:
            problem, minimum = held_fixed(node.refit.problem, node.refit.minimum)
            names = candidates(problem.model, self.case.train[0].recording.units[0])
            beside = f" beside {' and '.join(node.added)}" if node.added else ""
            self.case.tell(f"screening the catalogue{beside} ({len(names)} effects)")
            scored = screen(problem.model, minimum, problem, names)
            self.case.tell(f"refitting every candidate{beside}")
            quick = refit(problem.model, minimum, problem, scored)
            quick = unstiffened(problem.model, minimum, problem, scored, quick)
            full = finish(node.refit.problem, node.refit.minimum, quick[:_FINISHED])
            done = {r.effect for r in full}
            rest = [r for r in quick if r.effect not in done]
            self._branches[key] = _Branch({c.effect: c for c in scored}, (*full, *rest))
        return self._branches[key]

    def _children(self, beam: Sequence[Node]) -> list[_Child]:
        """Return every set with one effect more, smallest chi-square first."""
        found: dict[frozenset[str], _Child] = {}
        for node in beam:
            for r in self._branch(node).refits[:_FINISHED]:
                added = (*node.added, r.effect)
                key = frozenset(added)
                if key not in found or r.chi2 < found[key][1].chi2:
                    found[key] = added, r
        return sorted(found.values(), key=lambda child: child[1].chi2)

    def _pairs(self, node: Node) -> list[_Child]:
        """Return sets with two effects more that would explain the residual to first order."""
        problem, minimum = held_fixed(node.refit.problem, node.refit.minimum)
        scored = list(self._branch(node).scored.values())
        likely = likely_pairs(scored, minimum.residual, _PAIRS)
        self.case.tell("refitting pairs")
        quick = refit_pairs(problem.model, minimum, problem, likely)
        full = finish(node.refit.problem, node.refit.minimum, quick[:_TRIED])
        return [((*node.added, *r.problem.model.effects[-2:]), r) for r in full]

    def _ordered(self, children: Sequence[_Child]) -> list[Node]:
        """Return the sets that are as good as the best one, simplest first."""
        if not children:
            return []
        price, excess = self.case.settings.price, self.case.excess
        best = min((r for _, r in children), key=lambda r: r.chi2 + price * len(r.problem.free))
        share = self.case.settings.tie_pliable if _pliable(best) else self.case.settings.tie
        limit = self._tie_limit(best, share)
        tied = [(added, r) for added, r in children if r.chi2 + price * len(r.problem.free) <= limit][:_TRIED]
        nodes = [Node.of(added, r, self.case) for added, r in tied]
        least = min(n.chi2 + n.held for n in nodes)
        nodes.sort(key=lambda n: merit(n, least, price))
        if all(_pliable(n.refit) for n in nodes):
            # What a pliable law imitates deserves a try of its own, if it explains nearly all.
            enough = self.best.chi2 - self.case.settings.pair_share * excess(self.best.chi2)
            plain = [(added, r) for added, r in children if not _pliable(r) and r.chi2 < enough][:1]
            nodes += [Node.of(added, r, self.case) for added, r in plain]
        return nodes

    def _distinct(self, children: Sequence[_Child]) -> list[Node]:
        return [Node.of(added, r, self.case) for added, r in children[: _BEAM + 1]]

    def _worth_pursuing(self, node: Node) -> bool:
        """Return whether a set that is not accepted may be a step towards a better one."""
        settings, excess = self.case.settings, self.case.excess
        if len(node.added) == len(self.best.added):
            # Where hardly more than noise is left, no rival can do much better.
            return self.best.rough > settings.ceiling and excess(node.chi2) <= _RIVAL * excess(self.best.chi2)
        return self.best.chi2 - node.chi2 > settings.least_share * excess(self.best.chi2)

    def _tie_limit(self, best: Refit, share: float) -> float:
        """Return the priced chi-square up to which a refit is as good as `best`: a share more of what that leaves."""
        settings = self.case.settings
        priced = best.chi2 + settings.price * len(best.problem.free)
        idealised = settings.form * max(self.best.chi2 - best.chi2, 0.0)
        return priced + max(settings.price, share * self.case.excess(best.chi2), idealised)

    def _passes(self, node: Node) -> bool:
        """Decide whether a set replaces the best one so far, and tell the story."""
        new = tuple(e for e in node.added if e not in self.best.added)
        # Of a pair that was tried at once, the smaller set has not been screened.
        parent = self._branches.get(frozenset(node.added[:-1])) or self._branch(self.best)
        chance = self._chance(parent, node)
        verdict = weigh(self.case, self.root, self.best, node, new, chance)
        ranking = self._ranking(parent)
        for name in new:
            self.steps.append(Step("add", name, verdict.accepted, verdict.reason, verdict.numbers, ranking))
        if verdict.accepted:
            for name in (e for e in self.best.added if e not in node.added):
                self.steps.append(Step("remove", name, True, f"{' and '.join(node.added)} explain more without it"))
        return verdict.accepted

    def _chance(self, smaller: _Branch, node: Node) -> np.ndarray:
        """Return the gains that noise alone would give the best candidate beside the smaller set, sorted."""
        bench = node.refit.problem.bench
        rng = np.random.default_rng([self.case.settings.seed, len(node.added)])
        noise = surrogates(node.refit.minimum.residual[: bench.n_rows], bench, rng)
        # What every set absorbs, the new effect's own directions excepted.
        inherited = [i for i, n in enumerate(node.refit.problem.names) if not self._owned(n, node.added[-1])]
        return chance_gains(list(smaller.scored.values()), node.refit.minimum.jacobian[:, inherited], noise)

    @staticmethod
    def _owned(parameter: str, effect: str) -> bool:
        return parameter in {p.name for p in catalogue()[effect].parameters()}

    def _ranking(self, branch: _Branch) -> tuple[Mapping[str, object], ...]:
        system = self.root.refit.problem.model.mechanics.system
        return tuple(
            {
                "effect": r.effect,
                "score": branch.scored[r.effect].score,
                "chi2": r.chi2,
                "parameters": len(catalogue()[r.effect].fitted(system)),
            }
            for r in branch.refits
        )

    def _without(self, effect: str) -> Node:
        """Return the best set without one of its members, refitted."""
        rest = tuple(e for e in self.best.added if e != effect)
        if not rest:
            return self.root
        return Node.of(rest, relaxed(self.best.refit, [effect]), self.case)

    def _refine(self) -> None:
        """Take every member out: drop it if it is idle, exchange it where another serves better."""
        for _ in range(_ROUNDS):
            before = self.best.added
            for effect in before:
                if len(self.best.added) > 1 and effect in self.best.added:
                    self._retry(effect)
            if self.best.added == before:
                break

    def _retry(self, effect: str) -> None:
        smaller = self._without(effect)
        if not np.isfinite(smaller.chi2):
            return
        verdict = weigh(self.case, self.root, smaller, self.best, (effect,), None, strict=True)
        if not verdict.accepted:
            self.steps.append(Step("remove", effect, True, verdict.reason, verdict.numbers))
            self.best = smaller
            return
        ranked = self._ordered(self._children([smaller]))
        others = [n for n in ranked if n.added[-1] != effect]
        price = self.case.settings.price
        for node in others:
            gain = self.best.priced(price) - node.priced(price)
            least = max(price, self.case.settings.tie * self.case.excess(self.best.chi2))
            if gain > least and node.held < self.best.held:
                reason = f"in its place {node.added[-1]} lowers chi-square by {gain:.0f} more"
                numbers = {"chi2_before": self.best.chi2, "chi2_after": node.chi2}
                self.steps.append(Step("exchange", effect, True, reason, numbers, self._ranking(self._branch(smaller))))
                self.best = node
                return

    def rivals(self) -> dict[str, dict[str, Refit]]:
        """Return, for each added effect that others explain as well, the refits with those in its place."""
        found = {}
        for effect, names in self.ambiguous.items():
            if names:
                branch = self._branch(self._without(effect))
                found[effect] = {r.effect: r for r in branch.refits if r.effect in names[:_RIVALS]}
        return found

    def _conclude(self) -> None:
        """Withdraw what does not explain enough of an unexplained residual; collect the evidence of the rest."""
        settings = self.case.settings
        if self.best.added and self.best.held_rough > settings.limit(self.root.held_rough):
            kept = self.case.excess(self.best.chi2) / max(self.case.excess(self.root.chi2), 1e-300)
            held = self.case.held_excess(self.best.held) / max(self.case.held_excess(self.root.held), 1e-300)
            if max(kept, held) > settings.least_known:
                reason = (
                    f"what is left is not noise, and {100 * max(kept, held):.0f} % of the excess chi-square is still "
                    "there: no effect of the catalogue is named"
                )
                self.steps += [Step("withdraw", e, True, reason) for e in self.best.added]
                self.best = self.root
        for effect in self.best.added:
            self._collect(effect)

    def _collect(self, effect: str) -> None:
        """Compute the evidence of one effect against the set without it."""
        smaller = self._without(effect)
        branch = self._branch(smaller)
        node = Node((*smaller.added, effect), self.best.refit, self.best.rough, self.best.held, self.best.held_rough)
        chance = self._chance(branch, node)
        gain, held_gain = smaller.chi2 - node.chi2, smaller.held - node.held
        excess = self.case.excess(smaller.chi2)
        others = [r for r in branch.refits if r.effect != effect]
        # However many parameters they have: what explains as well cannot be told apart by these recordings.
        share = self.case.settings.tie * self.case.excess(self.best.chi2)
        limit = self.best.chi2 + max(self.case.settings.price, share, self.case.settings.form * gain)
        tied = tuple(r.effect for r in others if r.chi2 <= limit)
        own = branch.scored[effect]
        likeness = {c.effect: similarity(own.sensitivity, c.sensitivity) for c in branch.scored.values()}
        likeness.pop(effect)
        moved = [a - b for a, b in zip(smaller.refit.predict(), node.refit.predict(), strict=True)]
        self.ambiguous[effect] = tied
        self.evidence[effect] = {
            "delta_chi2_train": gain,
            "delta_chi2_holdout": held_gain,
            "share_of_excess": gain / excess if excess else 0.0,
            "share_of_residual_power": gain / smaller.chi2,
            "effect_rms": float(np.sqrt(np.mean(np.concatenate([np.sum(m**2, axis=1) for m in moved])))),
            "chance_gain_99": float(np.quantile(chance, 0.99)),
            "p_value": float((1 + np.sum(chance >= gain)) / (1 + chance.size)),
            "runner_up_delta_chi2": smaller.chi2 - min((r.chi2 for r in others), default=smaller.chi2),
            "linear_score": own.score,
            "largest_similarity": max(likeness.values(), default=0.0),
        }
        for other in tied:
            self.evidence[effect][f"similarity_{other}"] = likeness.get(other, 0.0)


def _pliable(refitted: Refit) -> bool:
    return catalogue()[refitted.effect].pliable
