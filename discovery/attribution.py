"""Which effect explains a residual: sensitivities of the whole catalogue in one call.

The score of a candidate is how much of chi-square its linear effect could remove once the fitted parameters have
absorbed what they can. Scores only rank and provide starts, see `discovery.refits`: finite effects mislead linear
scores.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from discovery.effect import ARM, Effect
from discovery.least_squares import Minimum
from discovery.model import Model
from discovery.parameters import Parameter
from discovery.problem import Bench, NaturalUnits, Problem
from discovery.registry import catalogue

__all__ = ["Candidate", "Direction", "candidates", "grid_of", "screen"]

FloatArray = NDArray[np.float64]
#: Grid of shape parameters scanned for an effect, in declared natural units, where its declaration gives no starts.
_SHAPE_GRID = 48
#: An effect with at most so many shapes is tried at each of its declared sizes, else at the smallest.
_FEW_SHAPES = 12
#: Starts of a refit differ: the cosine between their sensitivities is at most this,
_DISTINCT = 0.9
#: and they are chosen among so many of the best.
_COMPARED = 24
_STARTS = 3


@dataclass(frozen=True)
class Direction:
    """What one shape of an effect could do to the residual.

    Parameters
    ----------
    basis : ndarray of float32, shape (n, k)
        Orthonormal directions of its amplitudes, orthogonal to what the fitted parameters absorb.
    gain : float
        Chi-square that it removes within its bounds.
    """

    basis: NDArray[np.float32]
    gain: float


@dataclass(frozen=True)
class Candidate:
    """One candidate effect with its linear score.

    Parameters
    ----------
    effect : str
        Id.
    score : float
        Chi-square that its linear sensitivity removes, fitted parameters re-adjusted.
    starts : tuple of (values, Jacobian columns)
        Best start values of a refit, with the sensitivity of each.
    sensitivity : ndarray, shape (n, k)
        Projected sensitivity of the best start (orthogonal to what fitted parameters absorb), normalised columns.
    directions : tuple of Direction
        Every shape on the grid.
    """

    effect: str
    score: float
    starts: tuple[tuple[FloatArray, FloatArray], ...]
    sensitivity: FloatArray
    directions: tuple[Direction, ...] = ()


def candidates(model: Model, unit: str = "rad") -> tuple[str, ...]:
    """Return the effects that could be missing: those that act on this system, not in the model, not in its base.

    Parameters
    ----------
    model : Model
        The model.
    unit : str
        Unit of an oscillator's coordinate: laws of an angle ask for radians.
    """
    base = model.mechanics
    return tuple(
        e
        for e, effect in catalogue().items()
        if base.system in effect.systems
        and e not in model.effects
        and e not in base.provides
        and (base.system == ARM or unit == "rad" or not effect.angular)
    )


def _sizes(parameter: Parameter) -> list[float]:
    """Return the declared sizes of an amplitude, smallest first: small enough to be linear, large enough to matter."""
    return sorted({abs(v) for v in parameter.starts if v}) or [1e-3 * parameter.prior.width]


def grid_of(effect: Effect, system: str, units: NaturalUnits) -> list[dict[str, float]]:
    """Return finite values of an effect in the problem's units: a grid over shapes and sizes."""
    shapes = [p for p in effect.fitted(system) if p.shape]
    amplitudes = [p for p in effect.fitted(system) if not p.shape]
    grids: list[dict[str, float]] = [{}]
    for p in shapes:
        low, high = max(p.bounds[0], 1e-3 * p.prior.width), p.bounds[1]
        values = p.starts or tuple(np.geomspace(low, min(high, 20 * p.prior.width), _SHAPE_GRID))
        grids = [{**g, p.name: v * units.scale(p)} for g in grids for v in values]
    sizes = {p: _sizes(p) for p in amplitudes}
    levels = max((len(s) for s in sizes.values()), default=1) if len(grids) <= _FEW_SHAPES else 1
    return [
        {**g, **{p.name: s[min(level, len(s) - 1)] * units.scale(p) for p, s in sizes.items()}}
        for g in grids
        for level in range(levels)
    ]


@dataclass(frozen=True)
class _Trial:
    """One point of the grid of an effect."""

    values: dict[str, float]
    amplitudes: tuple[Parameter, ...]
    where: slice


def _simulated(bench: Bench, columns: Sequence[FloatArray], initial: FloatArray, n_rows: int) -> FloatArray:
    """Return the residuals (n, k) of all parameter columns; memory stays bounded: a few hundred at a time."""
    parameters = np.stack(columns, axis=1)
    starts = np.repeat(initial, parameters.shape[1], axis=2)
    width = max(64, int(4e7 / max(1, n_rows)))
    found = np.empty((n_rows, parameters.shape[1]))
    for a in range(0, parameters.shape[1], width):
        found[:, a : a + width] = bench.residuals(parameters[:, a : a + width], starts[:, :, a : a + width])
    return found


