"""Candidates that the simulators do not resolve, refitted on more accurate ones.

The simulators of a search keep their tolerance for the set to which candidates are added. A candidate may ask for more:
strong damping makes the rod's ringing stiff, play knocks.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from discovery.estimation.bench import Bench
from discovery.estimation.least_squares import Minimum
from discovery.estimation.local_steps import halved_where_bent
from discovery.estimation.problem import Problem
from discovery.estimation.step_control import WORTH, cheapest, matters, more_accurate, solver_errors
from discovery.screening.attribution import Candidate
from discovery.screening.finite import declared_starts
from discovery.screening.refits import Refit, best_of, refit, settled

#: Only the best are looked at, by chi-square and by score.
_LEADING, _PROMISING = 3, 8
#: A difference of chi-square that is less than this part of how far a refit is behind does not matter.
_NEARER = 0.1
#: A refit that leaves so much more than noise may have been stopped by motions that blew up.
_MUCH = 0.01
#: Effects with more declared values than this begin at their linear starts only.
_FEW = 12


def resolved(minimum: Minimum, problem: Problem, shortlist: Sequence[Candidate], quick: Sequence[Refit]) -> list[Refit]:
    """Repeat promising refits where the error of the simulators, or a motion that blows up there, matters.

    `minimum`, `problem`, `shortlist`: as for `discovery.screening.refits.refit`. `quick`: what that found. Returned:
    smallest chi-square first.
    """
    first = {r.effect: r for r in quick}
    best, latest, done = dict(first), dict(first), set[str]()
    bench = problem.bench
    while (finer := more_accurate(bench, problem.bench)) is not None:
        asked = [e for e in _leading(best, shortlist) if e not in done]
        least = min((r.chi2 for r in best.values()), default=0.0)
        rough, blown = _unresolved({e: latest.get(e) for e in asked}, finer, least)
        done |= {*asked} - {*rough}
        if not rough:
            break
        begun = [latest[e] for e in rough if e in latest]
        bench = finer if blown else halved_where_bent(bench, [(r.problem, r.minimum.x) for r in begun])
        for r in _again(minimum, replace(problem, bench=bench), shortlist, begun, blown):
            # What blows up even so may do on simulators that are more accurate still.
            latest[r.effect], before = r, best.get(r.effect)
            if before is None or r.chi2 < before.chi2 - _worth(before, least):
                best[r.effect] = r
            else:
                done.add(r.effect)
    found = [r if r is first.get(e) else _cheaper(r, problem.bench) for e, r in best.items()]
    return sorted(found, key=lambda r: r.chi2)


def _leading(best: Mapping[str, Refit], shortlist: Sequence[Candidate]) -> list[str]:
    """Return the effects in question: best by chi-square, and best by score."""
    by_score = sorted(shortlist, key=lambda c: -c.score)
    by_chi2 = sorted(best.values(), key=lambda r: r.chi2)
    return list(dict.fromkeys([*(r.effect for r in by_chi2[:_LEADING]), *(c.effect for c in by_score[:_PROMISING])]))


def _worth(refit: Refit, least: float) -> float:
    """Return how much of chi-square matters to a refit, where `least` is what the best one leaves."""
    return max(matters(refit.chi2 - refit.problem.bench.n_data), _NEARER * (refit.chi2 - least))


def _unresolved(refits: Mapping[str, Refit | None], bench: Bench, least: float) -> tuple[list[str], list[str]]:
    """Return the effects whose refits err by what matters, and those that may have been stopped by a blow-up."""
    known = {e: r for e, r in refits.items() if r is not None}
    errors = solver_errors([(r.problem, r.minimum.x) for r in known.values()], bench)
    erring = {e for (e, r), error in zip(known.items(), errors, strict=True) if error > _worth(r, least)}
    much = {e for e, r in known.items() if r.chi2 > (1 + _MUCH) * r.problem.bench.n_data}
    blown = [e for e, r in refits.items() if r is None or (r.minimum.blown and e in much)]
    return [e for e in refits if e in erring or e in blown], blown


def _again(
    minimum: Minimum, problem: Problem, shortlist: Iterable[Candidate], begun: Sequence[Refit], blown: Sequence[str]
) -> list[Refit]:
    """Return candidates refitted on the simulators of a problem, from where they are.

    Those that blew up begin at their linear starts as well, and small.
    """
    found = settled([replace(r.problem, bench=problem.bench) for r in begun], [r.minimum.x for r in begun])
    if blown:
        once = [replace(c, starts=c.starts[:1]) for c in shortlist if c.effect in blown]
        small = declared_starts(problem, blown, _FEW)
        found += refit(minimum, problem, once, finite=small)
    return best_of(found)


def _cheaper(refit: Refit, bench: Bench) -> Refit:
    """Return the same minimum on simulators that cost less, if it is one there."""
    problem, minimum = cheapest(refit.problem, refit.minimum, bench, worth=WORTH)
    return replace(refit, problem=problem, minimum=minimum)
