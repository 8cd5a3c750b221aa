"""Starts at finite sizes for effects that trade with the stiffness: linear ones slip by whole swings.

A compliant base of 5 % of the rod's compliance moves the stiffness by 15 %, while a change by 1 % already turns a
recording of a dozen swings by half a radian. So the stiffness is scanned beside every effect of a finite size, all in
one batched simulation.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import product

import numpy as np
import sympy as sp
from scipy.signal import savgol_filter

from discovery.declarations.registry import get_effect
from discovery.equations.program import build_program
from discovery.estimation.beginning import lead
from discovery.estimation.guess import restoring
from discovery.estimation.least_squares import Minimum
from discovery.estimation.problem import Problem
from discovery.foundation.arrays import FloatArray
from discovery.recordings.experiment import Experiment
from discovery.screening.attribution import grid_of
from discovery.simulation.kernel.compile import numpy_derivative

#: A start of a refit: effect, its free values, and values of others that go with them: free, or held there.
FarStart = tuple[str, FloatArray, Mapping[str, float]]
#: Finite values of an effect.
_Grid = Sequence[Mapping[str, float]]
#: Mean and standard deviation by name.
_Stated = Mapping[str, tuple[float, float]]
#: An effect with values on its grid.
_Point = tuple[str, Mapping[str, float]]
#: Kinds that carry or return energy, and so move the frequency.
_KINDS = ("shape", "joint", "memory", "potential", "kinetic")
#: Kinds that push or brake.
_PUSHES = ("drive", "dissipation", "load")
#: Stiffness over the fitted one; a step of 3.6 % finds the phase of a dozen swings, half of it keeps it.
_FACTORS = np.geomspace(0.8, 1.6, 20)
_BESIDE = np.sqrt(_FACTORS[1] / _FACTORS[0]) ** np.array([-1.0, 0.0, 1.0])
#: Laws of more shapes than this are not entangled with the stiffness alone.
MOST_SHAPES = 12
_KEPT = 2
#: Samples over which a recorded motion is smoothed: what noise asks for and how fast the force comes and goes are
#: unknown beforehand.
_WINDOWS = (9, 25, 75)
#: So many shapes are kept of each, and their amplitudes and all else that is fitted improved so often.
_KEPT_ALONG, _ROUNDS = 2, 4
#: Derivatives that are made at once, in numbers.
_TOGETHER = 4e6
#: Step of a derivative, part of the scale of a parameter.
_STEP = 1e-4


def finite_starts(
    minimum: Minimum, problem: Problem, names: Sequence[str], stated: _Stated | None = None
) -> list[FarStart]:
    """Return starts of refits with what goes with each: all that is fitted for laws of many shapes, else `alpha`.

    `minimum`, `problem`: the fit so far. `names`: candidate effects. `stated`: mean and standard deviation of what the
    rig knows, which the fit holds. Returned: at most two for each effect of few shapes, the best sizes by chi-square;
    of others, and of what pushes or brakes a driven body without a stiffness to scan, see `_starts_along`.
    """
    system = problem.model.mechanics.system
    # What an input moves, with no stiffness to scan, goes astray without its losses, and its gain with it.
    loose = restoring(problem.model) is None and all(e.drive is not None for e in problem.bench.experiments)
    along = _PUSHES if loose else ()
    own = [effect for effect in map(get_effect, names) if effect.kind in (*_KINDS, *along)]
    grids = {effect.id(): grid_of(effect, system, problem.units) for effect in own}
    many = {e.id(): grids[e.id()] for e in own if e.kind in along or len(grids[e.id()]) > 2 * MOST_SHAPES}
    few = {name: grid for name, grid in grids.items() if name not in many}
    return [*_beside_stiffness(minimum, problem, few), *_starts_along(minimum, problem, many, stated or {})]


def _beside_stiffness(minimum: Minimum, problem: Problem, grids: Mapping[str, _Grid]) -> list[FarStart]:
    """Return the best sizes of effects, each with the stiffness that goes with it."""
    if "alpha" not in problem.free:
        return []
    system = problem.model.mechanics.system
    alphas = minimum.x[problem.names.index("alpha")] * _FACTORS
    points: list[_Point] = [(name, values) for name, grid in grids.items() for values in grid]
    if not points:
        return []
    best = alphas[_costs(problem, minimum, points, np.tile(alphas, (len(points), 1))).argmin(axis=1)]
    beside = best[:, None] * _BESIDE
    table = _costs(problem, minimum, points, beside)
    least = table.min(axis=1)
    found: list[FarStart] = []
    for name in dict.fromkeys(n for n, _ in points):
        own_points = [i for i, (n, _) in enumerate(points) if n == name]
        for i in sorted(own_points, key=lambda i: least[i])[:_KEPT]:
            if np.isfinite(least[i]):
                alpha = float(beside[i, table[i].argmin()])
                found.append((name, _vector(name, points[i][1], system), {"alpha": alpha}))
    return found


def _costs(problem: Problem, minimum: Minimum, points: Sequence[_Point], alphas: FloatArray) -> FloatArray:
    """Return chi-square at points with some stiffnesses each, both shapes (points, stiffnesses)."""
    bench = problem.bench
    base, initial = problem.expand(minimum.x[:, None])
    columns = np.repeat(base, alphas.size, axis=1)
    for i, (_, values) in enumerate(points):
        own = slice(i * alphas.shape[1], (i + 1) * alphas.shape[1])
        for parameter, value in values.items():
            columns[bench.names.index(parameter), own] = value
    columns[bench.names.index("alpha")] = alphas.ravel()
    cost = bench.chi2(columns, np.repeat(initial, columns.shape[1], axis=2)).sum(axis=0)
    return np.asarray(cost.reshape(alphas.shape))


def declared_starts(problem: Problem, names: Sequence[str], most: int) -> list[FarStart]:
    """Return starts at the declared finite values of effects, none of one with more than so many, all else as it is."""
    system = problem.model.mechanics.system
    grids = {name: grid_of(get_effect(name), system, problem.units) for name in names}
    return [(n, _vector(n, values, system), {}) for n, grid in grids.items() if len(grid) <= most for values in grid]


def _vector(name: str, values: Mapping[str, float], system: str) -> FloatArray:
    return np.array([values[p.name] for p in get_effect(name).fitted(system)])


def _starts_along(minimum: Minimum, problem: Problem, grids: Mapping[str, _Grid], stated: _Stated) -> list[FarStart]:
    """Return starts of refits at the shapes that explain best which force the recorded motion lacks.

    The teeth of a motor hold on to its rotor and let it go. The motion of a model without them is soon at another
    tooth, and what a little of the law does there tells no number of teeth. The recorded motion is at the right one. So
    it is where a motor stands still by a friction that the model lacks, and runs on in the model.

    `minimum`, `problem`, `stated`: as for `finite_starts`. `grids`: the shapes of each candidate effect. Returned:
    effect, its values, and those of all else that is fitted, as they are, and led from the beginning of the recordings
    to the whole of them, where a wrong model has no say in what the rig knows; none where the reading is not that of
    the only coordinate or of its rate.
    """
    order = _read(problem) if grids else None
    if order is None:
        return []
    found, problems, vectors, near = [], [], [], []
    known = {**problem.gaussian, **{n: own for n, own in stated.items() if n in problem.model.known}}
    for (name, grid), window in product(grids.items(), _WINDOWS):
        lack, apart = _Lack(problem, name, order, window), _spacing(grid)
        if not lack.motions:
            continue
        for vector in lack.best(dict(zip(problem.names, minimum.x, strict=True)), grid):
            values = vector | {s.name: s.guess for s in problem.states if s.row < 2}
            found.append(_far_start(lack.extended, lack.extended.start(values)))
            problems.append(replace(lack.extended, model=lack.extended.model.free_parameter(*known), gaussian=known))
            vectors.append(problems[-1].start(values | {n: mean for n, (mean, _) in known.items()}))
            near.append({n: (vector[n], least) for n, least in apart.items()})
    return [*found, *(_far_start(p, x) for p, x in zip(problems, lead(problems, vectors, near), strict=True))]


def _spacing(grid: _Grid) -> dict[str, float]:
    """Return the least distance between the values of a grid, of each that has several."""
    values = {name: sorted({point[name] for point in grid}) for name in grid[0]}
    return {name: float(np.min(np.diff(own))) for name, own in values.items() if len(own) > 1}


def _far_start(extended: Problem, x: FloatArray) -> FarStart:
    """Return the start of the last effect of a problem, and of all else that is free."""
    name, values = extended.model.effects[-1], extended.named(x)
    added = [p.name for p in get_effect(name).fitted(extended.model.mechanics.system)]
    return name, np.array([values[n] for n in added]), {n: v for n, v in values.items() if n not in added}


def _read(problem: Problem) -> int | None:
    """Return whether the only coordinate is read, 0, or its rate, 1; None where neither is read as it is."""
    base = problem.model.mechanics
    if base.system.has_rod or base.n_coordinates > 1 or base.prescribed:
        return None
    if any(e.rig.view is not None for e in problem.bench.experiments):
        return None
    mechanics = base.mechanics()
    reading = sp.sympify(base.reading(None)[0])
    moving = (mechanics.coordinates[0], mechanics.rates[0])
    return next((k for k, symbol in enumerate(moving) if reading == symbol), None)


class _Lack:
    """The acceleration that a model with a law lacks along recorded motions, smoothed over a window."""

    def __init__(self, problem: Problem, name: str, order: int, window: int) -> None:
        self.extended = Problem(problem.model.with_effect(name), problem.bench, problem.units, problem.gaussian)
        program = build_program(problem.model.base, self.extended.model.effects)
        self.parameters, self.window = program.parameters, window
        self.slopes = numpy_derivative(program)
        # What an effect remembers is not recorded.
        alone = len(program.states) == len(("position", "rate"))
        self.motions = [m for e in problem.bench.experiments for m in _motion(e, order, window)] if alone else []

    def lacked(self, points: FloatArray) -> FloatArray:
        """Return what the recorded motions lack, shape (n, k), at values of all that is fitted, shape (p, k)."""
        known = dict(zip(self.extended.bench.names, self.extended.expand(points)[0], strict=True))
        at = np.array([known[n] for n in self.parameters]).T
        found = []
        for time, recorded, state, acceleration in self.motions:
            forces = [np.broadcast_to(self.slopes(time, recorded, state, own)[1], time.shape) for own in at]
            found.append(acceleration - savgol_filter(np.array(forces), self.window, 3))
        return np.concatenate(found, axis=1).T

    def best(self, fitted: Mapping[str, float], grid: _Grid) -> Iterator[dict[str, float]]:
        """Yield all fitted values at the shapes that explain most, improved."""
        names = self.extended.names
        own = self.extended.model.parameters
        shapes = [i for i, n in enumerate(names) if n in grid[0] and own[n].shape]
        sizes = [i for i, n in enumerate(names) if n in grid[0] and not own[n].shape]
        old = [i for i, n in enumerate(self.extended.free) if n not in grid[0]]
        if any(own[names[i]].threshold for i in sizes):
            yield from (dict(zip(names, x, strict=True)) for x in self._beyond(fitted, grid, old, sizes))
            return
        absent = self.extended.start(fitted)
        absent[sizes] = 0.0
        lack = self.lacked(absent[:, None])[:, 0]
        known, _ = np.linalg.qr(self._columns(absent[:, None], old, lack)[0])
        # Sizes are zero here, so that points which differ in them alone are one.
        tried = list(dict.fromkeys(tuple(values[names[i]] for i in shapes) for values in grid))
        points = np.repeat(absent[:, None], len(tried), axis=1)
        points[shapes] = np.array(tried).T
        gains: list[float] = []
        together = max(1, int(_TOGETHER / (lack.size * max(1, len(sizes)))))
        for first in range(0, len(tried), together):
            # Amplitudes are zero, so that shapes alone change nothing.
            for columns in self._columns(points[:, first : first + together], sizes, lack):
                basis, _ = np.linalg.qr(columns - known @ (known.T @ columns))
                gains.append(float(np.square(basis.T @ lack).sum()))
        for best in np.argsort(gains)[: -_KEPT_ALONG - 1 : -1]:
            yield dict(zip(names, self._improved(points[:, best], [*old, *sizes]), strict=True))

    def _beyond(
        self, fitted: Mapping[str, float], grid: _Grid, old: Sequence[int], sizes: Sequence[int]
    ) -> Iterator[FloatArray]:
        """Yield all fitted values at the thresholds that explain most: at zero no motion tells what lies beyond one."""
        tried = [self._improved(self.extended.start({**fitted, **values}), old) for values in grid]
        left = np.square(self.lacked(np.array(tried).T)).sum(axis=0)
        for best in np.argsort(left)[:_KEPT_ALONG]:
            yield self._improved(tried[best], [*old, *sizes])

    def _improved(self, values: FloatArray, free: Sequence[int]) -> FloatArray:
        lower, upper = self.extended.bounds
        for _ in range(_ROUNDS):
            before = self.lacked(values[:, None])[:, 0]
            (columns,) = self._columns(values[:, None], free, before)
            weight = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
            step = np.linalg.lstsq(columns / weight, -before, rcond=1e-9)[0] / weight
            values = values.copy()
            values[free] = np.clip(values[free] + step, lower[free], upper[free])
        return values

    def _columns(self, points: FloatArray, which: Sequence[int], before: FloatArray) -> list[FloatArray]:
        """Return derivatives of what is lacked, `before` at each of the points (p, k), each of shape (n, m)."""
        if not len(which):
            return [np.empty((before.size, 0))] * points.shape[1]
        moved = np.repeat(points, len(which), axis=1)
        where = np.tile(which, points.shape[1]), np.arange(moved.shape[1])
        at = moved[where]
        moved[where] += _STEP * self.extended.scale[where[0]]
        slopes = (self.lacked(moved) - before[:, None]) / (moved[where] - at)
        return np.split(slopes, points.shape[1], axis=1)


def _motion(experiment: Experiment, order: int, window: int) -> list[tuple]:
    """Return times, input with its derivatives, position and rate, and acceleration; none of a recording too short."""
    time, read = experiment.recording.time[experiment.fitted], experiment.recording.output[experiment.fitted, 0]
    good = np.isfinite(read)
    if good.sum() < 2 * window:
        return []
    even = np.linspace(time[0], time[-1], time.size)
    step = float(even[1] - even[0])
    read = np.interp(even, time[good], read[good])
    rates = [savgol_filter(read, window, 3 + (k > 1), deriv=k, delta=step) for k in range(3)]
    if order:
        position = np.concatenate([[0.0], np.cumsum(0.5 * step * (read[1:] + read[:-1]))])
        rates = [position, *rates[:2]]
    drive = np.zeros((3, even.size)) if experiment.drive is None else experiment.drive.evaluate(even)
    return [(even, drive, rates[:2], rates[2])]