def screen(
    model: Model, minimum: Minimum, problem: Problem, names: Sequence[str], *, keep: int = _STARTS
) -> list[Candidate]:
    """Score candidate effects by their sensitivities around a fitted model, all in one batched simulation.

    Parameters
    ----------
    model : Model
        The fitted model.
    minimum : Minimum
        Its minimum on `problem`.
    problem : Problem
        Its bench must contain every candidate.
    names : sequence of str
        Candidate effect ids.
    keep : int
        Number of starts kept for each.

    Returns
    -------
    list of Candidate
        Highest score first.
    """
    bench, units, system = problem.bench, problem.units, model.mechanics.system
    base, initial = problem.expand(minimum.x[:, None])
    n_rows = bench.n_rows
    columns: list[FloatArray] = []
    plan: dict[str, list[_Trial]] = {name: [] for name in names}
    for name in names:
        amplitudes = tuple(p for p in catalogue()[name].fitted(system) if not p.shape)
        own = {p.name for p in amplitudes}
        for values in grid_of(catalogue()[name], system, units):
            plan[name].append(_Trial(values, amplitudes, slice(len(columns), len(columns) + len(amplitudes))))
            for p in amplitudes:
                column = base[:, 0].copy()
                for other, value in values.items():
                    if other == p.name or other not in own:
                        column[bench.names.index(other)] = value
                columns.append(column)
    moved = _simulated(bench, columns, initial, n_rows)
    reference = minimum.residual[:n_rows]
    moved -= reference[:, None]
    moved[:, ~np.isfinite(moved).all(axis=0)] = 0.0
    known, _ = np.linalg.qr(minimum.jacobian[:n_rows])
    target = reference - known @ (known.T @ reference)
    projected = moved - known @ (known.T @ moved)
    push = projected.T @ target
    result = []
    for name, trials in plan.items():
        fitted = catalogue()[name].fitted(system)
        options = sorted((_weigh(t, projected, push, units, fitted) for t in trials), key=lambda o: -o.direction.gain)
        starts = tuple((o.vector, _columns(o.trial, moved, fitted)) for o in _distinct(options, keep))
        first = projected[:, options[0].trial.where]
        sensitivity = first / np.maximum(np.linalg.norm(first, axis=0), 1e-300)
        result.append(
            Candidate(name, options[0].direction.gain, starts, sensitivity, tuple(o.direction for o in options))
        )
    return sorted(result, key=lambda c: -c.score)


@dataclass(frozen=True)
class _Option:
    """One point of the grid with its best amplitudes: a start of a refit."""

    trial: _Trial
    direction: Direction
    vector: FloatArray


def _weigh(
    trial: _Trial,
    projected: FloatArray,
    push: FloatArray,
    units: NaturalUnits,
    fitted: Sequence[Parameter],
) -> _Option:
    """Find the bounded amplitudes that remove most of the residual: a small problem in the triangular factor."""
    part = projected[:, trial.where]
    size = np.array([trial.values[p.name] for p in trial.amplitudes])
    basis, upper_factor = np.linalg.qr(part)
    lower = np.array([p.bounds[0] * units.scale(p) for p in trial.amplitudes]) / size
    upper = np.array([p.bounds[1] * units.scale(p) for p in trial.amplitudes]) / size
    norm = np.maximum(np.linalg.norm(upper_factor, axis=0), 1e-300)
    wanted = -np.linalg.lstsq(upper_factor.T, push[trial.where], rcond=None)[0]
    found = lsq_linear(upper_factor / norm, wanted, (lower * norm, upper * norm), method="bvls", tol=1e-10)
    gain = float(wanted @ wanted - 2 * found.cost)
    values = {**trial.values, **{p.name: v for p, v in zip(trial.amplitudes, found.x / norm * size, strict=True)}}
    vector = np.array([values[p.name] for p in fitted])
    return _Option(trial, Direction(basis.astype(np.float32), gain), vector)


def _columns(trial: _Trial, moved: FloatArray, fitted: Sequence[Parameter]) -> FloatArray:
    """Return the sensitivity of every free parameter; unknown derivatives of shapes start at zero."""
    columns = np.zeros((len(moved), len(fitted)))
    at = {p.name: trial.where.start + k for k, p in enumerate(trial.amplitudes)}
    for k, p in enumerate(fitted):
        if not p.shape:
            columns[:, k] = moved[:, at[p.name]] / trial.values[p.name]
    return columns


def _distinct(options: Sequence[_Option], keep: int) -> list[_Option]:
    """Return the best options that differ from each other: peaks of the grid, not neighbours on one of them."""
    chosen: list[_Option] = []
    for option in options[:_COMPARED]:
        likeness = [
            float(np.linalg.svd(option.direction.basis.T @ c.direction.basis, compute_uv=False)[-1]) for c in chosen
        ]
        if all(v < _DISTINCT for v in likeness):
            chosen.append(option)
        if len(chosen) == keep:
            break
    return chosen
