"""Bounded Levenberg-Marquardt for many problems at once.

Each minimisation is a generator that asks for residuals of a handful of parameter vectors; `minimise` answers all of
them with one simulation call a round. Trial steps with three dampings and the central differences of the Jacobian are
therefore as cheap as one step, and refitting every candidate of a catalogue costs little more than refitting one.
Where few minimisations are left, derivatives where they may go next come along. Parameters that trade with each other
make valleys that are narrow and bent: there steps follow the bend.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.blas import dger

__all__ = ["Minimum", "Request", "Wanted", "levenberg_marquardt", "minimise"]

FloatArray = NDArray[np.float64]
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


Request = Generator[Wanted, FloatArray, "Minimum"]


@dataclass(frozen=True)
class Minimum:
    """Where a minimisation ended.

    Parameters
    ----------
    x : ndarray, shape (p,)
        The minimum.
    cost : float
        Half the sum of squares.
    residual : ndarray, shape (n,)
        Residuals there.
    jacobian : ndarray, shape (n, p)
        Their derivatives.
    at_bound : ndarray of bool, shape (p,)
        Which parameters lie on a bound.
    converged : bool
        Whether the stopping rule was met before the iterations ran out.
    iterations : int
        Number of steps.
    blown : bool
        Whether a simulation on the way blew up.
    """

    x: FloatArray
    cost: float
    residual: FloatArray
    jacobian: FloatArray
    at_bound: NDArray[np.bool_]
    converged: bool
    iterations: int
    blown: bool = False


def _cost(residuals: FloatArray) -> FloatArray:
    """Half the sum of squares of each column; infinite where a simulation blew up."""
    with np.errstate(over="ignore", invalid="ignore"):
        cost = 0.5 * np.einsum("nk,nk->k", residuals, residuals)
    return np.where(np.isfinite(cost), cost, np.inf)


def _probes(
    x: FloatArray, lower: FloatArray, upper: FloatArray, step: FloatArray, which: NDArray[np.int64], *, both: bool
) -> tuple[FloatArray, FloatArray]:
    """Return points (p, k) beside x whose residuals give derivatives, inside the bounds, and how far apart they are.

    Both sides, first all above and then all below, or one; beside a bound always one.
    """
    high, low = np.minimum(x + step, upper), np.maximum(x - step, lower)
    sides = (high, low) if both else (np.where(high > x, high, low),)
    around = np.repeat(x[:, None], len(sides) * which.size, axis=1)
    for i, side in enumerate(sides):
        around[which, i * which.size + np.arange(which.size)] = side[which]
    apart = (sides[0] - (low if both else x))[which]
    return around, np.where(apart != 0, apart, 1.0)


def _columns(answers: FloatArray, residual: FloatArray, apart: FloatArray) -> FloatArray:
    """Return derivatives from the residuals at `_probes`, zero where a simulation blew up."""
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
    free: NDArray[np.bool_],
) -> FloatArray:
    """Return trial steps (p, k) that follow the bend of a narrow valley, from what the straight ones did to residuals.

    What a step changes beyond its linear promise is half of the second derivative along it; the step that is best at
    this second order is the geodesic acceleration of Transtrum and Sethna, arXiv:1201.5885 (2012). It is shortened to
    where it is a small correction.

    Parameters
    ----------
    x : ndarray, shape (p,)
        Where the steps begin.
    trials : ndarray, shape (p, k)
        Where the straight ones end.
    changes : ndarray, shape (n, k)
        What they change of the residuals.
    jacobian : ndarray, shape (n, p)
        At `x`.
    damped : sequence of ndarray, shape (f, f)
        Scaled normal matrix of the free parameters for each trial, with its damping.
    free : ndarray of bool, shape (p,)
        Which parameters move.
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


