"""Candidates for which the solver's step is too coarse: strong damping makes the rod's ringing stiff."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from discovery.attribution import Candidate
from discovery.bench import Bench
from discovery.least_squares import Minimum
from discovery.model import Model
from discovery.problem import Problem
from discovery.refits import Refit, refit

__all__ = ["unstiffened"]

#: Finer steps are tried for so many of the best by chi-square and by score,
_LEADING = 3
#: where the solver moves the residual by this much, and kept if they lower chi-square by as much.
_WORTH = 5.0


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
    if not quick:
        return []
    best = {r.effect: r for r in quick}
    scores = {c.effect: c.score for c in shortlist}
    by_score = [c for c in sorted(shortlist, key=lambda c: -c.score) if c.effect in best]
    checked: set[str] = set()
    for finer in (2, 4, 8):
        leading = [r.effect for r in sorted(best.values(), key=lambda r: r.chi2)[:_LEADING]]
        leading += [c.effect for c in by_score[:_LEADING] if c.effect not in leading]
        fine = Problem(problem.model, Bench.like(problem.bench, problem.bench.step / finer), problem.units, {})
        # A step too coarse for the minimum may be fine where the refit got stuck, far short of its linear score.
        short = {e for e in leading if 2 * minimum.cost - best[e].chi2 < 0.5 * scores[e]}
        rough = {e for e in leading if e not in checked and (e in short or _solver_error(best[e], fine.bench) > _WORTH)}
        checked |= {*leading} - rough
        if not rough:
            break
        once = [replace(c, starts=c.starts[:1]) for c in shortlist if c.effect in rough]
        for r in refit(problem.model, minimum, fine, once):
            # Kept where it helps: the finer bench costs more from then on.
            if r.chi2 < best[r.effect].chi2 - _WORTH:
                best[r.effect] = r
    return sorted(best.values(), key=lambda r: r.chi2)


def _solver_error(r: Refit, finer: Bench) -> float:
    """Return how far a finer step moves the residual [noise sds, squared]."""
    problem = Problem(r.problem.model, finer, r.problem.units, r.problem.gaussian)
    change = finer.residuals(*problem.expand(r.minimum.x[:, None]))[:, 0] - r.minimum.residual[: finer.n_rows]
    return float(change @ change) if np.isfinite(change).all() else np.inf
