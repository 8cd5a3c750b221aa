"""One set of parameters for many recordings, each with its own initial state, by Gauss and Newton.

The initial states are projected out recording by recording, so that a hundred recordings cost a hundred times one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from discovery.estimation.problem import Problem

FloatArray = NDArray[np.float64]
_ITERATIONS = 30
_SETTLED = 1e-4  # of a standard deviation


@dataclass(frozen=True)
class Pooled:
    """The common least-squares estimate of several recordings.

    Parameters
    ----------
    x : ndarray, shape (p,)
        Parameters, in the order of the problems' `free`.
    information : ndarray, shape (p, p)
        Of all recordings and of what the rig knows, at the stated noise.
    shares : ndarray, shape (m, p, p)
        That of each recording.
    scores : ndarray, shape (m, p)
        Gradient of each recording's half sum of squares.
    variance : float
        Residual sum of squares over degrees of freedom, at the stated noise.
    """

    x: FloatArray
    information: FloatArray
    shares: FloatArray
    scores: FloatArray
    variance: float

    @property
    def naive(self) -> FloatArray:
        """Covariance (p, p) if residuals were independent, with their own size as noise."""
        return np.linalg.inv(self.information) * self.variance

    @property
    def clustered(self) -> FloatArray:
        """Covariance (p, p) from how recordings differ: nothing is assumed of the residuals within one.

        The jackknife that leaves out one recording after the other, linearised: of the estimators for few clusters the
        one that errs on the safe side (R. Bell, D. McCaffrey, Survey Methodology 28 (2002) 169).
        """
        m = len(self.scores)
        moved = np.linalg.solve(self.information - self.shares, self.scores[..., None])[..., 0]
        return (m - 1) / m * moved.T @ moved


def _linearised(problem: Problem, x: FloatArray, step: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return residual (n,) and central differences (n, p + 2) at a free vector."""
    moves = np.diag(step)
    points = np.concatenate([x[:, None], x[:, None] + moves, x[:, None] - moves], axis=1)
    rows = problem.bench.residuals(*problem.expand(points))
    return rows[:, 0], (rows[:, 1 : x.size + 1] - rows[:, x.size + 1 :]) / (2 * step)


def pooled(problems: Sequence[Problem], starts: Sequence[FloatArray]) -> Pooled:
    """Return the common estimate of problems that differ in their recording only.

    Parameters
    ----------
    problems : sequence of Problem
        One recording each.
    starts : sequence of ndarray, shape (p + 2,)
        Estimate of each alone: parameters, then its initial state.

    Raises
    ------
    RuntimeError
        If it does not settle.
    """
    first = problems[0]
    p = len(first.free)
    x = np.mean([s[:p] for s in starts], axis=0)
    states = [s[p:].copy() for s in starts]
    known = np.array([first.gaussian.get(n, (0.0, np.inf)) for n in first.free])
    steps = [1e-5 * problem.scale for problem in problems]
    for _ in range(_ITERATIONS):
        information, gradient = np.diag(known[:, 1] ** -2.0), (x - known[:, 0]) * known[:, 1] ** -2.0
        parts, shares, scores, left, rows = [], [], [], 0.0, 0
        for i, problem in enumerate(problems):
            residual, jacobian = _linearised(problem, np.concatenate([x, states[i]]), steps[i])
            steps[i] = 0.1 / np.linalg.norm(jacobian, axis=0)
            inverse = np.linalg.pinv(jacobian[:, p:])
            seen = np.column_stack([jacobian[:, :p], residual])
            own = inverse @ seen
            seen = seen - jacobian[:, p:] @ own
            shares.append(seen[:, :p].T @ seen[:, :p])
            scores.append(seen[:, :p].T @ seen[:, p])
            parts.append(own)
            left += float(seen[:, p] @ seen[:, p])
            rows += problem.bench.n_data - 2
        information = information + np.sum(shares, axis=0)
        move = -np.linalg.solve(information, gradient + np.sum(scores, axis=0))
        if move @ information @ move < _SETTLED**2:
            return Pooled(x, information, np.array(shares), np.array(scores), left / (rows - p))
        x = x + move
        states = [s - own[:, p] - own[:, :p] @ move for s, own in zip(states, parts, strict=True)]
    raise RuntimeError(f"the common fit of {len(problems)} recordings did not settle in {_ITERATIONS} steps")
