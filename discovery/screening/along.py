"""Starts of laws of many shapes, read along the recorded motion: the force that the model lacks there tells the shape.

The teeth of a motor hold on to its rotor and let it go. The motion of a model without them is soon at another tooth,
and what a little of the law does there tells no number of teeth. The recorded motion is at the right one.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import product

import numpy as np
import sympy as sp
from scipy.signal import savgol_filter

from discovery.declarations.registry import get_effect
from discovery.equations.program import build_program
from discovery.estimation.least_squares import Minimum
from discovery.estimation.problem import Problem
from discovery.foundation.arrays import FloatArray
from discovery.recordings.experiment import Experiment
from discovery.simulation.kernel.compile import numpy_derivative

#: Samples over which a recorded motion is smoothed: what noise asks for and how fast the force comes and goes are
#: unknown beforehand.
_WINDOWS = (9, 25, 75)
#: So many shapes are kept of each, and their amplitudes and all else that is fitted improved so often.
_KEPT, _ROUNDS = 2, 4
#: Derivatives that are made at once, in numbers.
_TOGETHER = 4e6
#: Step of a derivative, part of the scale of a parameter.
_STEP = 1e-4


def starts_along(
    minimum: Minimum, problem: Problem, grids: Mapping[str, Sequence[Mapping[str, float]]]
) -> list[tuple[str, FloatArray, Mapping[str, float]]]:
    """Return starts of refits at the shapes that explain best which force the recorded motion lacks.

    Parameters
    ----------
    minimum, problem : Minimum, Problem
        The fit so far.
    grids : mapping of str to sequence of mappings
        The shapes of each candidate effect.

    Returns
    -------
    list of (str, ndarray, mapping)
        Effect, its values, and those of all else that is fitted; none where the reading is not that of the only
        coordinate or of its rate.
    """
    order = _read(problem) if grids else None
    if order is None:
        return []
    found: list[tuple[str, FloatArray, Mapping[str, float]]] = []
    for (name, grid), window in product(grids.items(), _WINDOWS):
        lack = _Lack(problem, name, order, window)
        if not lack.motions:
            continue
        for vector in lack.best(dict(zip(problem.names, minimum.x, strict=True)), grid):
            added = [p.name for p in get_effect(name).fitted(problem.model.mechanics.system)]
            others = {n: v for n, v in vector.items() if n not in added}
            others |= {s.name: s.guess for s in problem.states if s.row < 2}
            found.append((name, np.array([vector[n] for n in added]), others))
    return found


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

    def best(self, fitted: Mapping[str, float], grid: Sequence[Mapping[str, float]]) -> Iterator[dict[str, float]]:
        """Yield all fitted values at the shapes that explain most, improved."""
        names = self.extended.names
        own = self.extended.model.parameters
        shapes = [i for i, n in enumerate(names) if n in grid[0] and own[n].shape]
        sizes = [i for i, n in enumerate(names) if n in grid[0] and not own[n].shape]
        old = [i for i, n in enumerate(self.extended.free) if n not in grid[0]]
        absent = self.extended.start(fitted)
        absent[sizes] = 0.0
        lack = self.lacked(absent[:, None])[:, 0]
        known, _ = np.linalg.qr(self._columns(absent[:, None], old, lack)[0])
        points = np.repeat(absent[:, None], len(grid), axis=1)
        points[shapes] = [[values[names[i]] for values in grid] for i in shapes]
        gains: list[float] = []
        together = max(1, int(_TOGETHER / (lack.size * max(1, len(sizes)))))
        for first in range(0, len(grid), together):
            # Amplitudes are zero, so that shapes alone change nothing.
            for columns in self._columns(points[:, first : first + together], sizes, lack):
                basis, _ = np.linalg.qr(columns - known @ (known.T @ columns))
                gains.append(float(np.square(basis.T @ lack).sum()))
        for best in np.argsort(gains)[: -_KEPT - 1 : -1]:
            yield dict(zip(names, self._improved(points[:, best], [*old, *sizes]), strict=True))

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
