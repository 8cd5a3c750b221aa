"""A fitted set with one candidate more, each refitted: quickly, again where that errs, and the best with all free."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from discovery.estimation.batch import SLOW, near_the_best
from discovery.foundation.workers import at_once
from discovery.screening.attribution import Candidate
from discovery.screening.finite import FarStart, finite_starts
from discovery.screening.growing import grown, grows
from discovery.screening.refits import Refit, best_of, finish, held_fixed, refit
from discovery.screening.resolved import resolved
from discovery.simulation.simulate import THREADS


def refits_beside(
    fitted: Refit, scored: Sequence[Candidate], starts: Sequence[FarStart] = (), *, keep: int, far: bool, first: bool
) -> list[Refit]:
    """Return refits with one effect more and everything free, smallest chi-square first.

    `fitted`: the set. `scored`: candidates screened beside it. `starts`: of more refits. `keep`: how many of the best
    are finished. `far`: whether the set leaves more than noise, so that finite effects are tried. `first`: nothing was
    added yet.
    """
    names, known = [c.effect for c in scored], fitted.problem.gaussian
    problem, minimum = held_fixed(fitted.problem, fitted.minimum)

    def whole() -> list[Refit]:
        finite = finite_starts(minimum, problem, names, known) if far else []
        quick = refit(minimum, problem, scored, finite=[*finite, *starts])
        quick = resolved(minimum, problem, scored, quick)
        near = near_the_best([r.chi2 for r in quick], problem.bench.n_data, behind=SLOW)
        leading = [quick[i] for i in near[:keep] if np.isfinite(quick[i].chi2)]
        return [*finish(fitted.problem, leading, afresh=far), *quick]

    ways: list[Callable[[], list[Refit]]] = [whole]
    # The whole recording may hide a frequency, or be on another branch. Beside nothing a way has all threads.
    if names and grows(fitted.minimum, fitted.problem, first=first):
        ways.append(partial(grown, fitted.minimum, fitted.problem, names))
    # What the rig knows is free in those that are weighed.
    return best_of(r for found in at_once(ways, threads=THREADS) for r in found if r.problem.gaussian == known)
