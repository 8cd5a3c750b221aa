"""Steps that are shorter where a motion bends within them, as where dry friction changes its sign."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.ndimage import binary_dilation

from discovery.estimation.bench import Bench
from discovery.estimation.problem import Problem
from discovery.foundation.arrays import BoolArray, FloatArray
from discovery.simulation.grid import Pace
from discovery.simulation.simulate import Simulator

#: The steps that make up this part of the squared errors of all are halved, and those next to them.
_BULK = 0.99

#: A problem and its values (p,).
Fitted = tuple[Problem, FloatArray]


def halved_where_bent(bench: Bench, fits: Sequence[Fitted]) -> Bench:
    """Return the same bench on steps half as long where the motion of any fit bends most within them.

    All are half as long where a motion is not finite. Those that make up most of the error are halved, as in
    W. Doerfler, SIAM Journal on Numerical Analysis 33 (1996) 1106. A kink that no step resolves, as that of a velocity
    at a turn with dry friction, then costs a few short steps, where all of them had to be short.

    `fits` each (p,): problems with the effects of the bench, and their values.
    """
    bent = [np.zeros(simulator.grid.steps.size, bool) for simulator in bench.simulators]
    for problem, x in fits:
        own = replace(problem, bench=bench)
        for mark, simulator, motion in zip(bent, bench.simulators, bench.motions(*own.expand(x[:, None])), strict=True):
            if not np.isfinite(motion).all():
                return bench.finer(2)
            mark |= _most(bends(simulator, motion))
    return _halved(bench, bent)


def bends(simulator: Simulator, motion: FloatArray) -> FloatArray:
    """Return how far slopes within the steps of a motion are from smooth, times the length of the step, shape (steps,).

    By how much they miss the cubics through every other step; in a step between two kinks of the input, across which no
    cubic goes, by how much its change misses the trapezoid of its slopes. In shares of the rms slope of each state, the
    largest of them.

    `motion` (steps, 4 states): from `discovery.simulation.simulate.Simulator.motion`.
    """
    grid = simulator.grid
    begins, ends, after, before = np.split(motion, 4, axis=1)
    usual = np.sqrt(np.mean(before**2, axis=0)) + np.finfo(float).tiny
    both = grid.steps[:-1] + grid.steps[1:]
    s = (grid.steps[:-1] / both)[:, None]
    chord = (begins[:-1] - ends[1:]) / both[:, None]
    sides = (3.0 * s - 1.0) * (s - 1.0) * before[:-1] + s * (3.0 * s - 2.0) * after[1:]
    missed = (np.abs(6.0 * s * (s - 1.0) * chord + sides - after[:-1]) / usual).max(axis=1)
    missed[grid.restart[1:]] = 0.0
    trapezoid = 0.5 * grid.steps[:, None] * (before + after)
    alone = grid.restart & np.append(grid.restart[1:], True)
    found = grid.steps * np.maximum(np.append(missed, 0.0), np.insert(missed, 0, 0.0))
    return np.where(alone, (np.abs(ends - begins - trapezoid) / usual).max(axis=1), found)


def _most(errors: FloatArray) -> BoolArray:
    """Return the fewest steps that make up most of the squared errors, with those next to them."""
    largest = np.argsort(-errors)
    share = np.cumsum(errors[largest] ** 2)
    found = np.zeros(errors.size, bool)
    found[largest[: int(np.searchsorted(share, _BULK * share[-1])) + 1]] = True
    return np.asarray(binary_dilation(found, np.ones(3, bool)))


def _halved(bench: Bench, marks: Sequence[BoolArray]) -> Bench:
    """Return a bench on half the steps where marked."""
    experiments = []
    for experiment, simulator, mark in zip(bench.experiments, bench.simulators, marks, strict=True):
        times, steps = simulator.grid.times, simulator.grid.steps
        shares = np.minimum(steps / bench.step, 1.0) * np.where(mark, 0.5, 1.0)
        pace = Pace.of(np.append(times, times[-1] + steps[-1]), shares)
        experiments.append(replace(experiment, pace=pace))
    return Bench(bench.base, bench.effects, experiments, bench.step, bench.leap)
