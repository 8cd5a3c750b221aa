"""What is believed of the parameters before the recordings: declared priors, what the rig states, initial states."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from discovery.declarations.parameters import Flat, HalfStudent, LogNormal
from discovery.estimation.problem import Problem
from discovery.foundation.arrays import BoolArray, FloatArray


@dataclass(frozen=True)
class Belief:
    """What is believed of every parameter before the recordings.

    Parameters
    ----------
    log_density : ndarray, shape (p,)
        Logarithm of each prior at the linearisation; of what the rig states, at its mean.
    width : ndarray, shape (p,)
        Width of each prior.
    centre : ndarray, shape (p,)
        Mean of what the rig states, NaN elsewhere.
    low, high : ndarray, shape (p,)
        Bounds less the linearisation.
    frozen : ndarray of bool, shape (p,)
        What lies on a bound and does not move.
    """

    log_density: FloatArray
    width: FloatArray
    centre: FloatArray
    low: FloatArray
    high: FloatArray
    frozen: BoolArray


def belief_of(problem: Problem, x: FloatArray, at_bound: BoolArray, more: Sequence[float]) -> Belief:
    """Return what is believed of every parameter; last are held-out starts, whose priors are `more` wide."""
    free, units = problem.free, problem.units
    log, width, centre = [], [], []
    for name, value in zip(free, x, strict=False):
        if name in problem.gaussian:
            mean, sd = problem.gaussian[name]
            log.append(-np.log(sd * np.sqrt(2 * np.pi)))
            width.append(sd)
            centre.append(mean - value)
            continue
        parameter = problem.model.parameters[name]
        scale = units.scale(parameter)
        own = _width(parameter.prior, value / scale) * scale
        density = float(parameter.prior.log_density(value / scale)) - np.log(scale)
        flat = isinstance(parameter.prior, Flat)
        log.append(-np.log(own * np.sqrt(2 * np.pi)) if flat else max(density, -1e3))
        width.append(own)
        centre.append(np.nan)
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


def _width(prior: object, value: float) -> float:
    """Return the width of a prior at a value [natural units]: that of a scale, or with a heavy tail, grows with it."""
    if isinstance(prior, LogNormal):
        return max(abs(value), 1e-3 * prior.median) * prior.log_sd
    if isinstance(prior, HalfStudent):
        return float(np.sqrt((3 * prior.scale**2 + value**2) / 4))
    return float(prior.width)  # type: ignore[attr-defined]
