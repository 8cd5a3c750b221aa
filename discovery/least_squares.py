"""Bounded Levenberg-Marquardt for many problems at once.

Each minimisation is a generator that asks for residuals of a handful of parameter vectors; `minimise` answers all of
them with one simulation call a round. Trial steps with three dampings and the central differences of the Jacobian are
therefore as cheap as one step, and refitting every candidate of a catalogue costs little more than refitting one.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Minimum", "levenberg_marquardt", "minimise"]

FloatArray = NDArray[np.float64]
Request = Generator[FloatArray, FloatArray, "Minimum"]


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
        Number of Jacobians.
    """

    x: FloatArray
    cost: float
    residual: FloatArray
    jacobian: FloatArray
    at_bound: NDArray[np.bool_]
    converged: bool
    iterations: int


def _cost(residuals: FloatArray) -> FloatArray:
    """Half the sum of squares of each column; infinite where a simulation blew up."""
    with np.errstate(over="ignore", invalid="ignore"):
        cost = 0.5 * np.einsum("nk,nk->k", residuals, residuals)
    return np.where(np.isfinite(cost), cost, np.inf)


def levenberg_marquardt(
    start: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    scale: FloatArray,
    *,
    iterations: int = 40,
    tolerance: float = 1e-8,
) -> Request:
    """Minimise half the sum of squared residuals within bounds.

    Parameters
    ----------
    start, lower, upper, scale : ndarray, shape (p,)
        Start (clipped into the bounds), bounds, and the typical size of each parameter.
    iterations : int
        Largest number of Jacobians.
    tolerance : float
        Stop when the predicted decrease of the cost is below this share of it, or far below the noise.

    Yields
    ------
    ndarray, shape (p, k)
        Parameter vectors whose residuals, shape (n, k), are wanted.

    Returns
    -------
    Minimum
    """
    x = np.clip(np.asarray(start, float), lower, upper)
    p = x.size
    step = 1e-6 * scale
    damping = 1e-3
    residual = cost = None
    jacobian = np.empty((0, p))
    converged = False
    count = 0
    for count in range(1, iterations + 1):
        # Central differences; one-sided where a bound is in the way.
        high, low = np.minimum(x + step, upper), np.maximum(x - step, lower)
        points = np.concatenate([x[:, None], x[:, None] + np.diag(high - x), x[:, None] + np.diag(low - x)], axis=1)
        answers = yield points
        residual = answers[:, 0]
        cost = float(_cost(answers[:, :1])[0])
        if not np.isfinite(cost):
            break
        jacobian = (answers[:, 1 : p + 1] - answers[:, p + 1 :]) / np.where(high > low, high - low, 1.0)
        jacobian[:, ~np.isfinite(jacobian).all(axis=0)] = 0.0
        gradient = jacobian.T @ residual
        normal = jacobian.T @ jacobian
        free = ~(((x <= lower) & (gradient > 0)) | ((x >= upper) & (gradient < 0)))
        diagonal = np.sqrt(np.maximum(np.diag(normal), 1e-300))
        free &= diagonal > 1e-12 * diagonal.max(initial=1e-300)
        if not free.any():
            converged = True
            break
        # Finite differences over a tenth of a standard deviation: far above round-off, far below curvature.
        step = np.clip(0.1 / diagonal, 1e-9 * scale, 1e-3 * scale)
        scaled = normal[np.ix_(free, free)] / np.outer(diagonal[free], diagonal[free])
        push = gradient[free] / diagonal[free]
        improved = False
        for _ in range(6):
            dampings = damping * np.array([0.01, 0.3, 10.0])
            trials = np.repeat(x[:, None], 3, axis=1)
            for k, lam in enumerate(dampings):
                move = np.linalg.solve(scaled + lam * np.eye(push.size), -push) / diagonal[free]
                trials[free, k] = np.clip(x[free] + move, lower[free], upper[free])
            costs = _cost((yield trials))
            best = int(np.argmin(costs))
            if costs[best] < cost:
                improved = True
                break
            damping *= 100.0
            if damping > 1e12:
                break
        if not improved:
            converged = True
            break
        damping = float(np.clip(dampings[best], 1e-12, 1e12))
        gain = cost - costs[best]
        x = trials[:, best]
        if gain < max(tolerance * cost, 1e-7):
            converged = True
            # The Jacobian of the last but one point serves: the step was far below a standard deviation.
            residual, cost = (yield x[:, None])[:, 0], float(costs[best])
            break
    assert residual is not None
    assert cost is not None
    return Minimum(x, cost, residual, jacobian, (x <= lower) | (x >= upper), converged, count)


def minimise(
    requests: Sequence[Request],
    answer: Callable[[list[tuple[int, FloatArray]]], list[FloatArray]],
    *,
    on_round: Callable[[int], None] | None = None,
) -> list[Minimum]:
    """Run several minimisations together.

    Parameters
    ----------
    requests : sequence of generators
        From `levenberg_marquardt`.
    answer : callable
        Given a list of (index of the problem, parameter vectors (p, k)), return the residuals (n, k) of each.
    on_round : callable, optional
        Called with the number of unfinished problems after every round.

    Returns
    -------
    list of Minimum
        In the order of `requests`.
    """
    results: list[Minimum | None] = [None] * len(requests)
    pending = {i: next(request) for i, request in enumerate(requests)}
    while pending:
        order = list(pending)
        answers = answer([(i, pending[i]) for i in order])
        for i, residuals in zip(order, answers, strict=True):
            try:
                pending[i] = requests[i].send(residuals)
            except StopIteration as stop:
                results[i] = stop.value
                del pending[i]
        if on_round is not None:
            on_round(len(pending))
    return [result for result in results if result is not None]
