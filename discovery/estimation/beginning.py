"""The first part of recordings, and fits that are led from there to the whole of them.

A free run over many swings, or past many teeth, has a minimum for each that is lost or gained; over the first of them
there is one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from discovery.declarations.registry import get_effect
from discovery.estimation.batch import fit_problems
from discovery.estimation.bench import Bench
from discovery.estimation.least_squares import Minimum
from discovery.estimation.problem import Problem
from discovery.foundation.arrays import BoolArray, FloatArray

#: Readings of the shortest part.
_LEAST = 16
#: Shares of recordings to which fits are led, one after the other, in so many steps each at most. Two numbers of a
#: start need no part as short as the first.
_SHARES, _ITERATIONS = (1 / 16, 1 / 8, 1 / 4, 1 / 2), 15
#: Noise variances a reading from which on a fit misses a recording.
_OFF = 9.0


def beginning(problem: Problem, share: float) -> Problem:
    """Return the problem of the first part of every recording."""
    return _on([problem], _first(problem.bench, share))[0]


def lead(
    problems: Sequence[Problem],
    starts: Sequence[FloatArray],
    near: Sequence[Mapping[str, tuple[float, float]]] | None = None,
) -> list[FloatArray]:
    """Return starts (p,) of problems on one bench, each fitted to longer and longer first parts of the recordings.

    One whose motion blows up on a part stays where it was. `near`: what is known of each start, mean and standard
    deviation by name: the first part tells little.
    """
    if near is not None:
        problems = [replace(p, gaussian={**p.gaussian, **n}) for p, n in zip(problems, near, strict=True)]
    found = list(starts)
    for share in _SHARES if problems else ():
        minima = _fitted(problems, found, _first(problems[0].bench, share))
        found = [m.x if np.isfinite(m.cost) else x for m, x in zip(minima, found, strict=True)]
    return found


def from_declared(problem: Problem, values: Mapping[str, float], added: Sequence[str]) -> FloatArray:
    """Return the declared start of a problem (p,), with the `values` that some effects have, led to the whole."""
    own = {p.name for e in added for p in get_effect(e).parameters()}
    return lead([problem], [problem.start({n: v for n, v in values.items() if n in own})])[0]


def missed(bench: Bench, minima: Sequence[Minimum]) -> BoolArray:
    """Return which recordings of a bench all of some fits miss."""
    off = np.ones(len(bench.experiments), bool)
    for m in minima:
        off &= [not np.sum(m.residual[rows] ** 2) <= _OFF * np.sum(present) for rows, present in bench.blocks()]
    return off


def from_the_beginning(
    problems: Sequence[Problem], starts: Sequence[FloatArray], off: Sequence[BoolArray]
) -> dict[int, FloatArray]:
    """Return where the starts of recordings are led that fits missed, by the number of their problem.

    `problems`: on one bench, with nothing free but starts. `off`: of each, which recordings are missed. It is led as
    long as a start explains the beginning of one of them.
    """
    found = {i: x for i, x in enumerate(starts) if off[i].any()}
    for share in _SHARES[1:] if found else ():
        part = _first(problems[0].bench, share)
        minima = _fitted([problems[i] for i in found], list(found.values()), part)
        found = {i: m.x for i, m in zip(found, minima, strict=True) if (off[i] & ~missed(part, [m])).any()}
    return found


def _first(bench: Bench, share: float) -> Bench:
    """Return the bench of the first part of every recording."""
    counts = [int(share * e.recording.time[e.fitted].size) for e in bench.experiments]
    experiments = [e.beginning(n, _LEAST) for e, n in zip(bench.experiments, counts, strict=True)]
    return Bench(bench.base, bench.effects, experiments, bench.step)


def _on(problems: Sequence[Problem], part: Bench) -> list[Problem]:
    # Not what an effect held by convention that was taken out again.
    known = [{n: g for n, g in p.gaussian.items() if n in p.free} for p in problems]
    return [replace(p, bench=part, gaussian=own, error=None) for p, own in zip(problems, known, strict=True)]


def _fitted(problems: Sequence[Problem], starts: Sequence[FloatArray], part: Bench) -> list[Minimum]:
    return fit_problems(_on(problems, part), starts, iterations=_ITERATIONS, tolerance=1e-3, rough=True)