def levenberg_marquardt(
    start: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    scale: FloatArray,
    *,
    iterations: int = 40,
    tolerance: float = 1e-8,
    jacobian: FloatArray | None = None,
    rough: bool = False,
    is_behind: Callable[[float, int], bool] | None = None,
) -> Request:
    """Minimise half the sum of squared residuals within bounds.

    Parameters
    ----------
    start, lower, upper, scale : ndarray, shape (p,)
        Start (clipped into the bounds), bounds, and the typical size of each parameter.
    iterations : int
        Largest number of steps.
    tolerance : float
        Stop when a step lowers the cost by less than this share of it, or by far less than the noise.
    jacobian : ndarray, shape (n, p), optional
        Derivatives near the start. With it, the search is a quick one: the Jacobian is carried along by Broyden's
        rank-one update (Math. Comp. 19 (1965) 577) and differenced anew only when a step fails; columns of zeros count
        as unknown and are differenced at the start. Without it, it is differenced at every step.
    rough : bool
        Difference to one side only, and carry the Jacobian along as long as steps keep what it promises; the search
        ends on one that was differenced. A quick search also differences to one side. Both take derivatives at the
        middle trial wherever `minimise` sends them along, and carry these to where the step ends.
    is_behind : callable, optional
        Asked before every step, with the cost and the number of steps so far, whether to give up.

    Yields
    ------
    Wanted
        Parameter vectors whose residuals, shape (n, k), are wanted; those of `next` may follow, all or none.

    Returns
    -------
    Minimum
    """
    x = np.clip(np.asarray(start, float), lower, upper)
    quick = jacobian is not None
    step = 1e-6 * scale
    damping = 1e-3
    every = np.arange(x.size)
    both = not (quick or rough)
    unknown = every if jacobian is None else np.flatnonzero(~jacobian.any(axis=0))
    points, apart = _probes(x, lower, upper, step, unknown, both=both)
    answers = yield Wanted(np.concatenate([x[:, None], points], axis=1))
    residual = answers[:, 0]
    jacobian = np.empty((residual.size, x.size), order="F") if jacobian is None else jacobian.copy(order="F")
    jacobian[:, unknown] = _columns(answers[:, 1:], residual, apart)

    def differenced() -> Generator[Wanted, FloatArray, FloatArray]:
        points, apart = _probes(x, lower, upper, step, every, both=both)
        answers = yield Wanted(points)
        return _columns(answers, residual, apart)

    cost = float(_cost(residual[:, None])[0])
    fresh, converged, count = not quick, False, 0
    blown, patience = not np.isfinite(cost), _PATIENCE
    while count < iterations and np.isfinite(cost) and np.isfinite(residual).all():
        if is_behind is not None and is_behind(cost, count):
            break
        count += 1
        gradient = jacobian.T @ residual
        normal = jacobian.T @ jacobian
        diagonal = np.sqrt(np.maximum(np.diag(normal), 1e-300))
        free = ~(((x <= lower) & (gradient > 0)) | ((x >= upper) & (gradient < 0)))
        # What each parameter does over its typical size: a derivative alone depends on the unit.
        effect = diagonal * scale
        free &= effect > 1e-12 * effect.max(initial=0.0)
        if not free.any():
            converged = True
            break
        # Finite differences over a tenth of a standard deviation: far above round-off, far below curvature.
        step = np.clip(0.1 / diagonal, 1e-9 * scale, 1e-3 * scale)
        scaled = normal[np.ix_(free, free)] / np.outer(diagonal[free], diagonal[free])
        push = gradient[free] / diagonal[free]
        dampings = damping * np.array([0.01, 0.3, 10.0])
        damped = [scaled + lam * np.eye(push.size) for lam in dampings]
        trials = np.repeat(x[:, None], 3, axis=1)
        for k, matrix in enumerate(damped):
            move = np.linalg.solve(matrix, -push) / diagonal[free]
            trials[free, k] = np.clip(x[free] + move, lower[free], upper[free])
        # Derivatives at the middle one, from which the others are not far, may come along.
        ahead, apart = _probes(trials[:, 1], lower, upper, step, every[:0] if both else every, both=False)
        answers = yield Wanted(trials, ahead)
        answers, foreseen = answers[:, :3], answers[:, 3:]
        costs = _cost(answers)
        blown = blown or not np.isfinite(costs).all()
        small = max(tolerance * cost, 1e-7 if not quick else 0.05)
        farthest = trials[:, 0] - x
        promised = -(gradient @ farthest + 0.5 * farthest @ normal @ farthest)
        # The valley may be narrow and bent.
        bent = fresh and patience > 0 and promised > small and cost - costs.min() < _BENT * promised
        if bent:
            turned = _turned(x, trials, answers - residual[:, None], jacobian, damped, free)
            turned = np.clip(turned, lower[:, None], upper[:, None])
            more = yield Wanted(turned)
            trials, answers = np.hstack([trials, turned]), np.hstack([answers, more])
            dampings, costs = np.tile(dampings, 2), np.append(costs, _cost(more))
        best = int(np.argmin(costs))
        if bent:
            patience = _PATIENCE if best >= len(damped) else patience - 1
        gain = cost - costs[best]
        if gain > 0:
            moved, changed = trials[:, best] - x, answers[:, best] - residual
            x, residual, cost = trials[:, best], answers[:, best], float(costs[best])
            damping = float(np.clip(dampings[best], 1e-12, 1e12))
        if gain > small:
            kept = gain > -_KEPT * (gradient @ moved + 0.5 * moved @ normal @ moved)
            carried = quick or (rough and not bent and kept)
            known = foreseen.size > 0 and costs[1] < cost + gain and bool(np.isfinite(foreseen).all())
            if known:
                jacobian = _columns(foreseen, answers[:, 1], apart)
                moved, changed = x - trials[:, 1], residual - answers[:, 1]
                carried = best != 1
            if carried:
                weighted = diagonal**2 * moved
                # In place: it is the same array, by columns.
                share = 1.0 / max(weighted @ moved, 1e-300)
                jacobian = dger(share, changed - jacobian @ moved, weighted, a=jacobian, overwrite_a=1)
            elif not known:
                jacobian = yield from differenced()
            fresh = not carried
        elif (gain > 0 or damping > 1e9) and (fresh or quick):
            # A tiny step: the end, unless the Jacobian is only carried along.
            converged = True
            break
        elif fresh:
            damping *= 100.0
        else:
            jacobian = yield from differenced()
            fresh = True
    return Minimum(
        x,
        cost,
        residual=residual,
        jacobian=jacobian,
        at_bound=(x <= lower) | (x >= upper),
        converged=converged,
        iterations=count,
        blown=blown,
    )


