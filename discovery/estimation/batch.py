"""Several problems on one bench, minimised together: all residuals of a round come from one simulation call."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from discovery.estimation.least_squares import Minimum, Request, levenberg_marquardt, minimise
from discovery.estimation.problem import Problem
from discovery.estimation.race import Race
from discovery.foundation.arrays import FloatArray

#: Residuals that are whitened at once.
_TOGETHER = 4e6


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
        # Two blocks take the time of one, be it of two recordings: on two cores, but counted so on any number.
        at_once = bench.simulators[0].kernel.lanes * max(1, 2 // len(bench.experiments))
        minima = minimise([requests[i] for i in own], _answer_on([problems[i] for i in own]), at_once)
        found.update(zip(own, minima, strict=True))
    return [found[i] for i in range(len(problems))]


def _answer_on(problems: Sequence[Problem]) -> Callable[[list[tuple[int, FloatArray]]], list[FloatArray]]:
    """Return the function by which `minimise` gets residuals of problems that share one bench."""

    def answer(wanted: list[tuple[int, FloatArray]]) -> list[FloatArray]:
        expanded = [problems[i].expand(x) for i, x in wanted]
        parameters = np.concatenate([p for p, _ in expanded], axis=1)
        initial = np.concatenate([s for _, s in expanded], axis=2)
        edges = np.cumsum([0, *[x.shape[1] for _, x in wanted]])
        data = problems[0].bench.residuals(parameters, initial)
        found = []
        for j, (i, x) in enumerate(wanted):
            prior = problems[i].prior_residuals(x)
            # What a minimisation does with a trial it does with a whole column.
            own = np.empty((len(data) + len(prior), x.shape[1]), order="F")
            own[len(data) :] = prior
            # A few columns of a long recording at a time: whitening takes several times their memory.
            together = max(1, int(_TOGETHER / max(1, len(data))))
            for first in range(0, x.shape[1], together):
                some = slice(edges[j] + first, min(edges[j] + first + together, edges[j + 1]))
                own[: len(data), first : first + together] = problems[i].whitened(data[:, some])
            found.append(own)
        return found

    return answer
