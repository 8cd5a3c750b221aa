"""Several problems on one bench, minimised together: all residuals of a round come from one simulation call."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from discovery.least_squares import Minimum, levenberg_marquardt, minimise
from discovery.problem import Problem

__all__ = ["answer_on", "fit_problems"]

FloatArray = NDArray[np.float64]

#: Rounds of simulation are cut into pieces of about this many numbers, so that memory stays bounded.
_CHUNK = 6e7


def fit_problems(
    problems: Sequence[Problem], starts: Sequence[FloatArray], *, iterations: int = 40, on_round=None
) -> list[Minimum]:
    """Fit several problems on one bench together, all residuals of a round in one simulation call."""
    requests = [
        levenberg_marquardt(x, *p.bounds, p.scale, iterations=iterations) for p, x in zip(problems, starts, strict=True)
    ]
    return minimise(requests, answer_on(problems), on_round=on_round)


def answer_on(problems: Sequence[Problem]) -> Callable[[list[tuple[int, FloatArray]]], list[FloatArray]]:
    """Return the function by which `minimise` gets residuals of problems that share one bench."""
    bench = problems[0].bench
    width = max(64, int(_CHUNK / max(1, bench.n_rows)))

    def answer(wanted: list[tuple[int, FloatArray]]) -> list[FloatArray]:
        expanded = [problems[i].expand(x) for i, x in wanted]
        parameters = np.concatenate([p for p, _ in expanded], axis=1)
        initial = np.concatenate([s for _, s in expanded], axis=2)
        edges = np.cumsum([0, *[x.shape[1] for _, x in wanted]])
        data = np.concatenate(
            [
                bench.residuals(parameters[:, a : a + width], initial[:, :, a : a + width])
                for a in range(0, parameters.shape[1], width)
            ],
            axis=1,
        )
        return [
            np.concatenate([data[:, edges[j] : edges[j + 1]], problems[i].prior_residuals(x)])
            for j, (i, x) in enumerate(wanted)
        ]

    return answer