def minimise(
    requests: Sequence[Request],
    answer: Callable[[list[tuple[int, FloatArray]]], list[FloatArray]],
    at_once: int = 0,
) -> list[Minimum]:
    """Run several minimisations together.

    Parameters
    ----------
    requests : sequence of generators
        From `levenberg_marquardt`.
    answer : callable
        Given a list of (index of the problem, parameter vectors (p, k)), return the residuals (n, k) of each.
    at_once : int
        So many points are answered in the time of one: those that nobody needs go to what may be wanted next.

    Returns
    -------
    list of Minimum
        In the order of `requests`.
    """
    results: list[Minimum | None] = [None] * len(requests)
    pending = {i: next(request) for i, request in enumerate(requests)}
    while pending:
        asked = [(i, wanted.points) for i, wanted in pending.items()]
        left = at_once - sum(points.shape[1] for _, points in asked)
        for k, (i, points) in enumerate(asked):
            ahead = pending[i].next
            if 0 < ahead.shape[1] <= left:
                asked[k] = i, np.concatenate([points, ahead], axis=1)
                left -= ahead.shape[1]
        for (i, _), residuals in zip(asked, answer(asked), strict=True):
            try:
                pending[i] = requests[i].send(residuals)
            except StopIteration as stop:
                results[i] = stop.value
                del pending[i]
    return [result for result in results if result is not None]
