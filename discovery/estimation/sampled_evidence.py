"""What Laplace's method misses of an evidence: bent valleys and bounds, by importance sampling.

Draws around the posterior mode are simulated and weighed by the likelihood under the noise and the model error, whose
sizes stay those of the mode. The mean of their weights over the integral of Laplace's normal distribution corrects the
log evidence; the shape of the largest weights tells whether it can be trusted, see `discovery.estimation.importance`.
A parameter whose mode lies on a bound has half a normal distribution: it is mirrored there, the others with it as they
hang together, which makes it whole.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.random import Generator

from discovery.estimation.importance import importance_sample
from discovery.estimation.laplace import Mode, Prior
from discovery.estimation.linear_problem import Linearised
from discovery.estimation.model_error import ModelError, innovations
from discovery.estimation.problem import Problem
from discovery.foundation.arrays import FloatArray
from discovery.foundation.errors import ComputationError

#: Draws of a round that adapts, and of the last one, and how often: together no more simulations than a fit takes.
_PILOT, _DRAWS, _ROUNDS, _REPAIRS = 256, 384, 2, 3


@dataclass(frozen=True)
class Sampled:
    """What importance sampling says of Laplace's log evidence."""

    #: correction, error: what it adds, and its standard error [nats]; none where it cannot be trusted.
    correction: float
    error: float
    pareto_k: float  # shape of the largest weights; infinite where hardly a draw has a finite density
    reliable: bool  # whether the draws can be trusted

    @property
    def numbers(self) -> dict[str, float]:
        """What a report tells of it."""
        return {"correction": self.correction, "error": self.error, "pareto_k": self.pareto_k}


def sampled(problem: Problem, x: FloatArray, linear: Linearised, size: float, rng: Generator) -> Sampled:
    """Correct the log evidence of the training recordings for what is not normal about the posterior.

    `problem`: what was fitted. `x` (p,): where it was linearised. `linear`: its linearisation there. `size`: size of
    the model error over the noise. `rng`: source of the draws.
    """
    target = _Target(problem, x, linear, size)
    try:
        drawn = importance_sample(target, x.size, rng, _DRAWS, _PILOT, rounds=_ROUNDS, repairs=_REPAIRS)
    except ComputationError:
        return Sampled(0.0, np.inf, np.inf, reliable=False)
    correction = drawn.log_integral - 0.5 * x.size * float(np.log(2 * np.pi))
    return Sampled(correction if drawn.reliable else 0.0, drawn.error, drawn.pareto_k, drawn.reliable)


class _Target:
    """Log posterior density over that at the mode of the linear problem, in coordinates that make it normal there."""

    def __init__(self, problem: Problem, x: FloatArray, linear: Linearised, size: float) -> None:
        error = ModelError.of(size, linear.natural_time)
        self.problem = replace(problem, error=error)
        self.prior: Prior = Prior.of(linear.belief, x.size)
        mode: Mode = linear.mode(size)
        self.white, self.centre, self.origin = mode.white, x + mode.step, x
        scale = 1.0 / np.sqrt(np.diag(mode.precision))
        root = np.linalg.cholesky(mode.precision * np.outer(scale, scale))
        self.factor = scale[:, None] * np.linalg.inv(root).T
        low, high = mode.step <= self.prior.low, mode.step >= self.prior.high
        self.on_bound = low | high
        self.bound = np.where(low, *self.problem.bounds)[self.on_bound, None]
        self.inwards = np.where(low, 1.0, -1.0)[self.on_bound, None]
        covariance = self.factor @ self.factor[self.on_bound].T
        self.along = covariance @ np.linalg.inv(covariance[self.on_bound])
        left = (innovations(c.time, c.left(mode.step)[:, None], error)[0] for c in linear.train)
        squares = sum(float(np.sum(white**2)) for white in left)
        self.least = squares / self.white**2 + float(self._pulled(mode.step[:, None])[0])

    def __call__(self, points: FloatArray) -> FloatArray:
        """Return the log density of points (k, p), minus infinity out of bounds and for what blows up."""
        x = self.centre[:, None] + self.factor @ points.T
        low, high = self.problem.bounds
        beyond = np.maximum(-self.inwards * (x[self.on_bound] - self.bound), 0.0)
        x += self.along @ (2 * self.inwards * beyond)
        inside = ((x >= low[:, None]) & (x <= high[:, None])).all(axis=0)
        found = np.full(len(points), -np.inf)
        if inside.any():
            near = x[:, inside]
            found[inside] = -0.5 * (self._squares(near) + self._pulled(near - self.origin[:, None]) - self.least)
        return found - len(self.bound) * float(np.log(2.0))  # each mirror doubles the integral

    def _pulled(self, step: FloatArray) -> FloatArray:
        off = step - self.prior.mean[:, None]
        return np.einsum("ik,ij,jk->k", off, self.prior.pull, off)

    def _squares(self, x: FloatArray) -> FloatArray:
        """Return what the recordings leave of the noise made white under the model error, for each column."""
        with np.errstate(invalid="ignore", over="ignore"):
            left = self.problem.whitened(self.problem.bench.residuals(*self.problem.expand(x)))
            total = np.einsum("nk,nk->k", left, left) / self.white**2
        return np.where(np.isfinite(total), total, np.inf)
