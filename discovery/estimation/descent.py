"""One bounded minimisation by Levenberg and Marquardt: where it is, and the rules by which it moves."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.linalg.blas import dger

from discovery.foundation.arrays import BoolArray, FloatArray, IntArray

#: A Jacobian that is carried along is renewed where a step gains less than this part of what it promised.
_KEPT = 0.8
#: Steps that gain less than this part of what the longest of them promised are tried again along a bend,
_BENT = 0.25
#: that turns them by at most so many times their length, until this has helped less than straight ones so often.
_TURN, _PATIENCE = 0.75, 2


class Wanted(NamedTuple):
    """Points (p, k) whose residuals a minimisation wants, and more that it may want next, if they cost no time."""

    points: FloatArray
    next: FloatArray = np.empty((0, 0))


Steps = Generator["Wanted", FloatArray, None]


class Descent:
    """A minimisation under way: a point within bounds, its residual and Jacobian, and how far steps may go.

    Its generators ask for residuals; see `discovery.estimation.least_squares.levenberg_marquardt` for the parameters.
    """

    def __init__(
        self,
        start: FloatArray,
        lower: FloatArray,
        upper: FloatArray,
        scale: FloatArray,
        *,
        tolerance: float,
        quick: bool,
        rough: bool,
    ) -> None:
        self.x = np.clip(np.asarray(start, float), lower, upper)
        self.lower, self.upper, self.scale = lower, upper, scale
        self.cost = np.inf
        self.residual = self.jacobian = np.empty(0)
        self.converged, self.blown, self.count = False, False, 0
        self._tolerance, self._quick, self._rough = tolerance, quick, rough
        self._every, self._both = np.arange(self.x.size), not (quick or rough)
        self._step = 1e-6 * scale
        self._damping, self._patience, self._fresh = 1e-3, _PATIENCE, not quick

    @property
    def is_finite(self) -> bool:
        """Whether the motion at the point does not blow up."""
        return bool(np.isfinite(self.cost) and np.isfinite(self.residual).all())

    def begin(self, jacobian: FloatArray | None) -> Steps:
        """Find residual and derivatives at the start, those of a given Jacobian that are not zero left as they are."""
        unknown = self._every if jacobian is None else np.flatnonzero(~jacobian.any(axis=0))
        points, apart = self._probes(self.x, unknown, both=self._both)
        answers = yield Wanted(np.concatenate([self.x[:, None], points], axis=1))
        self.residual = answers[:, 0]
        size = (self.residual.size, self.x.size)
        self.jacobian = np.empty(size, order="F") if jacobian is None else jacobian.copy(order="F")
        self.jacobian[:, unknown] = _columns(answers[:, 1:], self.residual, apart)
        self.cost = float(_cost(self.residual[:, None])[0])
        self.blown = not np.isfinite(self.cost)

    def advance(self) -> Steps:
        """Take a step, or converge."""
        self.count += 1
        at = self._normal()
        if not at.free.any():
            self.converged = True
            return
        # Finite differences over a tenth of a standard deviation: far above round-off, far below curvature.
        self._step = np.clip(0.1 / at.diagonal, 1e-9 * self.scale, 1e-3 * self.scale)
        tried = yield from self._try(at)
        best, old_x, old_residual = tried.best, self.x, self.residual
        gain = self.cost - tried.costs[best]
        if gain > 0:
            self.x, self.residual, self.cost = tried.points[:, best], tried.residuals[:, best], float(tried.costs[best])
            self._damping = float(np.clip(tried.dampings[best], 1e-12, 1e12))
        if gain > tried.small:
            yield from self._renew(at, tried, self.x - old_x, self.residual - old_residual, gain)
        elif (gain > 0 or self._damping > 1e9) and (self._fresh or self._quick):
            # A tiny step: the end, unless the Jacobian is only carried along.
            self.converged = True
        elif self._fresh:
            self._damping *= 100.0
        else:
            yield from self._difference()

    def _normal(self) -> _Normal:
        gradient = self.jacobian.T @ self.residual
        matrix = self.jacobian.T @ self.jacobian
        diagonal = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
        free = ~(((self.x <= self.lower) & (gradient > 0)) | ((self.x >= self.upper) & (gradient < 0)))
        # What each parameter does over its typical size: a derivative alone depends on the unit.
        effect = diagonal * self.scale
        free &= effect > 1e-12 * effect.max(initial=0.0)
        return _Normal(gradient, matrix, diagonal, free)

    def _try(self, at: _Normal) -> Generator[Wanted, FloatArray, _Tried]:
        """Try steps of three dampings, and again along the bend of a narrow valley where they gain little."""
        x, lower, upper = self.x, self.lower, self.upper
        dampings = self._damping * np.array([0.01, 0.3, 10.0])
        damped = at.damped(dampings)
        points = np.repeat(x[:, None], 3, axis=1)
        for k, matrix in enumerate(damped):
            points[at.free, k] = np.clip(x[at.free] + at.step(matrix), lower[at.free], upper[at.free])
        # Derivatives at the middle one, from which the others are not far, may come along.
        ahead, apart = self._probes(points[:, 1], self._every[:0] if self._both else self._every, both=False)
        answers = yield Wanted(points, ahead)
        residuals, foreseen = answers[:, :3], answers[:, 3:]
        costs = _cost(residuals)
        self.blown = self.blown or not np.isfinite(costs).all()
        small = max(self._tolerance * self.cost, 1e-7 if not self._quick else 0.05)
        promised = -at.change(points[:, 0] - x)
        # The valley may be narrow and bent.
        bent = self._fresh and self._patience > 0 and promised > small and self.cost - costs.min() < _BENT * promised
        if bent:
            turned = _turned(x, points, residuals - self.residual[:, None], self.jacobian, damped, at.free)
            turned = np.clip(turned, lower[:, None], upper[:, None])
            more = yield Wanted(turned)
            points, residuals = np.hstack([points, turned]), np.hstack([residuals, more])
            dampings, costs = np.tile(dampings, 2), np.append(costs, _cost(more))
            self._patience = _PATIENCE if int(np.argmin(costs)) >= len(damped) else self._patience - 1
        return _Tried(
            points, residuals, costs=costs, dampings=dampings, small=small, bent=bent, foreseen=foreseen, apart=apart
        )

    def _renew(self, at: _Normal, tried: _Tried, moved: FloatArray, changed: FloatArray, gain: float) -> Steps:
        """Find the Jacobian at the end of a step: carried along, foreseen, or differenced."""
        kept = gain > -_KEPT * at.change(moved)
        carried = self._quick or (self._rough and not tried.bent and kept)
        foreseen, middle = tried.foreseen, tried.residuals[:, 1]
        known = foreseen.size > 0 and tried.costs[1] < self.cost + gain and bool(np.isfinite(foreseen).all())
        if known:
            self.jacobian = _columns(foreseen, middle, tried.apart)
            moved, changed = self.x - tried.points[:, 1], self.residual - middle
            carried = tried.best != 1
        if carried:
            weighted = at.diagonal**2 * moved
            # In place: it is the same array, by columns.
            share = 1.0 / max(float(weighted @ moved), 1e-300)
            change = changed - self.jacobian @ moved
            self.jacobian = dger(share, change, weighted, a=self.jacobian, overwrite_a=1)
        elif not known:
            yield from self._difference()
        self._fresh = not carried

    def _difference(self) -> Steps:
        points, apart = self._probes(self.x, self._every, both=self._both)
        answers = yield Wanted(points)
        self.jacobian = _columns(answers, self.residual, apart)
        self._fresh = True

    def _probes(self, x: FloatArray, which: IntArray, *, both: bool) -> tuple[FloatArray, FloatArray]:
        """Return points (p, k) beside x whose residuals give derivatives, within bounds, and how far apart they are.

        Both sides, first all above and then all below, or one; beside a bound always one.
        """
        high, low = np.minimum(x + self._step, self.upper), np.maximum(x - self._step, self.lower)
        sides = (high, low) if both else (np.where(high > x, high, low),)
        around = np.repeat(x[:, None], len(sides) * which.size, axis=1)
        for i, side in enumerate(sides):
            around[which, i * which.size + np.arange(which.size)] = side[which]
        apart = (sides[0] - (low if both else x))[which]
        return around, np.where(apart != 0, apart, 1.0)


@dataclass(frozen=True)
class _Normal:
    """Gradient and normal matrix at a point, the root of its diagonal, and the parameters that may move there."""

    gradient: FloatArray
    matrix: FloatArray
    diagonal: FloatArray
    free: BoolArray

    def damped(self, dampings: FloatArray) -> list[FloatArray]:
        """Return the scaled matrix of the free parameters with each damping."""
        size = self.diagonal[self.free]
        scaled = self.matrix[np.ix_(self.free, self.free)] / np.outer(size, size)
        return [scaled + lam * np.eye(size.size) for lam in dampings]

    def step(self, damped: FloatArray) -> FloatArray:
        """Return the step of the free parameters with one of `damped`."""
        size = self.diagonal[self.free]
        return np.linalg.solve(damped, -self.gradient[self.free] / size) / size

    def change(self, move: FloatArray) -> float:
        """Return the change of the cost that the residuals' linear model promises."""
        return float(self.gradient @ move + 0.5 * move @ self.matrix @ move)


