"""What the catalogue offers beside a set of effects: every candidate screened and refitted, and promising pairs."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from discovery.attribution import Candidate, screen
from discovery.bench import Bench
from discovery.case import Case
from discovery.finite import finite_starts
from discovery.growing import grown
from discovery.likeness import likely_pairs
from discovery.model import Model
from discovery.node import Node
from discovery.race import SLOW, is_far_behind, near_the_best
from discovery.refits import Refit, best_of, finish, held_fixed, quickened, refit, refit_pairs, resettled_together
from discovery.registry import catalogue
from discovery.significance import chance_gains, surrogates
from discovery.simplicity import imitates
from discovery.simulate import THREADS
from discovery.stiff import unstiffened
from discovery.workers import at_once

__all__ = ["Branch", "Branches", "Child"]

#: Added effects, and the model with them.
Child = tuple[tuple[str, ...], Refit]
#: So many of the best quick refits are finished with everything free;
_FINISHED = 6
#: so many pairs that promise most to first order are refitted, and so many of them finished.
_PAIRS = 8
_BEST_PAIRS = 4
#: Systematic residual [noise sds] above which effects may be of a size at which linear starts fail.
_FAR = 3.0
#: Beside more effects than this, no other is tried on the first swings: what is left of them is hardly one effect.
_GROWN = 1


@dataclass(frozen=True)
class Branch:
    """What the catalogue offers beside one set of effects.

    Parameters
    ----------
    scored : mapping of str to Candidate
        Every candidate with its sensitivities.
    best, rest : tuple of Refit
        The best ones, with what the rig knows free, and the others; both by chi-square.
    whole, grown : bool
        Whether every candidate was refitted to the end, and whether on the first swings too, where much is left.
    pruned : bool
        Whether what stayed far behind a known set was not finished.
    """

    scored: Mapping[str, Candidate]
    best: tuple[Refit, ...]
    rest: tuple[Refit, ...]
    whole: bool = True
    grown: bool = True
    pruned: bool = False

    def children(self, added: tuple[str, ...]) -> list[Child]:
        """Return the set that it belongs to with one finished effect more, smallest chi-square first."""
        return [((*added, r.effect), r) for r in self.best]

    @property
    def refits(self) -> tuple[Refit, ...]:
        """All of them."""
        return *self.best, *self.rest


def _near(refits: Sequence[Refit], n_data: int, known: float = np.inf) -> list[Refit]:
    """Return those refits that are far behind neither the best one nor one that is known, smallest chi-square first."""
    return [refits[i] for i in near_the_best([r.chi2 for r in refits], n_data, known=known)]


def _parted(finished: Iterable[Refit], others: Iterable[Refit]) -> tuple[tuple[Refit, ...], tuple[Refit, ...]]:
    """Return the best of the finished refits, one of each effect, and all others that are not finished."""
    full = best_of(finished)
    done = {r.effect for r in full}
    return tuple(full[:_FINISHED]), (*full[_FINISHED:], *(r for r in others if r.effect not in done))


def _with_growth(made: Branch, node: Node) -> Branch:
    """Return a branch whose candidates have been tried on the first swings, too."""
    # What blew up on the whole recordings has no refit yet.
    refitted = {r.effect for r in made.refits}
    tried = [e for e in catalogue() if e in (made.scored if made.whole else refitted)]
    found = grown(node.refit.minimum, node.refit.problem, tried)
    best, rest = _parted([*made.best, *found], made.rest)
    return replace(made, best=best, rest=rest, grown=True)


class Branches:
    """The branches of one search, each made once.

    All candidates are refitted on the mechanics on which the search began; the best of them go on upon those of the set
    beside which they are tried, where these are finer.

    Parameters
    ----------
    case : Case
        Recordings, thresholds, progress.
    bench : Bench
        With the mechanics on which the search began.
    plain : bool
        Whether laws that imitate others are left out.
    """

    def __init__(self, case: Case, bench: Bench, *, plain: bool = False) -> None:
        self.case, self.bench, self.plain = case, bench, plain
        self._made: dict[frozenset[str], Branch] = {}
        self._begun: dict[Node, Node] = {}
        self._pairs: dict[Node, list[Child]] = {}
        self._gone_on: dict[tuple[Refit, str, float], Refit] = {}

    def of(
        self, node: Node, among: Collection[str] | None = None, *, grows: bool = True, known: Node | None = None
    ) -> Branch:
        """Return the branch of a set of effects: screen the catalogue and refit every candidate beside it.

        Parameters
        ----------
        node : Node
            The set.
        among : collection of str, optional
            Candidates that are refitted, if others need not be.
        grows : bool
            Whether candidates are also tried on the first swings alone, where much is left.
        known : Node, optional
            A set that is known: what stays far behind it is not finished, and does not go on upon finer mechanics.
        """
        key, bench = frozenset(node.added), node.refit.problem.bench
        made, limit = self._made.get(key), self._limit(known)
        if made is None or (np.isinf(limit) and (made.pruned or (among is None and not made.whole))):
            made = self._make(self.quick(node), among, grows, limit)
        if grows and not made.grown:
            made = _with_growth(made, self.quick(node))
        self._made[key] = made
        if all(r.problem.bench.base == bench.base for r in made.best):
            return made
        near = _near(made.best, bench.n_data, limit)
        far = [r for r in made.best if r not in near]
        return replace(made, best=tuple(self._moved(near, bench)), rest=(*far, *made.rest))

    def _limit(self, known: Node | None) -> float:
        """Return what a known set leaves on the mechanics on which candidates are compared; infinite if lost there."""
        if known is None:
            return np.inf
        quick = self.quick(known).refit
        return quick.chi2 if quick.problem.bench.base == self.bench.base else np.inf

    def _moved(self, refits: Sequence[Refit], bench: Bench) -> list[Refit]:
        """Return refits that go on upon other mechanics, each once, smallest chi-square first."""
        done = self._gone_on
        where = {r: (r, bench.base, bench.step) for r in refits}
        groups: dict[float, list[Refit]] = {}
        for r in refits:
            if where[r] not in done:
                # Where these are shorter than anywhere there, so are those.
                share = min(r.problem.bench.shortest / bench.shortest, 1.0)
                groups.setdefault(share * bench.step, []).append(r)
        for step, group in groups.items():
            moved = resettled_together(group, bench if step == bench.step else Bench.like(bench, step))
            done |= zip([where[r] for r in group], moved, strict=True)
        return best_of(done[key] for key in where.values())

    def quick(self, node: Node) -> Node:
        """Return the same set on the mechanics on which the search began, see `discovery.refits.quickened`."""
        if node not in self._begun:
            quick = quickened(node.refit, self.bench)
            self._begun[node] = node if quick is node.refit else Node.of(node.added, quick, self.case)
        return self._begun[node]

    def _make(self, node: Node, among: Collection[str] | None, grows: bool, known: float) -> Branch:
        problem, minimum = held_fixed(node.refit.problem, node.refit.minimum)
        names = self._candidates(problem.model)
        tried = names if among is None else tuple(n for n in names if n in among)
        beside = f" beside {' and '.join(node.added)}" if node.added else ""
        self.case.tell(f"screening the catalogue{beside} ({len(names)} effects)")
        scored = screen(problem.model, minimum, problem, names)
        self.case.tell(f"refitting {'every candidate' if among is None else 'what may replace another'}{beside}")
        # Where much is left, some effects are of a size at which linear starts fail.
        far, n_data = node.rough > _FAR, problem.bench.n_data

        def whole() -> tuple[list[Refit], list[Refit]]:
            starts = finite_starts(minimum, problem, tried) if far else []
            shortlist = [c for c in scored if c.effect in tried]
            quick = refit(problem.model, minimum, problem, shortlist, finite=starts, known=known)
            quick = unstiffened(problem.model, minimum, problem, shortlist, quick, known)
            near = [r for r in _near(quick, n_data) if not is_far_behind(r.chi2, known, n_data, SLOW)][:_FINISHED]
            return quick, finish(node.refit.problem, node.refit.minimum, near)

        def growing() -> tuple[list[Refit], list[Refit]]:
            return [], grown(node.refit.minimum, node.refit.problem, tried)

        # The first effect may be a ripple whose frequency the whole recording hides: there every residual deserves it.
        much = (far or (not node.added and node.rough > self.case.settings.floor)) and len(node.added) <= _GROWN
        ways = at_once([whole, growing] if grows and much else [whole], threads=THREADS)
        best, rest = _parted((r for _, found in ways for r in found), ways[0][0])
        pruned = bool(np.isfinite(known))
        every = among is None and not pruned
        return Branch({c.effect: c for c in scored}, best, rest, every, grows or not much, pruned)

    def promise(self, node: Node) -> float:
        """Return the most that a further effect would remove of chi-square to first order.

        Sensitivities are those of the mechanics on which the search began, the residual is the set's own.
        """
        begun = self.quick(node).refit
        problem, minimum = held_fixed(begun.problem, begun.minimum)
        names = self._candidates(problem.model)
        scored = screen(problem.model, minimum, problem, names, left=node.refit.minimum.residual)
        return max((c.score for c in scored), default=0.0)

    def _candidates(self, model: Model) -> tuple[str, ...]:
        return tuple(n for n in self.case.candidates(model) if not (self.plain and imitates(n)))

    def forget(self, effect: str) -> None:
        """Forget what was offered beside sets with an effect, for its values have changed."""
        self._made = {key: branch for key, branch in self._made.items() if effect not in key}
        self._pairs = {node: pairs for node, pairs in self._pairs.items() if effect not in node.added}

    def made(self, added: Sequence[str]) -> Branch | None:
        """Return the branch of a set if there is one already."""
        return self._made.get(frozenset(added))

    def below(self, effect: str, *sets: Collection[str]) -> Branch | None:
        """Return the branch of the largest subset of any of these sets beside which an effect was refitted, if any.

        Of two as large, that of the set that comes first.
        """
        whole = [frozenset(added) for added in sets]
        place = {key: i for i, added in reversed([*enumerate(whole)]) for key in self._made if key <= added}
        subsets = sorted(place, key=lambda key: (-len(key), place[key], sorted(key)))
        offers = (self._made[key] for key in subsets)
        return next((b for b in offers if b.whole and any(r.effect == effect for r in b.refits)), None)

    def children(self, beam: Sequence[Node]) -> list[Child]:
        """Return every set with one effect more, smallest chi-square first.

        Where one of them leaves noise, sets that leave more than its own without that effect are not extended.
        """
        found: dict[frozenset[str], Child] = {}
        for node in sorted(beam, key=lambda n: n.chi2):
            if self.leaves_noise(found.values()):
                break
            for added, r in self.of(node).children(node.added):
                key = frozenset(added)
                if key not in found or r.chi2 < found[key][1].chi2:
                    found[key] = added, r
        return sorted(found.values(), key=lambda child: child[1].chi2)

    def leaves_noise(self, children: Collection[Child]) -> bool:
        """Return whether one of the sets that leave least, none of its effects imitating others, leaves noise."""
        limit = min((r.chi2 for _, r in children), default=np.inf) + self.case.settings.price
        least = [(added, r) for added, r in children if r.chi2 <= limit]
        plain = [(added, r) for added, r in least if not any(map(imitates, added))]
        nodes = (Node.of(added, r, self.case) for added, r in plain)
        return any(max(node.rough, node.held_rough) <= self.case.settings.floor for node in nodes)

    def pairs(self, node: Node) -> list[Child]:
        """Return sets with two effects more that would explain the residual to first order."""
        if node not in self._pairs:
            self._pairs[node] = self._paired(node)
        return self._pairs[node]

    def _paired(self, node: Node) -> list[Child]:
        scored = list(self.of(node).scored.values())
        begun = self.quick(node).refit
        problem, minimum = held_fixed(begun.problem, begun.minimum)
        likely = likely_pairs(scored, minimum.residual, _PAIRS)
        self.case.tell("refitting pairs")
        quick = refit_pairs(problem.model, minimum, problem, likely)
        full = finish(begun.problem, begun.minimum, quick[:_BEST_PAIRS])
        if begun is not node.refit:
            bench = node.refit.problem.bench
            full = self._moved(_near(full, bench.n_data), bench)
        return [((*node.added, *r.problem.model.effects[-2:]), r) for r in full]

    def chance(self, smaller: Branch, node: Node) -> NDArray[np.float64]:
        """Return the gains that noise alone would give the best candidate beside the smaller set, sorted."""
        bench = node.refit.problem.bench
        rng = np.random.default_rng([self.case.settings.seed, len(node.added)])
        noise = surrogates(node.refit.minimum.residual[: bench.n_rows], bench, rng)
        # What every set absorbs, the new effect's own directions excepted.
        own = {p.name for p in catalogue()[node.added[-1]].parameters()}
        inherited = [i for i, n in enumerate(node.refit.problem.names) if n not in own]
        return chance_gains(list(smaller.scored.values()), node.refit.minimum.jacobian[:, inherited], noise)
