"""Step control: a tolerance goes in, simulators come out that keep it, or more accurate ones, or their error."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.ndimage import maximum_filter1d
from scipy.optimize import brentq

from discovery.equations.model import Model
from discovery.estimation.batch import fit_problems
from discovery.estimation.bench import Bench
from discovery.estimation.least_squares import Minimum
from discovery.estimation.natural_units import NaturalUnits
from discovery.estimation.problem import Problem, side_by_side
from discovery.estimation.step import Probe, choose_step
from discovery.foundation.arrays import FloatArray
from discovery.foundation.errors import ComputationError
from discovery.foundation.workers import at_once
from discovery.recordings.experiment import Experiment
from discovery.simulation.grid import Pace
from discovery.simulation.simulate import THREADS

#: Most steps of one recording: dry friction and play would ask for any number.
_MOST_STEPS = 200_000
#: Other mechanics may take so many times the steps: the tip does not feel what rings faster still.
_MORE = 8
#: A candidate may take so many times the steps of the set to which it is added.
_DEAREST = 32
#: Steps are far from blowing up where so many times longer ones do not.
_FARTHER = 1.25
#: A difference of chi-square that matters, at least; less than this part of the excess that a fit leaves does not.
WORTH, _LITTLE = 5.0, 1e-2
#: Steps that differ by less than this factor are the same.
_SAME = 1.01
#: Where a minimum is on other steps shows within so many iterations.
_ITERATIONS = 10
#: Equal steps that are longer than this part of the longest ones are kept,
_ENOUGH = 0.7
#: and so they are if unequal ones are more than this part of them.
_FEWER = 0.8
#: Parts of a recording whose steps have one length, a neighbour's if that is shorter: other sets move otherwise.
_PARTS, _NEIGHBOURS = 48, 1
#: What a part adds is measured on steps so many times longer: quicker, and of the order that follows.
_COARSE = 4.0
#: The error of one step is of this order, that of all of them of one less.
_ORDER = 5
#: Of the parts' errors some cancel, and coarse steps foretell them roughly: lengths are tried so often at most, until
#: the error is between this part of the tolerance and all of it; each time it shall become this part,
_ROUNDS, _FAR_BELOW, _AIM = 3, 0.5, 0.7
#: and change by this factor at most.
_MOST = 16.0


def matters(excess: float) -> float:
    """Return the difference of chi-square that matters to a fit that leaves so much more than noise."""
    return max(WORTH, _LITTLE * excess)


def more_accurate(bench: Bench, start: Bench) -> Bench | None:
    """Return simulators on half the steps; None where these would be too many for sets that begin on others."""
    finer = bench.finer(2)
    return finer if finer.charge <= min(_MOST_STEPS, _DEAREST * start.charge) else None


def solver_errors(fits: Sequence[tuple[Problem, FloatArray]], bench: Bench) -> FloatArray:
    """Return how far more accurate simulators move the readings of fits, held-out samples too.

    `fits` each (p,): problems, on simulators of the same recordings, and their values. `bench`: other simulators.
    Returned (fits,): sum over the samples [noise variances]; infinite where a motion blows up.
    """
    errors = np.zeros(len(fits))
    for own in dict.fromkeys(problem.bench for problem, _ in fits):
        here = [i for i, (problem, _) in enumerate(fits) if problem.bench is own]
        sets = side_by_side([fits[i][0] for i in here], [fits[i][1][:, None] for i in here])
        with np.errstate(over="ignore", invalid="ignore"):
            apart = sum(
                np.square((b - a) / e.recording.noise[:, None]).sum(axis=(0, 1))
                for e, a, b in zip(own.experiments, own.predict(*sets), bench.predict(*sets), strict=True)
            )
        errors[here] = np.where(np.isfinite(apart), apart, np.inf)
    return errors


def cheapest(problem: Problem, minimum: Minimum, bench: Bench, *, worth: float) -> tuple[Problem, Minimum]:
    """Return the same minimum on simulators that cost less, if it is one there, far from blowing up.

    `problem`, `minimum`: fitted on accurate simulators. `bench`: the cheapest that are tried, then such as cost twice
    as much, and twice as much again. `worth`: so much higher may its chi-square be.
    """
    while problem.bench.cost > _SAME * bench.cost:
        longer = bench.finer(1 / _FARTHER)
        # To begin with, it must be no start that blows up.
        if _bounded(problem, minimum.x, bench) and _bounded(problem, minimum.x, longer):
            other = replace(problem, bench=bench)
            (again,) = fit_problems([other], [minimum.x], iterations=_ITERATIONS, tolerance=1e-4, rough=True)
            if 2 * again.cost < 2 * minimum.cost + worth and _bounded(other, again.x, longer):
                return other, again
        bench = bench.finer(2)
    return problem, minimum


def _bounded(problem: Problem, x: FloatArray, bench: Bench) -> bool:
    """Whether the motion of a fit does not blow up on other simulators."""
    with np.errstate(over="ignore", invalid="ignore"):
        read = bench.predict(*problem.expand(x[:, None]))
    return all(np.isfinite(each).all() for each in read)


def tightened(bench: Bench, error: float, allowed: float) -> Bench | None:
    """Return a bench whose steps are so short that an error of the steps falls below what is allowed.

    By a factor of four at most at once; None where it is allowed already, or where the steps would be too many.
    """
    if not error > allowed:
        return None
    # The error falls with the fourth power of the step.
    found = bench.finer(1 / max(0.25, 0.8 * (allowed / error) ** 0.25))
    return found if found.charge <= _MOST_STEPS else None


def affordable_bench(
    model: Model,
    effects: Sequence[str],
    experiments: Sequence[Experiment],
    units: NaturalUnits,
    values: Mapping[str, float],
    *,
    tolerance: float,
    like: Bench,
) -> Bench | None:
    """Return simulators of another base, on as many more steps than a bench as these ask for, up to a limit.

    `model`, `effects`, `experiments`, `units`, `values`, `tolerance`: as for `discovery.estimation.step.choose_step`.
    `like`: of the base that is known. Returned: None where no step that is tried reaches the tolerance.
    """
    shortest = like.seen[0] / min(_MOST_STEPS, _MORE * like.cost)
    try:
        step = choose_step(model, experiments, units, values, tolerance, effects, shortest=shortest)
    except ComputationError:
        return None
    return Bench(model.base, effects, experiments, step)


def unequal_bench(
    model: Model,
    effects: Sequence[str],
    experiments: Sequence[Experiment],
    units: NaturalUnits,
    values: Mapping[str, float],
    tolerance: float,
) -> Bench:
    """Return a bench whose trajectory error is at most a tolerance, on unequal steps where these are far fewer.

    A violent moment of an arm asks for short steps where it is, the rest of a recording for steps that are stable. The
    steps of other systems cost little, and their input asks for short ones everywhere.

    `model`, `effects`, `experiments`, `units`, `values`, `tolerance`: as for `discovery.estimation.step.choose_step`.
    Raises ComputationError if no step reaches the tolerance.
    """
    step = choose_step(model, experiments, units, values, tolerance, effects)
    probe = Probe.of(model, effects, units, values)
    longest = probe.longest(experiments)
    best = equal = probe.bench(experiments, step)
    if step > _ENOUGH * longest or not experiments[0].system.has_rod:
        return equal
    parts = _measured(probe, experiments, min(_COARSE * step, longest))
    if not 0 < parts.errors.max() < np.inf:
        # Half of what was to be tried blows up already.
        return equal
    shares = parts.shares(step / longest)
    for _ in range(_ROUNDS):
        unequal = probe.bench(parts.paced(shares), longest)
        error = probe.error(unequal)
        if error <= tolerance:
            best = unequal
        if _FAR_BELOW * tolerance < error <= tolerance or (error > tolerance and best is not equal):
            break
        change = float(np.clip(_AIM * tolerance / max(error, np.finfo(float).tiny), 1 / _MOST, _MOST))
        shares = np.minimum(1.0, shares * change ** (1 / (_ORDER - 1)))
    return best if best.cost < _FEWER * equal.cost else equal


@dataclass(frozen=True)
class _Parts:
    """What each part of some recordings adds to the error of their readings."""

    experiments: Sequence[Experiment]
    edges: list[FloatArray]  # each (parts + 1,), where the parts of each begin and end [s]
    errors: FloatArray  # (parts of all,), error of a part on steps of some length, per second

    def shares(self, equal: float) -> FloatArray:
        """Return the lengths of steps in every part, as shares of the longest, that err as much as equal ones.

        With errors e h^4 a second on steps of length h, the fewest steps of a given sum of errors have lengths in
        proportion to e^(-1/5), here none of them above one.
        """
        lasting = np.concatenate([np.diff(edges) for edges in self.edges])
        e = np.maximum(self.errors / self.errors.max(), np.finfo(float).eps)
        goal = np.sum(lasting * e) * equal ** (_ORDER - 1)

        def shares(scale: float) -> FloatArray:
            return np.minimum(1.0, np.exp(scale) * e ** (-1 / _ORDER))

        def excess(scale: float) -> float:
            return float(np.log(np.sum(lasting * e * shares(scale) ** (_ORDER - 1)) / goal))

        # Lengths that may be above one err as much with the first of these, and with the second all are one.
        lowest = np.log(goal / np.sum(lasting * e ** (1 / _ORDER))) / (_ORDER - 1)
        return shares(brentq(excess, lowest - 1e-9, 0.0))

    def paced(self, shares: FloatArray) -> list[Experiment]:
        """Return the recordings with steps of these shares of the longest."""
        each = zip(self.experiments, self.edges, np.split(shares, len(self.edges)), strict=True)
        return [replace(experiment, pace=Pace.of(edges, own)) for experiment, edges, own in each]


def _measured(probe: Probe, experiments: Sequence[Experiment], step: float) -> _Parts:
    """Return what each part adds to the error of a motion on steps of a length there, half of it elsewhere."""
    found = []
    edges = [np.linspace(e.recording.time[0], e.recording.time[-1], _PARTS + 1) for e in experiments]
    for experiment, own in zip(experiments, edges, strict=True):
        fine = probe.predict(probe.bench([experiment], step / 2))

        def error(part: int, experiment: Experiment, own: FloatArray, fine: list[FloatArray]) -> float:
            shares = np.full(_PARTS, 0.5)
            shares[part] = 1.0
            coarse = probe.bench([replace(experiment, pace=Pace.of(own, shares))], step)
            return probe.apart(probe.predict(coarse), fine, [experiment])

        each = at_once([partial(error, part, experiment, own, fine) for part in range(_PARTS)], threads=THREADS)
        # Where steps of this length blow up in a part alone, they err there by as much as there is.
        errors = np.minimum(each, 1.0 if np.isfinite(fine[0]).all() else np.inf) / np.diff(own)
        found.append(maximum_filter1d(errors, 2 * _NEIGHBOURS + 1))
    return _Parts(experiments, edges, np.concatenate(found))