@dataclass(frozen=True)
class _Tried:
    """Trial points with residuals and costs, the gain that counts as small, and what was foreseen beside the middle."""

    points: FloatArray
    residuals: FloatArray
    costs: FloatArray
    dampings: FloatArray
    small: float
    bent: bool
    foreseen: FloatArray
    apart: FloatArray

    @property
    def best(self) -> int:
        return int(np.argmin(self.costs))


def _cost(residuals: FloatArray) -> FloatArray:
    """Half the sum of squares of each column; infinite where a simulation blew up."""
    with np.errstate(over="ignore", invalid="ignore"):
        cost = 0.5 * np.einsum("nk,nk->k", residuals, residuals)
    return np.where(np.isfinite(cost), cost, np.inf)


def _columns(answers: FloatArray, residual: FloatArray, apart: FloatArray) -> FloatArray:
    """Return derivatives from the residuals at `Descent._probes`, zero where a simulation blew up."""
    behind = answers[:, apart.size :] if answers.shape[1] > apart.size else residual[:, None]
    with np.errstate(invalid="ignore"):
        columns = (answers[:, : apart.size] - behind) / apart
    columns[:, ~np.isfinite(columns).all(axis=0)] = 0.0
    return columns


def _turned(
    x: FloatArray,
    trials: FloatArray,
    changes: FloatArray,
    jacobian: FloatArray,
    damped: Sequence[FloatArray],
    free: BoolArray,
) -> FloatArray:
    """Return trial steps (p, k) that follow the bend of a narrow valley, from what the straight ones did to residuals.

    What a step changes beyond its linear promise is half of the second derivative along it; the step that is best at
    this second order is the geodesic acceleration of Transtrum and Sethna, arXiv:1201.5885 (2012). It is shortened to
    where it is a small correction.

    `x` (p,): where the steps begin. `trials` (p, k): where the straight ones end. `changes` (n, k): what they change of
    the residuals. `jacobian` (n, p): at `x`. `damped` each (f, f): scaled normal matrix of the free parameters for each
    trial, with its damping. `free` (p,): which parameters move.
    """
    size = np.sqrt(np.maximum(np.einsum("np,np->p", jacobian, jacobian), 1e-300))
    turned = trials.copy()
    for k, matrix in enumerate(damped):
        move, turn = trials[:, k] - x, np.zeros_like(x)
        # Next to a blow-up numbers may be too large for their squares.
        with np.errstate(over="ignore", invalid="ignore"):
            strayed = jacobian[:, free].T @ (changes[:, k] - jacobian @ move)
        if not np.isfinite(strayed).all():
            continue
        turn[free] = np.linalg.solve(matrix, -strayed / size[free]) / size[free]
        with np.errstate(over="ignore"):
            straight, off = float(np.linalg.norm(size * move)), float(np.linalg.norm(size * turn))
        share = min(1.0, _TURN * straight / max(off, 1e-300))
        turned[:, k] = x + share * move + share**2 * turn
    return turned
