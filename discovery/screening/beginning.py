"""The first part of recordings, and fits that are led from there to the whole of them.

A free run over many swings, or past many teeth, has a minimum for each that is lost or gained; over the first of them
there is one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from discovery.estimation.batch import fit_problems
from discovery.estimation.bench import Bench
from discovery.estimation.problem import Problem
from discovery.foundation.arrays import FloatArray

#: Readings of the shortest part.
_LEAST = 16
#: Shares of recordings to which fits are led, one after the other, in so many steps each at most.
_SHARES, _ITERATIONS = (1 / 16, 1 / 8, 1 / 4, 1 / 2), 15


def beginning(problem: Problem, share: float) -> Problem:
    """Return the problem of the first part of every recording."""
    bench = problem.bench
    counts = [max(_LEAST, int(share * e.recording.time[e.fitted].size)) for e in bench.experiments]
    experiments = [e.first(n) for e, n in zip(bench.experiments, counts, strict=True)]
    part = Bench(bench.base, bench.effects, experiments, bench.step)
    # Not what an effect held by convention that was taken out again.
    gaussian = {n: g for n, g in problem.gaussian.items() if n in problem.free}
    return Problem(problem.model, part, problem.units, gaussian)


def led(
    problems: Sequence[Problem], starts: Sequence[FloatArray], near: Sequence[Mapping[str, tuple[float, float]]]
) -> list[FloatArray]:
    """Return starts (p,) of problems on one bench, each fitted to longer and longer first parts of the recordings.

    One whose motion blows up on a part stays where it was. `near`: what is known of each start, mean and standard
    deviation by name: the first part tells little.
    """
    found = list(starts)
    for share in _SHARES if problems else ():
        part = beginning(problems[0], share).bench
        short = [Problem(p.model, part, p.units, {**p.gaussian, **n}) for p, n in zip(problems, near, strict=True)]
        minima = fit_problems(short, found, iterations=_ITERATIONS, tolerance=1e-3, rough=True)
        found = [m.x if m.cost < float("inf") else x for m, x in zip(minima, found, strict=True)]
    return found
