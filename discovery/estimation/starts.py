"""Initial states of recordings that were not fitted, for given parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from discovery.estimation.batch import fit_problems
from discovery.estimation.bench import Bench
from discovery.estimation.problem import Problem

__all__ = ["fitted_states"]

FloatArray = NDArray[np.float64]
#: A state is found within so many steps.
_ITERATIONS = 12


def fitted_states(problems: Sequence[Problem]) -> list[FloatArray]:
    """Return the initial states, deflection and rate recording by recording, of problems with nothing else free.

    Where a motion blows up in one recording, those of the others are fitted all the same.
    """
    starts = [p.start({}) for p in problems]
    if not starts[0].size:
        return starts
    minima = fit_problems(problems, starts, iterations=_ITERATIONS)
    alone = len(problems[0].bench.experiments) == 1
    return [m.x if alone or np.isfinite(m.cost) else _apart(p) for p, m in zip(problems, minima, strict=True)]


def _apart(problem: Problem) -> FloatArray:
    """Return the same of one problem, each recording fitted by itself."""
    bench = problem.bench
    alone = [replace(problem, bench=Bench(bench.base, bench.effects, [e], bench.step)) for e in bench.experiments]
    return np.concatenate([fitted_states([p])[0] for p in alone])
