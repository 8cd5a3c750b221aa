"""Laplace's method for the parameters of a linearised model under one size of the model error.

The posterior is Gaussian around the generalised least squares estimate, within bounds, and drawn towards the means of
Gaussian priors: of two parameters that do the same, only these tell where between them a fit ends. The size of the
white noise is that of the highest likelihood, never below what is stated (MacKay, Information Theory, Inference and
Learning Algorithms, 2003, chapter 27).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.linalg import block_diag
from scipy.linalg.lapack import dgelsd, dgelsd_lwork, dgetrf
from scipy.optimize import lsq_linear

from discovery.estimation.problem import Problem
from discovery.foundation.arrays import BoolArray, FloatArray
from discovery.foundation.compiled_function import compiled

_LOG_2PI = float(np.log(2 * np.pi))
#: Scale of the half-Cauchy prior by which the noise exceeds what is stated, and rounds to its size.
_NOISE_SCALE, _ROUNDS = 0.1, 3
#: A direction of which the readings tell less than this share of the best told one is left where it is.
_BLIND = 1e-13
#: What rounding leaves of a pivot of one, where two parameters do the same.
_ROUNDED = float(np.finfo(float).eps)


@dataclass(frozen=True)
class Mode:
    """The posterior of the parameters for one size of the model error."""

    log_evidence: float  # the size given
    white: float  # standard deviation of the noise [stated noise sds], at least one
    step: FloatArray  # (p,), from the linearisation to the mode
    precision: FloatArray  # (p, p), inverse covariance
    gained: float  # by how much the step raises the logarithm of the posterior


@dataclass(frozen=True)
class Prior:
    """What is believed of the parameters of a linear problem."""

    mean: FloatArray  # (p,), where the Gaussian ones have their mean
    precision: FloatArray  # (p, p), inverse covariance, of other priors from their widths
    pull: FloatArray  # (p, p), the part of it that is Gaussian: others are flat on the scale of the posterior
    log_density: float  # at the means, else at the linearisation
    #: low, high, frozen: as for a belief.
    low: FloatArray
    high: FloatArray
    frozen: BoolArray

    @classmethod
    def of(cls, belief: Belief, p: int) -> Prior:
        """Return the prior of the first parameters of a belief."""
        known = np.isfinite(belief.centre[:p])
        precision = 1.0 / belief.width[:p] ** 2
        mean = np.where(known, belief.centre[:p], 0.0)
        pull = np.diag(np.where(known, precision, 0.0))
        log = float(belief.log_density[:p].sum())
        return cls(mean, np.diag(precision), pull, log, belief.low[:p], belief.high[:p], belief.frozen[:p])

    def after(self, mode: Mode, belief: Belief) -> Prior:
        """Return the prior of held-out recordings: the posterior of the training ones, and initial states."""
        p, states = len(self.mean), belief.width[len(self.mean) :]
        whole = block_diag(mode.precision, np.diag(1.0 / states**2))
        pull = block_diag(mode.precision, np.zeros((states.size, states.size)))
        log = 0.5 * (float(np.linalg.slogdet(mode.precision)[1]) - p * _LOG_2PI) + float(belief.log_density[p:].sum())
        mean = np.append(mode.step, np.zeros(states.size))
        return Prior(mean, whole, pull, log, belief.low, belief.high, belief.frozen)


def mode_of(gram: FloatArray, logarithms: float, count: int, prior: Prior) -> Mode:
    """Return the posterior mode of a linear problem with scalar products of (derivatives, residual).

    The stated noise may be too small: its size is that of the highest likelihood, never below what is stated.
    """
    white = 1.0
    mode, left = _at_noise(gram, logarithms, count, prior, white)
    for _ in range(_ROUNDS):
        if not left > count:
            break
        white *= float(np.sqrt(left / count))
        mode, left = _at_noise(gram, logarithms, count, prior, white)
    return mode


def _at_noise(gram: FloatArray, logarithms: float, count: int, prior: Prior, white: float) -> tuple[Mode, float]:
    """Return the mode for one size of the noise, and the quadratic form of the residual that it leaves."""
    p, gram = len(gram) - 1, gram / white**2
    precision, scaled, push, size = _normal(gram, prior.precision, prior.pull, prior.mean)
    if not np.isfinite(scaled).all():
        raise np.linalg.LinAlgError("a quadratic form is not finite")
    triangles = dgetrf(scaled)[0] if p > 0 else scaled
    step = bounded_step(scaled, push, prior.low / size, prior.high / size, ~prior.frozen) * size
    left, pulled, stayed, determinant = _forms(gram, prior.pull, prior.mean, step, triangles, size)
    constant = logarithms + count * (_LOG_2PI + 2 * np.log(white)) - p * _LOG_2PI
    # Half-Cauchy prior of what exceeds the stated noise.
    exceeds = -float(np.log1p(((white - 1.0) / _NOISE_SCALE) ** 2))
    log = -0.5 * (left + pulled + constant + determinant) + prior.log_density + exceeds
    gained = 0.5 * float(gram[p, p] + stayed - left - pulled)
    return Mode(float(log), white, step, precision, gained), left


def bounded_step(
    matrix: FloatArray, push: FloatArray, low: FloatArray, high: FloatArray, free: BoolArray
) -> FloatArray:
    """Return the step that minimises a quadratic form within bounds."""
    step = _free_step(matrix, push, free)
    if ((step < low) | (step > high)).any():
        # A root of the form in which the directions that the free step leaves alone are told to rest, by that share:
        # bounds may move nothing along them, and nothing else does.
        told, axes = np.linalg.eigh(matrix[np.ix_(free, free)])
        kept, root = told > _BLIND * told[-1], np.sqrt(np.maximum(told, _BLIND * told[-1]))
        limits = np.minimum(low[free], 0.0), np.maximum(high[free], 1e-300)
        target = np.where(kept, -(push[free] @ axes) / root, 0.0)
        step[free] = lsq_linear((axes * root).T, target, limits, method="bvls").x
        step[free] = np.clip(step[free], *limits)  # its solver may miss a bound by a rounding
    return step


def _free_step(matrix: FloatArray, push: FloatArray, free: BoolArray) -> FloatArray:
    """Return the shortest step that minimises a quadratic form, of which some parameters are free."""
    where, step = np.flatnonzero(free), np.zeros(push.size)
    if where.size == 0:
        return step
    found, *_, failed = dgelsd(matrix[where][:, where], push[where], *_workspace(where.size), cond=_BLIND)
    if failed:
        raise np.linalg.LinAlgError("a quadratic form could not be taken apart")
    step[where] = -found
    return step


@cache
def _workspace(n: int) -> tuple[int, int]:
    """Return how much memory the least-squares solver asks for to be at its fastest."""
    size, whole, _ = dgelsd_lwork(n, n, 1, cond=_BLIND)
    return int(size), int(whole)


@compiled(nogil=True, error_model="numpy")
def _normal(gram, known, pull, mean):
    # Precision of a posterior, the same and its push for parameters of size one, and these sizes.
    p = len(mean)
    precision, scaled, push, size = np.empty((p, p)), np.empty((p, p)), np.empty(p), np.empty(p)
    for i in range(p):
        for j in range(p):
            precision[i, j] = gram[i, j] + known[i, j]
        size[i] = 1.0 / math.sqrt(precision[i, i])
    for i in range(p):
        pulled = 0.0
        for j in range(p):
            scaled[i, j] = precision[i, j] * (size[i] * size[j])
            pulled += pull[i, j] * mean[j]
        push[i] = (gram[i, p] - pulled) * size[i]
    return precision, scaled, push, size


@compiled(nogil=True, error_model="numpy")
def _forms(gram, pull, mean, step, triangles, size):
    # Quadratic forms of the residual that a step leaves, and of how far the step, and none, is from the prior's mean;
    # logarithm of the determinant of what was taken apart into triangles, for parameters of their own sizes.
    p = len(step)
    left, pulled, stayed = gram[p, p], 0.0, 0.0
    determinant, sizes = 0.0, 0.0
    for i in range(p):
        ahead, moved, rested = 0.0, 0.0, 0.0
        for j in range(p):
            ahead += gram[i, j] * step[j]
            moved += pull[i, j] * (step[j] - mean[j])
            rested += pull[i, j] * mean[j]
        left += 2.0 * step[i] * gram[i, p] + step[i] * ahead
        pulled += (step[i] - mean[i]) * moved
        stayed += mean[i] * rested
        determinant += math.log(max(abs(triangles[i, i]), _ROUNDED))
        sizes += math.log(size[i])
    return left, pulled, stayed, determinant - 2.0 * sizes


@dataclass(frozen=True)
class Belief:
    """What is believed of every parameter before the recordings."""

    log_density: FloatArray  # (p,), logarithm of each prior at its centre, else at the linearisation
    width: FloatArray  # (p,), width of each prior
    centre: FloatArray  # (p,), its mean less the linearisation, NaN where it has none
    #: low, high (p,): bounds less the linearisation.
    low: FloatArray
    high: FloatArray
    frozen: BoolArray  # (p,), what lies on a bound and does not move


def belief_of(problem: Problem, x: FloatArray, at_bound: BoolArray, more: Sequence[float]) -> Belief:
    """Return what is believed of every parameter; last are held-out starts, whose priors are `more` wide."""
    log, width, centre = [], [], []
    for value, own in zip(x[: len(problem.free)], problem.priors, strict=False):
        at, spread = value if np.isnan(own.centre) else own.centre, own.width_at(value)
        log.append(max(float(own.log_density(at)), -1e3) if own.is_proper else -np.log(spread * np.sqrt(2 * np.pi)))
        width.append(spread)
        centre.append(own.centre - value)
    sizes = [*(state.width for state in problem.states), *more]
    log += [-np.log(s * np.sqrt(2 * np.pi)) for s in sizes]
    low, high = problem.bounds
    return Belief(
        np.array(log),
        np.array([*width, *sizes]),
        np.array([*centre, *([np.nan] * len(sizes))]),
        np.append(low - x, np.full(len(more), -np.inf)),
        np.append(high - x, np.full(len(more), np.inf)),
        np.append(at_bound, np.zeros(len(more), bool)),
    )
