"""Refits that begin on the first swings of the recordings and grow to the whole of them.

The phase of a swing whose frequency depends on its amplitude runs away with every error of a loss, and a free run over
many swings has a minimum for every swing that is lost or gained; so has the ringing of a light rod. Over the first
swings there is one. What a fit of a wrong model made of the initial state, of what the rig states and of the constants
of a declared system must be forgotten for it: such a fit starts the rod ringing where it was at rest, and shrinks a
pendulum to nothing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from discovery.equations.model import Model
from discovery.estimation.batch import fit_problems, near_the_best
from discovery.estimation.beginning import beginning
from discovery.estimation.least_squares import Minimum
from discovery.estimation.problem import Problem
from discovery.estimation.residual import variance_left
from discovery.recordings.experiment import Experiment
from discovery.screening.attribution import screen
from discovery.screening.finite import finite_starts
from discovery.screening.refits import Refit, refit, settled

#: Swings of the first parts: of a free decay, of a declared system, of an arm once it moves. A fast ringing is caught
#: within the shortest only, a slow loss shows in the longer.
_SWINGS, _SWINGS_OF_A_SYSTEM, _SWINGS_OF_AN_ARM = (5.0,), (2.5, 5.0), (0.5, 1.5)
#: An arm moves where its deflection exceeds this share of the largest.
_MOVES = 0.1
_ITERATIONS = 15
#: A fit that leaves so much of the variance of the readings went astray.
_ASTRAY = 0.1
#: So many of the best candidates of the first part are followed.
_FOLLOWED = 6


def grows(minimum: Minimum, problem: Problem, *, first: bool) -> bool:
    """Return whether candidates are worth beginning on the first swings.

    Where effects were added, or an input holds the phase of an oscillator whose start was read off the recording, only
    beside a fit that went astray: a wrong model bends a resonance the wrong way, and is on another branch of it.

    `minimum`, `problem`: the fit so far. `first`: no effect was added yet.
    """
    experiments = problem.bench.experiments
    led = problem.model.mechanics.system.has_rod or experiments[0].rig.traits.has_own_equations
    held = not led and any(e.drive is not None for e in experiments)
    return (first and not held) or variance_left(problem, 2 * minimum.cost) >= _ASTRAY


def grown(minimum: Minimum, problem: Problem, names: Sequence[str]) -> list[Refit]:
    """Refit the model with each candidate added on the first swings, then on twice as much again and again.

    `minimum`, `problem`: the fit so far. `names`: candidate effects. Returned: on the whole recordings, the best
    candidates of the first swings; none where the recordings are short.
    """
    bench = problem.bench
    arm, declared = problem.model.mechanics.system.has_rod, bench.experiments[0].rig.traits.has_own_equations
    period = 2 * np.pi * problem.units.time
    lengths = _SWINGS_OF_AN_ARM if arm else _SWINGS_OF_A_SYSTEM if declared else _SWINGS
    shares = [max(_share(e, n * period, still=arm) for e in bench.experiments) for n in lengths]
    # Half of a recording is no short part, but free of what a fit of the whole made of its beginning.
    shares = [min(share, 0.5) for share in shares if arm or declared or share <= 0.5]
    followed = [f for share in dict.fromkeys(shares) for f in _followed(minimum, problem, names, share)]
    problems = [Problem(model, bench, problem.units, problem.gaussian) for model, _ in followed]
    return settled(problems, [p.start(v) for p, (_, v) in zip(problems, followed, strict=True)])


def _followed(
    minimum: Minimum, problem: Problem, names: Sequence[str], share: float
) -> list[tuple[Model, Mapping[str, float]]]:
    """Return models with a candidate each and their values, from a first share of the recordings to half of them."""
    short = beginning(problem, share)
    begun = {n: v for n, v in zip(problem.free, minimum.x, strict=False) if n not in problem.gaussian}
    begins = [begun, {}] if problem.bench.experiments[0].rig.system is not None else [begun]
    minima = fit_problems([short] * len(begins), [short.start(b) for b in begins], iterations=_ITERATIONS)
    first = min(minima, key=lambda m: m.cost)
    if not np.isfinite(first.cost):
        return []
    scored = screen(first, short, names)
    far = finite_starts(first, short, names)
    found = refit(first, short, scored, finite=far, thorough=True)[:_FOLLOWED]
    models = [r.problem.model for r in found]
    values: list[Mapping[str, float]] = [r.values for r in found]
    while (share := 2 * share) < 1:
        longer = beginning(problem, share)
        problems = [Problem(model, longer.bench, problem.units, problem.gaussian) for model in models]
        starts = [p.start(v) for p, v in zip(problems, values, strict=True)]
        minima = fit_problems(problems, starts, iterations=_ITERATIONS, tolerance=1e-3, rough=True, race=True)
        near = sorted(near_the_best([2 * m.cost for m in minima], longer.bench.n_data))
        models = [models[i] for i in near]
        values = [problems[i].named(minima[i].x) for i in near]
    return list(zip(models, values, strict=True))


def _share(experiment: Experiment, duration: float, *, still: bool) -> float:
    """Return the share of a recording's fitted part that holds so many seconds from where it moves."""
    time = experiment.recording.time[experiment.fitted]
    deflection = np.abs(experiment.deflection[experiment.fitted])
    moves = np.flatnonzero(deflection > _MOVES * np.nanmax(deflection))[0] if still else 0
    return float((time[moves] + duration - time[0]) / (time[-1] - time[0]))
