"""The first part of recordings, and fits that are led from there to the whole of them.

A free run over many swings, or past many teeth, has a minimum for each that is lost or gained; over the first of them
there is one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from discovery.estimation.batch import fit_problems
from discovery.estimation.bench import Bench
from discovery.estimation.least_squares import Minimum
from discovery.estimation.problem import Problem
from discovery.foundation.arrays import FloatArray

#: Readings of the shortest part.
_LEAST = 16
#: Shares of recordings to which fits are led, one after the other, in so many steps each at most.
_SHARES, _ITERATIONS = (1 / 16, 1 / 8, 1 / 4, 1 / 2), 15
#: Noise variances a reading from which on a fit misses its recordings.
_OFF = 9.0


def beginning(problem: Problem, share: float) -> Problem:
    """Return the problem of the first part of every recording."""
    # Not what an effect held by convention that was taken out again.
    gaussian = {n: g for n, g in problem.gaussian.items() if n in problem.free}
    return replace(problem, bench=_first(problem.bench, share), gaussian=gaussian, error=None)


@lru_cache(maxsize=8)
def _first(bench: Bench, share: float) -> Bench:
    sizes = [e.recording.time[e.fitted].size for e in bench.experiments]
    counts = [min(n, max(_LEAST, int(share * n))) for n in sizes]
    experiments = [e.first(n) for e, n in zip(bench.experiments, counts, strict=True)]
    return Bench(bench.base, bench.effects, experiments, bench.step)


def led(
    problems: Sequence[Problem], starts: Sequence[FloatArray], near: Sequence[Mapping[str, tuple[float, float]]]
) -> list[FloatArray]:
    """Return starts (p,) of problems on one bench, each fitted to longer and longer first parts of the recordings.

    One whose motion blows up on a part stays where it was. `near`: what is known of each start, mean and standard
    deviation by name: the first part tells little.
    """
    known = [replace(p, gaussian={**p.gaussian, **n}) for p, n in zip(problems, near, strict=True)]
    found = list(starts)
    for share in _SHARES:
        found = [m.x if np.isfinite(m.cost) else x for m, x in zip(_fitted(known, found, share), found, strict=True)]
    return found


def from_the_beginning(problems: Sequence[Problem], minima: Sequence[Minimum]) -> dict[int, FloatArray]:
    """Return where problems on one bench with nothing free but starts are led, by number, from other minima.

    Those are led that miss the recordings where a start explains their beginning.
    """
    off = [i for i, m in enumerate(minima) if 2 * m.cost > _OFF * problems[i].bench.n_data]
    found = {i: problems[i].start({}) for i in off}
    for share in _SHARES[1:] if off else ():
        short = _fitted([problems[i] for i in found], list(found.values()), share)
        most = _OFF * _first(problems[0].bench, share).n_data
        found = {i: m.x for i, m in zip(found, short, strict=True) if 2 * m.cost < most}
        if not found:
            break
    return found


def _fitted(problems: Sequence[Problem], starts: Sequence[FloatArray], share: float) -> list[Minimum]:
    short = [beginning(p, share) for p in problems]
    return fit_problems(short, starts, iterations=_ITERATIONS, tolerance=1e-3, rough=True)
