"""Candidates for which the solver's step is too coarse: strong damping makes the rod's ringing stiff."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from discovery.equations.model import Model
from discovery.estimation.bench import Bench
from discovery.estimation.least_squares import Minimum
from discovery.estimation.problem import Problem
from discovery.estimation.step_control import finer
from discovery.screening.attribution import Candidate
from discovery.screening.finite import declared_starts
from discovery.screening.refits import Refit, distances, refit, resettled, settled

__all__ = ["coarsened", "unstiffened"]

#: Finer steps are tried for so many of the best by chi-square and by score,
_LEADING, _PROMISING = 3, 8
#: where the solver moves the residual by this much, and kept if they lower chi-square by as much;
_WORTH = 5.0
#: less than this part of the excess that a refit leaves is no difference either, nor less than this part of how far it
#: is behind the best one.
_LITTLE, _NEARER = 1e-2, 0.1
#: What the solver errs in the model without an effect changes nothing for the effect, nor does so many times as much.
_OWN = 3.0
#: A refit that leaves more than this part of the excess may have been stopped by a motion that blows up.
_MUCH = 0.01
#: Effects with more declared values than this begin at their linear starts only.
_FEW = 12
#: Steps are far from blowing up where so many times longer ones do not: the bare arm stands 1.4, see `choose_step`.
#: Where the set itself does not stand the first of these, its candidates are tried on less long ones.
_FARTHER = (1.25, 1.12, 1.06)
#: Steps that differ by less than this factor are the same.
_SAME = 1.01


def unstiffened(
    model: Model, minimum: Minimum, problem: Problem, shortlist: Sequence[Candidate], quick: Sequence[Refit]
) -> list[Refit]:
    """Repeat promising refits with finer steps where the solver errs: strong damping makes the rod's ringing stiff.

    Parameters
    ----------
    model, minimum, problem, shortlist
        As for `refit`.
    quick : sequence of Refit
        What `refit` found.

    Returns
    -------
    list of Refit
        Smallest chi-square first.
    """
    n = problem.bench.n_data
    best = {r.effect: r for r in quick}
    if not best:
        return []
    finest = dict(best)
    by_score = [c for c in sorted(shortlist, key=lambda c: -c.score) if c.effect in best]
    benches = {1: problem.bench}
    checked: set[str] = set()
    blown: set[str] = set()
    for times in (2, 4, 8, 16, 32):
        leading = [r.effect for r in sorted(best.values(), key=lambda r: r.chi2)[:_LEADING]]
        leading += [c.effect for c in by_score[:_PROMISING] if c.effect not in leading]
        least = min(r.chi2 for r in best.values())
        fine = finer(problem.bench, times)
        if fine is None:
            break
        benches[times] = fine
        unchecked = [e for e in leading if e not in checked]
        before = Refit("", replace(problem, bench=benches[times // 2]), minimum)
        errors = _solver_errors([before, *(finest[e] for e in unchecked)], fine)
        own = _OWN * errors.pop("")
        erring = {e for e, error in errors.items() if error > max(_worth(finest[e], least), own)}
        # A refit that leaves much may also have stopped next to where the motion blows up.
        short = [finest[e] for e in unchecked if best[e].chi2 > n + _MUCH * max(2 * minimum.cost - n, 0.0)]
        stopped = {r.effect for r in short if r.minimum.blown}
        for farther in _FARTHER if len(stopped) < len(short) else ():
            errors = _solver_errors([before, *short], fine.finer(0.5 / farther))
            if np.isfinite(errors.pop("")) or farther == _FARTHER[-1]:
                stopped |= {e for e, error in errors.items() if not np.isfinite(error)}
                break
        rough = erring | stopped | blown
        checked |= {*leading} - rough
        if not rough:
            break
        # What was refitted with half as fine steps goes on from there.
        begun = [finest[e] for e in sorted(rough) if finest[e].problem.bench is benches[times // 2] and times > 2]
        once = [replace(c, starts=c.starts[:1]) for c in shortlist if c.effect in rough - {r.effect for r in begun}]
        # What blew up from its linear start begins small.
        small = declared_starts(problem, sorted(blown), _FEW)
        found = refit(problem.model, minimum, Problem(problem.model, fine, problem.units, {}), once, finite=small)
        # Where a linear start blows up, what the longer steps found may be near the minimum of these.
        lost = [best[c.effect] for c in once if c.effect not in {r.effect for r in found}]
        on = [*begun, *lost]
        again = settled([replace(r.problem, bench=fine) for r in on], [r.minimum.x for r in on])
        asked = {r.effect: r.chi2 - _worth(r, least) for r in lost}
        found += [r for r in again if r.chi2 < asked.get(r.effect, np.inf)]
        # What blows up even so may do with steps that are finer still.
        blown = rough - {r.effect for r in found}
        for r in found:
            finest[r.effect] = r
            if r.chi2 < best[r.effect].chi2 - _worth(best[r.effect], least):
                best[r.effect] = coarsened(r, best[r.effect].problem.bench)
            else:
                checked.add(r.effect)
    return sorted(best.values(), key=lambda r: r.chi2)


def coarsened(fine: Refit, coarse: Bench) -> Refit:
    """Return the same minimum on coarser steps if it is one there, far from blowing up: finer ones cost more.

    Parameters
    ----------
    fine : Refit
        On fine steps.
    coarse : Bench
        With the longest steps that are tried, then with half of them, and half of those.
    """
    while fine.problem.bench.cost > _SAME * coarse.cost:
        longer = coarse.finer(1 / _FARTHER[0])
        # To begin with, it must be no start that blows up.
        if _is_stable(fine, coarse) and _is_stable(fine, longer):
            again = resettled(fine, coarse)
            if again.chi2 < fine.chi2 + _WORTH and _is_stable(again, longer):
                return again
        coarse = coarse.finer(2)
    return fine


def _worth(refit: Refit, least: float) -> float:
    """Return how much of chi-square is a difference to a refit, where `least` is what the best one leaves."""
    return max(_WORTH, _LITTLE * (refit.chi2 - refit.problem.bench.n_data), _NEARER * (refit.chi2 - least))


def _is_stable(refit: Refit, bench: Bench) -> bool:
    """Return whether a motion stays finite with the steps of another bench."""
    return bool(np.isfinite(_solver_errors([refit], bench)[refit.effect]))


def _solver_errors(refits: Sequence[Refit], other: Bench) -> dict[str, float]:
    """Return how far other steps move the readings of each effect, held-out ones too [noise sds, squared]."""
    errors: dict[str, float] = {}
    for bench in dict.fromkeys(r.problem.bench for r in refits):
        own = [r for r in refits if r.problem.bench is bench]
        sets = [r.problem.expand(r.minimum.x[:, None]) for r in own]
        parameters, initial = (np.concatenate(each, axis=-1) for each in zip(*sets, strict=True))
        here, there = (each.predict(parameters, initial) for each in (bench, other))
        errors |= dict(zip([r.effect for r in own], distances(bench.experiments, here, there).tolist(), strict=True))
    return errors
