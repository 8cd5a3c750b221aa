"""Steps that are shorter where a motion bends within them, as where dry friction changes its sign."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.ndimage import binary_dilation

from discovery.estimation.bench import Bench
from discovery.estimation.problem import Problem
from discovery.estimation.step_control import WORTH, matters, more_accurate, solver_errors
from discovery.foundation.arrays import BoolArray, FloatArray
from discovery.simulation.grid import Grid, Pace
from discovery.simulation.simulate import Simulator

#: The steps that make up this part of the squared errors of all are halved, and those next to them.
_BULK = 0.99
#: A state whose slopes are below this part of the largest ones does not bend.
_HARDLY = 1e-6

#: A problem and its values (p,).
Fitted = tuple[Problem, FloatArray]


def halved_where_bent(bench: Bench, fits: Sequence[Fitted]) -> Bench:
    """Return the same bench on steps half as long where the motion of any fit bends most within them.

    All are half as long where a motion is not finite, and those of an arm, whose rod rings everywhere. Those that make
    up most of the error of a fit are halved, as in W. Doerfler, SIAM Journal on Numerical Analysis 33 (1996) 1106. A
    kink that no step resolves, as that of a velocity at a turn with dry friction, then costs a few short steps, where
    all of them had to be short.

    `fits` each (p,): problems with the effects of the bench, and their values.
    """
    if bench.has_rod:
        return bench.finer(2)
    marks = [np.zeros(simulator.grid.steps.size, bool) for simulator in bench.simulators]
    for problem, x in fits:
        motions = bench.motions(*replace(problem, bench=bench).expand(x[:, None]))
        if not all(np.isfinite(motion).all() for motion in motions):
            return bench.finer(2)
        for mark, most in zip(marks, _most(bends(bench.simulators, motions)), strict=True):
            mark |= most
    return _halved(bench, marks)


def resolving(bench: Bench, fits: Sequence[Fitted]) -> Bench:
    """Return the same bench on steps that are short where motions bend, until no fit errs by what matters to it.

    What blows up is judged as that. The steps of an arm, whose rod rings, are kept.
    """
    if bench.has_rod:
        return bench
    first = bench
    while (finer := more_accurate(bench, first)) is not None:
        fits = [(replace(problem, bench=bench), x) for problem, x in fits]
        errors = solver_errors(fits, finer)
        erring = [(fit, error) for fit, error in zip(fits, errors, strict=True) if WORTH < error < np.inf]
        rough = [fit for fit, error in erring if error > matters(_excess(*fit))]
        if not rough:
            break
        bench = halved_where_bent(bench, rough)
    return bench


def _excess(problem: Problem, x: FloatArray) -> float:
    """Return by how much the chi-square of a fit is more than that of noise."""
    return float(problem.bench.chi2(*problem.expand(x[:, None])).sum()) - problem.bench.n_data


def bends(simulators: Sequence[Simulator], motions: Sequence[FloatArray]) -> list[FloatArray]:
    """Return how far slopes within the steps of motions are from smooth, times the lengths of these, each (steps,).

    By how much they miss the cubics through every other step; in a step between two kinks of the input, across which no
    cubic goes, by how much its change misses the trapezoid of its slopes. In shares of the rms slope of each state over
    all recordings, the largest of them; a state that hardly moves counts little.

    `motions` each (steps, 4 states): from `discovery.simulation.simulate.Simulator.motion`.
    """
    slopes = np.concatenate([np.split(motion, 4, axis=1)[3] for motion in motions])
    usual = np.sqrt(np.mean(slopes**2, axis=0))
    usual = np.maximum(usual, max(_HARDLY * float(usual.max()), np.finfo(float).tiny))
    return [_bent(simulator.grid, motion, usual) for simulator, motion in zip(simulators, motions, strict=True)]


def _bent(grid: Grid, motion: FloatArray, usual: FloatArray) -> FloatArray:
    begins, ends, after, before = np.split(motion, 4, axis=1)
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


def _most(errors: Sequence[FloatArray]) -> list[BoolArray]:
    """Return the fewest steps of all recordings that make up most of the squared errors, with those next to them."""
    every = np.concatenate(errors)
    largest = np.argsort(-every)
    share = np.cumsum((every[largest] / max(float(every.max()), np.finfo(float).tiny)) ** 2)
    found = np.zeros(every.size, bool)
    found[largest[: int(np.searchsorted(share, _BULK * share[-1])) + 1]] = True
    parts = np.split(found, np.cumsum([each.size for each in errors])[:-1])
    return [np.asarray(binary_dilation(part, np.ones(3, bool))) for part in parts]


def _halved(bench: Bench, marks: Sequence[BoolArray]) -> Bench:
    """Return a bench at half the pace where marked; steps that kinks cut short keep theirs."""
    experiments = []
    for experiment, simulator, mark in zip(bench.experiments, bench.simulators, marks, strict=True):
        times, steps = simulator.grid.times, simulator.grid.steps
        edges = np.append(times, times[-1] + steps[-1])
        present = 1.0 if experiment.pace is None else np.minimum(steps / np.diff(experiment.pace.shown(edges)), 1.0)
        pace = Pace.of(edges, present * np.where(mark, 0.5, 1.0))
        experiments.append(replace(experiment, pace=pace))
    return Bench(bench.base, bench.effects, experiments, bench.step, bench.leap)
