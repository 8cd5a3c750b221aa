"""Starts of refits found on the beginning of the recordings, then on more and more of them.

The phase of a swing whose frequency depends on its amplitude runs away with every error of a loss, and a free run over
many swings has a minimum for every swing that is lost or gained. Over a few swings it has one.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from discovery.attribution import screen
from discovery.batch import fit_problems
from discovery.bench import Bench
from discovery.effect import OSCILLATOR
from discovery.finite import FarStart
from discovery.least_squares import Minimum
from discovery.problem import Problem
from discovery.refits import refit

__all__ = ["growing_starts"]

FloatArray = NDArray[np.float64]
#: Swings of the first part; recordings of fewer than twice as many need no such starts.
_SWINGS = 5.0
_ITERATIONS = 15
#: So many of the best candidates of the first part are followed.
_FOLLOWED = 10


def growing_starts(minimum: Minimum, problem: Problem, names: Sequence[str]) -> list[FarStart]:
    """Return starts of refits for free decays of systems other than an arm: effect, its values, all others with them.

    Parameters
    ----------
    minimum, problem : Minimum, Problem
        The fit so far.
    names : sequence of str
        Candidate effects.

    Returns
    -------
    list of FarStart
        One for each effect that is worth following; none where the recordings are short.
    """
    model, bench, units = problem.model, problem.bench, problem.units
    longest = max(e.recording.time[e.fitted][-1] - e.recording.time[0] for e in bench.experiments)
    share = _SWINGS * 2 * np.pi * units.time / longest
    # An input holds the phase: only a free decay runs away.
    free = model.mechanics.system == OSCILLATOR and all(e.drive is None for e in bench.experiments)
    if not free or share > 0.5:
        return []
    short = Problem(model, _beginning(bench, share), units, problem.gaussian)
    (first,) = fit_problems([short], [minimum.x], iterations=_ITERATIONS)
    found = refit(model, first, short, screen(model, first, short, names))[:_FOLLOWED]
    values = {r.effect: r.values for r in found}
    while (share := 2 * share) <= 0.5:
        longer = _beginning(bench, share)
        problems = [Problem(r.problem.model, longer, units, problem.gaussian) for r in found]
        starts = [p.start(values[r.effect]) for p, r in zip(problems, found, strict=True)]
        minima = fit_problems(problems, starts, iterations=_ITERATIONS)
        values = {r.effect: p.named(m.x) for p, r, m in zip(problems, found, minima, strict=True)}
    own = {r.effect: [n for n in r.problem.free if n not in problem.free] for r in found}
    return [(e, np.array([v[n] for n in own[e]]), v) for e, v in values.items()]


def _beginning(bench: Bench, share: float) -> Bench:
    """Return the bench of the first part of every recording."""
    counts = [max(16, int(share * e.recording.time[e.fitted].size)) for e in bench.experiments]
    experiments = [e.first(n) for e, n in zip(bench.experiments, counts, strict=True)]
    return Bench(bench.base, bench.effects, experiments, bench.step)
