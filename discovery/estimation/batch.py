"""Several problems on one bench, minimised together; those give up that others have left far behind."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Sequence

import numpy as np

from discovery.estimation.least_squares import Minimum, Request, levenberg_marquardt, minimise
from discovery.estimation.problem import Problem, side_by_side
from discovery.foundation.arrays import FloatArray
from discovery.foundation.workers import in_threads
from discovery.mechanics import get_base
from discovery.simulation.simulate import THREADS

#: A quick search may be slow at first: it is out only where it leaves so many times the excess of the best one.
SLOW = 100.0
#: Nobody gives up before so many steps,
_WARM = 5
#: or without leaving so many times the excess chi-square of the one ahead,
_BEHIND = 10.0
#: or of what so many noise variances a sample would be.
_LITTLE = 0.1
#: Two starts of the same model that differ by less than this share of their excess, or by this much, have met.
_MET = 1e-3
_ALIKE = 0.1


def fit_problems(
    problems: Sequence[Problem],
    starts: Sequence[FloatArray],
    *,
    iterations: int = 40,
    tolerance: float = 1e-8,
    rough: bool = False,
    race: bool = False,
) -> list[Minimum]:
    """Fit several problems; the other arguments are those of `discovery.estimation.least_squares.levenberg_marquardt`.

    In a `race` only the best matter, and what is far behind is not followed to its minimum.
    """
    entries = Race(problems[0].bench.n_data) if race and problems else None
    requests = [
        levenberg_marquardt(
            x,
            *p.bounds,
            p.scale,
            iterations=iterations,
            tolerance=tolerance,
            rough=rough,
            is_behind=entries.enter(p.model.effects) if entries is not None else None,
        )
        for p, x in zip(problems, starts, strict=True)
    ]
    return together(problems, requests)


def together(problems: Sequence[Problem], requests: Sequence[Request]) -> list[Minimum]:
    """Run minimisations from `levenberg_marquardt`, one a problem; those on one bench share their simulation calls."""
    found: dict[int, Minimum] = {}
    for bench in dict.fromkeys(p.bench for p in problems):
        own = [i for i, p in enumerate(problems) if p.bench is bench]
        # So many blocks take the time of one, be they of two recordings: on two cores, but counted so on any number.
        base = get_base(bench.base)
        at_once = base.lanes * (base.blocks // min(2, len(bench.experiments)))
        minima = minimise([requests[i] for i in own], _answer_on([problems[i] for i in own]), at_once)
        found.update(zip(own, minima, strict=True))
    return [found[i] for i in range(len(problems))]


def _answer_on(problems: Sequence[Problem]) -> Callable[[list[tuple[int, FloatArray]]], list[FloatArray]]:
    """Return the function by which `minimise` gets residuals of problems that share one bench."""

    def answer(wanted: list[tuple[int, FloatArray]]) -> list[FloatArray]:
        sets = side_by_side([problems[i] for i, _ in wanted], [x for _, x in wanted])
        data = problems[0].bench.residuals(*sets)
        columns = np.split(data, np.cumsum([x.shape[1] for _, x in wanted])[:-1], axis=1)
        priors = [problems[i].prior_residuals(x) for i, x in wanted]
        # What a minimisation does with a trial it does with a whole column.
        found = [np.empty((len(data) + len(prior), prior.shape[1]), order="F") for prior in priors]

        def whiten(waiting: Iterator[int]) -> None:
            for j in waiting:
                problems[wanted[j][0]].whiten(columns[j], found[j][: len(data)])
                found[j][len(data) :] = priors[j]

        in_threads(whiten, len(wanted), threads=THREADS)
        return found

    return answer


def is_far_behind(chi2: float, best: float, n_data: int, behind: float = _BEHIND) -> bool:
    """Return whether a fit leaves so much more than the best one, by a factor, that its minimum does not matter."""
    return chi2 - n_data > behind * max(best - n_data, _LITTLE * n_data)


def near_the_best(chi2: Sequence[float], n_data: int, behind: float = _BEHIND) -> list[int]:
    """Return which fits are not far behind the best one, smallest chi-square first."""
    order = sorted(range(len(chi2)), key=lambda i: chi2[i])
    return [i for i in order if not is_far_behind(chi2[i], chi2[order[0]], n_data, behind)]


class Race:
    """Minimisations of which only the best matter, each a model fitted from some start.

    `n_data`: number of residuals: what noise alone leaves of chi-square. `behind`: nobody gives up without leaving so
    many times the excess chi-square of the one ahead.
    """

    def __init__(self, n_data: int, behind: float = _BEHIND) -> None:
        self._n_data, self._behind = n_data, behind
        self._ahead: dict[Hashable, tuple[float, int]] = {}
        self._entrants = 0

    def enter(self, model: Hashable) -> Callable[[float, int], bool]:
        """Return what tells a minimisation, from its cost and its number of steps, whether to give up."""
        me, self._entrants = self._entrants, self._entrants + 1

        def is_behind(cost: float, steps: int) -> bool:
            chi2 = 2 * cost
            ahead, who = self._ahead.get(model, (chi2, me))
            # Of two that are equal the first is followed.
            if chi2 < ahead or who == me:
                self._ahead[model] = chi2, me
            if steps < _WARM:
                return False
            if who != me and 0 <= chi2 - ahead < max(_ALIKE, _MET * (ahead - self._n_data)):
                return True
            return is_far_behind(chi2, min(c for c, _ in self._ahead.values()), self._n_data, self._behind)

        return is_behind
