"""The search of the loop: which set of effects of the catalogue joins the model, and why.

A beam search: every candidate is refitted beside each of a few sets; the sets that an effect joins must pass on the
training and on the held-out recordings. What was found is then tried in reverse: every member is taken out, dropped if
it is idle, and exchanged where another effect serves better in its place.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from discovery.bench import Bench
from discovery.branch import Branch, Branches, Child
from discovery.case import Case, Step
from discovery.fit import Fit
from discovery.node import Node
from discovery.ordering import better, helps, ordered
from discovery.race import is_far_behind
from discovery.refits import Refit, reduced, relaxed, resettled
from discovery.registry import catalogue
from discovery.simplicity import imitates
from discovery.simulate import THREADS
from discovery.standing import evidence, rivals
from discovery.stiff import coarsened, resolved, shortened
from discovery.weighing import Verdict, determined, is_needed, weigh
from discovery.workers import at_once

__all__ = ["Search"]

FloatArray = NDArray[np.float64]
#: So many sets are extended side by side, of sets of two or more one:
_BEAM = (2, 1)
#: a rival only if it leaves at most so many times what the best one leaves.
_RIVAL = 2.0
#: A set that leaves much is not extended on steps that are shorter than those of the start by more than this.
_FINE = 6.0
#: A set that leaves a larger systematic residual [noise sds], and much of the excess, lacks more than finer mechanics.
_FAR = 3.0
#: So many rivals of an effect are told apart from it.
_RIVALS = 2
#: Rounds of removal and exchange.
_ROUNDS = 2
#: What beside fewer others leaves so many times what an effect does there cannot take its place.
_FAR_MORE = 10.0
#: Where more than this share of the excess is left, neither finer mechanics nor another effect in the place of one is
#: what is missing.
_MUCH_LEFT = 0.1
#: A member may remove the solver's error only if that is more than this share of what it removes.
_SOLVER = 0.1


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
    least : float
        Chi-square that the set found at last leaves, also where none of its effects is named.
    """

    def __init__(self, start: Fit, case: Case) -> None:
        self.case = case
        whole = start.problem.bench.effects == case.kernel_effects(start.model)
        start = start if whole else case.fit(start.model, start.values, start.problem.gaussian)
        self.steps: list[Step] = []
        self.evidence: dict[str, dict[str, float]] = {}
        self.ambiguous: dict[str, tuple[str, ...]] = {}
        self._branches = Branches(case, start.problem.bench)
        self._smaller: dict[tuple[Node, str], Node] = {}
        self._stood_for: dict[str, str] = {}
        self._verdicts: dict[tuple[Node, str], tuple[Verdict, Node, Node]] = {}
        self._finer: dict[Node, Refit] = {}
        self._finest: dict[Node, tuple[Fit, list[FloatArray]]] = {}
        self._noise: dict[Node, bool] = {}
        self.root = Node.of((), Refit("", start.problem, start.minimum), case)
        self.root = self._take(self.root)
        self.least = self.root.chi2

    @property
    def bench(self) -> Bench:
        """Recordings and mechanics on which the search began."""
        return self._branches.bench

    @property
    def added(self) -> tuple[str, ...]:
        """Effects in the order in which they were added."""
        return self.best.added

    @property
    def settled(self) -> bool:
        """Whether what is left of the recordings is noise by the test of the verdict."""
        first = self.root.rough, self.root.held_rough
        if self.best not in self._finest:
            limits = self.case.limits(self.best.refit.problem.model, first)
            return self.best.rough <= limits[0] and self.best.held_rough <= limits[1]
        if self.best not in self._noise:
            self._noise[self.best] = self.case.is_noise(*self._finest[self.best], first)[0]
        return self._noise[self.best]

    def finest(self) -> tuple[Fit, list[FloatArray]]:
        """Return the set found, fitted on the finest mechanics, and its predictions of the held-out recordings."""
        if self.best not in self._finest:
            fitted = self.case.finest(self._finer.get(self.best, self.best.refit))
            self._finest[self.best] = fitted, self.case.held(fitted)
        return self._finest[self.best]

    def run(self, rival: float = np.inf) -> None:
        """Search until both the training and the held-out residual are noise, or nothing passes.

        Parameters
        ----------
        rival : float
            What another search leaves of chi-square: this one ends where a further effect leaves far more, or where its
            effects do not leave noise.
        """
        self._extend(rival)
        self.least = self.best.chi2
        if np.isfinite(rival):
            self._judge()
            if not self.settled:
                return
        self._reverse()
        if self._distrusts():
            self._extend(rival)
            self._reverse()
        self._simplify()
        self.least = self.best.chi2
        self._conclude()

    def _reverse(self) -> None:
        """Try in reverse what was found."""
        self._refine()
        self._judge()

    def _judge(self) -> None:
        """Judge what leaves little on the finest mechanics: it may be the error of those of the search."""
        if self.best.added and not self.settled and self._leaves_little():
            self.finest()

    def _extend(self, rival: float = np.inf) -> None:
        """Add effects, one at a time or two together, while they pass and leave not far more than a rival."""
        settings = self.case.settings
        beam, level = [self.best], 0
        base: Node | None = None
        while level < settings.most_effects:
            if self.best.rough <= settings.floor and self.settled:
                reason = f"the training residual is noise: its systematic part is {self.best.rough:.2g} noise sds"
                self.steps.append(Step("stop", "", True, reason))
                return
            # Effects hide each other: one may help only once another is there, so a step may fail once.
            if level > len(self.best.added) and self.best.rough <= settings.floor:
                return
            if level > len(self.best.added) + 1:
                return
            level += 1
            children = [] if base is None else self._branches.pairs(base)
            base = self.best
            # Where a pair leaves noise, no set need be extended, unless it is refused.
            tried = children if self._branches.leaves_noise(children) else []
            chosen = self._chosen(tried)
            if chosen is None:
                refused = {id(r) for _, r in tried}
                vain = self._is_vain()
                more = [] if vain else self._branches.children(beam)
                children = sorted([*more, *children], key=lambda child: child[1].chi2)
                if children and is_far_behind(children[0][1].chi2, rival, self.case.n_data):
                    return
                chosen = self._chosen([child for child in children if id(child[1]) not in refused])
                if vain and chosen is None:
                    self.steps.append(Step("stop", "", True, vain))
                    return
            if chosen is not None and not base.added and self._leads_back(chosen):
                beam, level, base = [self.best], 0, None
                continue
            if chosen is not None:
                chosen = self._take(chosen)
                # What has been found again is a better base than what it was before.
                base = chosen if {*chosen.added} == {*base.added} else base
            beam = [chosen] if chosen else []
            wide = _BEAM[min(level, len(_BEAM)) - 1]
            if len(beam) < wide:
                beam += [node for node in self._leading(children, beam) if self._worth_pursuing(node)]
            if not beam or self._is_costly(self.best):
                return
            beam = [n for n in beam if self._leads_on(n)][:wide]
            beam = [n if n is self.best else self._resolved(n) for n in beam]

    def _is_vain(self) -> str:
        """Return why no effect more need be refitted beside the best set, if so: none promises to pass in training."""
        if not self.best.added or self.best.rough > self.case.settings.floor:
            return ""
        promise = self._branches.promise(self.best)
        if promise >= self.case.settings.least_gain:
            return ""
        told = f"no further effect would remove more than {promise:.2g} of chi-square to first order"
        return f"the training residual is noise, the held-out one is not, and {told}"

    def _chosen(self, children: Sequence[Child]) -> Node | None:
        """Return the first set that replaces the best one so far, in the order of `ordered`, idle effects left out."""
        for node in ordered(self.case, self.best, children):
            if self._passes(node):
                return node
            lean = self._without_idle(node)
            if lean is None:
                continue
            if {*lean.added} == {*self.best.added}:
                if self._renew(self.best.added[-1], lean):
                    return self.best
            elif self._passes(lean):
                return lean
        return None

    def _without_idle(self, node: Node) -> Node | None:
        """Return a set without those new effects that it leaves undetermined, if that is more than was known."""
        if len(node.added) == 1:
            return None
        new = [e for e in node.added if e not in self.best.added]
        idle = [e for e in new if not determined(node, e)]
        rest = tuple(e for e in node.added if e not in idle)
        if not idle or not rest:
            return None
        # They may have led the others to a minimum that these did not find alone.
        lean = relaxed(node.refit, idle)
        known = self.best.chi2
        if idle != new:
            branch = self._branches.made(rest[:-1])
            known = min([r.chi2 for r in branch.refits if r.effect == rest[-1]] if branch else [], default=np.inf)
        return Node.of(rest, lean, self.case) if lean.chi2 < known - self.case.settings.price else None

    def _leads_back(self, node: Node) -> bool:
        """Begin anew where a first set shows that the fit of the start had stopped short of its best minimum."""
        bare = coarsened(relaxed(node.refit, node.added), self.root.refit.problem.bench)
        gain = self.root.chi2 - bare.chi2
        # Less than what is asked of an effect is not worth another search.
        if not (gain > self.case.settings.price and helps(self.case, self.best, bare)):
            return False
        again = Node.of((), replace(bare, effect=""), self.case)
        if not again.held < self.root.held:
            return False
        reason = f"fitted again from there without it, the start leaves {gain:.0f} less than before"
        numbers = {"chi2_before": self.root.chi2, "chi2_after": again.chi2}
        self.steps += [Step("withdraw", e, True, reason, numbers) for e in node.added]
        self._forget(plain=self._branches.plain)
        self.root = self._take(again)
        return True

    def _forget(self, *, plain: bool) -> None:
        """Forget what was tried: what follows is tried anew, without laws that imitate others if it is to be plain."""
        self._branches = Branches(self.case, self.bench, plain=plain)
        self._stood_for, self._smaller, self._verdicts = {}, {}, {}

    def _leading(self, children: Sequence[Child], besides: Sequence[Node]) -> list[Node]:
        """Return the best sets that are not among those already taken."""
        taken = {frozenset(node.added) for node in besides}
        leading = [(added, r) for added, r in children[: max(_BEAM) + 1] if frozenset(added) not in taken]
        return [Node.of(added, r, self.case) for added, r in leading]

    def _worth_pursuing(self, node: Node) -> bool:
        """Return whether a set that is not accepted may be a step towards a better one."""
        settings, excess = self.case.settings, self.case.excess
        if len(node.added) == len(self.best.added):
            # Where hardly more than noise is left, no rival can do much better.
            return self.best.rough > settings.ceiling and excess(node.chi2) <= _RIVAL * excess(self.best.chi2)
        return helps(self.case, self.best, node.refit)

    def _leads_on(self, node: Node) -> bool:
        """Return whether a set is a step towards more than a pair: one that fails on the held-out recordings is not."""
        smaller = self.best if len(node.added) > len(self.best.added) else self.root
        return node.held < smaller.held and not self._is_costly(node)

    def _is_costly(self, node: Node) -> bool:
        """Return whether a set asks for far finer steps than the start, and yet leaves too much for a name."""
        here, start = (n.refit.problem.bench for n in (node, self.root))
        finer = here.base == start.base and _FINE * here.step < start.step
        return finer and self._left(node) > self.case.settings.least_known

    def _passes(self, node: Node) -> bool:
        """Decide whether a set replaces the best one so far, and tell the story."""
        new = tuple(e for e in node.added if e not in self.best.added)
        # Of a pair that was tried at once, the smaller set has not been screened, but the one without both.
        made = (self._branches.made(node.added[:-n]) for n in (1, 2))
        parent = next((branch for branch in made if branch), None) or self._branches.of(self.best)
        chance = self._branches.chance(parent, node)
        verdict = weigh(self.case, self.root, self.best, node, new, chance)
        ranking = self._ranking(parent)
        for name in new:
            self.steps.append(Step("add", name, verdict.accepted, verdict.reason, verdict.numbers, ranking))
        if verdict.accepted:
            for name in (e for e in self.best.added if e not in node.added):
                self.steps.append(Step("remove", name, True, f"{' and '.join(node.added)} explain more without it"))
        return verdict.accepted

    def _ranking(self, branch: Branch) -> tuple[Mapping[str, object], ...]:
        system = self.root.refit.problem.model.mechanics.system
        return tuple(
            {
                "effect": r.effect,
                "score": branch.scored[r.effect].score,
                "chi2": r.chi2,
                "parameters": len(catalogue()[r.effect].fitted(system)),
            }
            for r in sorted(branch.refits, key=lambda r: r.chi2)
        )

    def _without(self, effect: str) -> Node:
        """Return the best set without one of its members, refitted."""
        rest = tuple(e for e in self.best.added if e != effect)
        start, bench = self.root.refit, self.best.refit.problem.bench
        alike = start.problem.bench.base == bench.base
        if alike and not rest:
            return self.root
        key = self.best, effect
        if key not in self._smaller:
            carried = bool(rest) and not determined(self.best, effect)
            # Finer mechanics go on from quicker ones.
            whole = self.best if alike else self._branches.quick(self.best)
            smaller = relaxed(whole.refit, [effect], carried=carried) if rest else start
            if not np.isfinite(smaller.chi2) and whole is not self.best:
                smaller = relaxed(self.best.refit, [effect], carried=carried)
            if smaller.problem.bench.base != bench.base:
                smaller = resettled(smaller, bench)
            # The steps may have been as fine as the effect alone needs.
            smaller = coarsened(smaller, start.problem.bench) if alike else smaller
            self._smaller[key] = Node.of(rest, smaller, self.case)
        return self._smaller[key]

    def _resolved(self, node: Node) -> Node:
        """Return a set on finer mechanics where much of what it leaves is the error of quicker ones."""
        settings = self.case.settings
        if max(node.rough, node.held_rough) <= settings.floor:
            return node
        if node.rough > _FAR and self._left(node) > _MUCH_LEFT:
            return node
        least = max(settings.price, settings.least_share * self.case.excess(node.chi2))
        if node not in self._finer:
            self._finer[node] = self.case.finer(node.refit, least)
        finer = self._finer[node]
        return Node.of(node.added, finer, self.case) if finer.chi2 < node.chi2 - least else node

    def _take(self, node: Node) -> Node:
        """Make a set the best one, on mechanics that resolve it, and return it."""
        self.best = self._resolved(node)
        if self.best is not node:
            error, excess = node.chi2 - self.best.chi2, self.case.excess(node.chi2)
            reason = f"of {excess:.0f} excess chi-square {error:.0f} is the error of quicker mechanics"
            numbers = {
                "chi2_before": node.chi2,
                "chi2_after": self.best.chi2,
                "chi2_holdout_before": node.held,
                "chi2_holdout_after": self.best.held,
                "n_holdout": float(self.case.n_held),
            }
            self.steps.append(Step("refine", "", True, reason, numbers))
        return self.best

    def _contenders(self, effect: str) -> frozenset[str] | None:
        """Return what may serve in the place of a member: all but what left far more beside fewer; None for all."""
        smaller = self._without(effect).added
        # What a member has replaced did much the same: others beside it tell of others beside the member.
        replaced = [self._stood_for.get(e, e) for e in smaller]
        below = self._branches.below(effect, smaller, replaced)
        if below is None:
            return None
        left = {r.effect: r.chi2 for r in below.refits}
        limit = self.best.chi2 + _FAR_MORE * max(left[effect] - self.best.chi2, self.case.margin(self.best.chi2))
        # What a member may have become beside the others was no rival of the whole law.
        near = catalogue()[effect].reduces_to
        return frozenset(e for e in {*below.scored, *replaced} if left.get(e, 0.0) <= limit or e in near)

    def _in_place_of(self, effect: str) -> Branch:
        """Return what the catalogue offers beside the best set without one of its members."""
        return self._offered(self._without(effect), self._contenders(effect))

    def _offered(self, node: Node, among: Collection[str] | None) -> Branch:
        """Return what may serve in the place of a member; where nothing better is needed, its whole fits will do."""
        settled = self.settled
        return self._branches.of(node, among, grows=not settled, known=self.best if settled else None)

    def _refine(self) -> None:
        """Take every member out: drop it if it is idle, exchange it where another serves better."""
        for _ in range(_ROUNDS):
            before = self.best.added
            for effect in before:
                self._reduce(effect)
            members = self.best.added
            if len(members) > 1:
                self._foresee()
            # What is idle is taken out before others are tried beside it.
            for effect in sorted(members, key=lambda e: len(members) > 1 and self._weighed(e)[0].accepted):
                if len(self.best.added) > 1 and effect in self.best.added:
                    self._retry(effect)
            if self.best.added == before:
                break

    def _foresee(self) -> None:
        """Make side by side what `_retry` will ask for, one member after the other."""
        members = self.best.added
        # Each of them asks for it.
        self._branches.quick(self.best)
        smaller = at_once([partial(self._without, e) for e in members], threads=THREADS)
        known = all(np.isfinite(node.chi2) for node in smaller)
        if not known or self._left(self.best) > _MUCH_LEFT or not all(self._weighed(e)[0].accepted for e in members):
            return
        offers = [(node, self._contenders(e)) for node, e in zip(smaller, members, strict=True)]
        at_once([partial(self._offered, node, among) for node, among in offers], threads=THREADS)

    def _weighed(self, effect: str) -> tuple[Verdict, Node, Node]:
        """Decide whether a member is more than idle, and return the sets without and with it that were compared.

        What the solver errs is no effect: both are on steps as short as the smaller one needs.
        """
        key = self.best, effect
        if key not in self._verdicts:
            smaller, whole = self._without(effect), self.best
            if np.isfinite(smaller.chi2):
                least = max(self.case.settings.price, _SOLVER * (smaller.chi2 - whole.chi2))
                fine = resolved(smaller.refit, least)
                smaller = smaller if fine is smaller.refit else Node.of(smaller.added, fine, self.case)
                whole = self._on_steps_of(smaller)
            verdict = weigh(self.case, self.root, smaller, whole, (effect,), None, strict=True)
            self._verdicts[key] = verdict, smaller, whole
        return self._verdicts[key]

    def _on_steps_of(self, node: Node) -> Node:
        """Return the best set on the steps of another where these are shorter and it leaves less there."""
        again = shortened(self.best.refit, node.refit.problem.bench)
        return self.best if again is self.best.refit else Node.of(self.best.added, again, self.case)

    def _reduce(self, effect: str) -> None:
        """Let a simpler law take the place of a member that has become it."""
        for node in self._simpler(effect):
            if reason := better(self.case, self.best, node):
                self._exchange(effect, self.best, node, reason)
                return

    def _exchange(
        self, effect: str, best: Node, node: Node, reason: str, ranking: Sequence[Mapping[str, object]] = ()
    ) -> None:
        """Make a set the best one in which another effect has taken the place of a member."""
        numbers = {"chi2_before": best.chi2, "chi2_after": node.chi2}
        self.steps.append(Step("exchange", effect, True, reason, numbers, tuple(ranking)))
        self._stood_for[node.added[-1]] = effect
        self._take(node)

    def _simpler(self, effect: str) -> list[Node]:
        """Return sets with a simpler law in the place of a member, from its values: screening may not find them."""
        rest = tuple(e for e in self.best.added if e != effect)
        others = self.best.refit.problem.model.without([effect])
        near = sorted(catalogue()[effect].reduces_to.intersection(self.case.candidates(others)))
        nodes = [Node.of((*rest, e), reduced(self.best.refit, effect, e), self.case) for e in near]
        return [node for node in nodes if np.isfinite(node.chi2)]

    def _retry(self, effect: str) -> None:
        smaller = self._without(effect)
        if not np.isfinite(smaller.chi2):
            return
        verdict, without, _ = self._weighed(effect)
        if not verdict.accepted:
            self.steps.append(Step("remove", effect, True, verdict.reason, verdict.numbers))
            self._take(without)
            return
        if self._left(self.best) > _MUCH_LEFT:
            return
        branch = self._in_place_of(effect)
        children = branch.children(smaller.added)
        again = next((r for added, r in children if added[-1] == effect), None)
        if again is not None:
            self._renew(effect, Node.of(self.best.added, again, self.case))
        ranked = ordered(self.case, self.best, children)
        others = [n for n in ranked if n.added[-1] != effect]
        for node in others:
            if not better(self.case, self.best, node):
                continue
            best = self._on_steps_of(node)
            if reason := better(self.case, best, node):
                self._exchange(effect, best, node, reason, self._ranking(branch))
                return

    def _renew(self, effect: str, again: Node) -> bool:
        """Take another minimum of the same set: what an effect was beside fewer others may have been a local one."""
        price = self.case.settings.price
        best = self._on_steps_of(again) if again.chi2 < self.best.chi2 - price else self.best
        gain = best.chi2 - again.chi2
        better = gain > price and again.held < best.held
        if better:
            reason = f"found again beside the others it lowers chi-square by {gain:.0f} more"
            numbers = {"chi2_before": best.chi2, "chi2_after": again.chi2}
            self.steps.append(Step("renew", effect, True, reason, numbers))
            self._take(again)
            self._branches.forget(effect)
        return better

    def _simplify(self) -> None:
        """Let a simpler law take the place of one that is not needed once what both hold by convention is free.

        Held, friction that turns within another speed looks like one with a peak.
        """
        for effect in self.best.added:
            if not self.case.conventions(self.best.refit.problem.model):
                continue
            for node in self._simpler(effect):
                here, there = self._unfixed(self.best), self._unfixed(node)
                if is_needed(self.case, self.root, there, here):
                    continue
                more = there.chi2 - here.chi2
                reason = f"in its place {node.added[-1]}, its conventions free, leaves {more:.0f} more only"
                numbers = {"chi2_before": here.chi2, "chi2_after": there.chi2}
                self.steps.append(Step("exchange", effect, True, reason, numbers))
                self._take(node)
                self.finest()
                break

    def _unfixed(self, node: Node) -> Node:
        """Return a set with what its laws hold by convention free."""
        fitted = self.case.finished(node.refit)
        return Node.of(node.added, Refit(node.refit.effect, fitted.problem, fitted.minimum), self.case)

    def rivals(self) -> dict[str, dict[str, Refit]]:
        """Return, for each added effect that others explain as well, the refits with those in its place."""
        found = {}
        for effect, names in self.ambiguous.items():
            if names:
                branch = self._in_place_of(effect)
                found[effect] = {r.effect: r for r in branch.refits if r.effect in names[:_RIVALS]}
        return found

    def _conclude(self) -> None:
        """Withdraw what does not explain enough of an unexplained residual; collect the evidence of the rest."""
        if self.best.added and not self.settled:
            self._withdraw()
        for effect in self.best.added:
            branch = self._in_place_of(effect)
            _, smaller, whole = self._weighed(effect)
            tied = self.ambiguous[effect] = rivals(self.case, branch, smaller, self.best, effect)
            whole = whole.with_last(effect)
            chance = self._branches.chance(branch, whole)
            self.evidence[effect] = evidence(self.case, branch, smaller, whole, effect, tied, chance)

    def _distrusts(self) -> bool:
        """Begin again without the laws that imitate others, and say so, where these leave little but not noise."""
        imitating = [e for e in self.best.added if imitates(e)]
        if self.settled or not imitating or not self._leaves_little():
            return False
        for effect in imitating:
            reason = f"what is left is not noise, and {effect} may imitate what nobody declared"
            self.steps.append(Step("withdraw", effect, True, reason))
        self.best = self.root
        self._forget(plain=True)
        return True

    def _leaves_little(self) -> bool:
        """Return whether the best set leaves so little that another way to it may be what is missing."""
        left, settings = self._left(self.best), self.case.settings
        return left <= settings.least_known or (left <= _MUCH_LEFT and self.best.rough <= settings.ceiling)

    def _left(self, node: Node) -> float:
        """Return the share of the excess chi-square in training that a set leaves."""
        return self.case.excess(node.chi2) / max(self.case.excess(self.root.chi2), 1e-300)

    def _withdraw(self) -> None:
        """Take everything back where too much is left for a name to be more than a guess."""
        case, left = self.case, self._left(self.best)
        ahead = case.held_excess(self.best.held) / max(case.held_excess(self.root.held), 1e-300)
        if left > case.settings.least_known or ahead > case.settings.least_foreseen:
            shares = f"{100 * left:.2g} % of the excess chi-square, {100 * ahead:.2g} % on the held-out ones"
            reason = f"what is left is not noise but {shares}"
            self.steps += [Step("withdraw", e, True, f"{reason}: no effect is named") for e in self.best.added]
            self.best = self.root
