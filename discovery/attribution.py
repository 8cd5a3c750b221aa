"""Which effect explains a residual: sensitivities of the whole catalogue in one call, then bounded refits of each.

The score of a candidate is how much of chi-square its linear effect could remove once the fitted parameters have
absorbed what they can. Scores only rank and provide starts: every candidate is refitted, because finite effects mislead
linear scores.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from discovery.batch import answer_on
from discovery.effect import ARM, Effect
from discovery.least_squares import Minimum, levenberg_marquardt, minimise
from discovery.model import Model
from discovery.parameters import Parameter
from discovery.problem import NaturalUnits, Problem
from discovery.registry import catalogue

__all__ = ["Candidate", "Refit", "candidates", "refit", "screen", "similarity"]

FloatArray = NDArray[np.float64]
#: Grid of shape parameters scanned for an effect, in declared natural units, where its declaration gives no starts.
_SHAPE_GRID = 48
#: Refits of one candidate start from its best so many linear solutions.
_STARTS = 3
#: So many of the best refits are finished with a differenced Jacobian.
_FINISHED = 6


@dataclass(frozen=True)
class Candidate:
    """One candidate effect with its linear score.

    Parameters
    ----------
    effect : str
        Id.
    score : float
        Chi-square that its linear sensitivity removes, fitted parameters re-adjusted.
    starts : tuple of (mapping, Jacobian columns)
        Best start values of a refit, with the sensitivity of each.
    sensitivity : ndarray, shape (n, k)
        Projected sensitivity of the best start (orthogonal to what fitted parameters absorb), normalised columns.
    """

    effect: str
    score: float
    starts: tuple[tuple[FloatArray, FloatArray], ...]
    sensitivity: FloatArray


@dataclass(frozen=True)
class Refit:
    """A model with a candidate added, refitted."""

    effect: str
    problem: Problem
    minimum: Minimum

    @property
    def chi2(self) -> float:
        """Sum of squared normalised residuals."""
        return 2 * self.minimum.cost


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


def _starts(effect: Effect, system: str, units: NaturalUnits) -> list[dict[str, float]]:
    """Return finite start values of an effect in the problem's units: a grid over shapes, declared amplitudes."""
    shapes = [p for p in effect.fitted(system) if p.shape]
    amplitudes = [p for p in effect.fitted(system) if not p.shape]
    grids: list[dict[str, float]] = [{}]
    for p in shapes:
        low, high = max(p.bounds[0], 1e-3 * p.prior.width), p.bounds[1]
        values = p.starts or tuple(np.geomspace(low, min(high, 20 * p.prior.width), _SHAPE_GRID))
        grids = [{**g, p.name: v * units.scale(p)} for g in grids for v in values]
    # The smallest declared amplitude is small enough to be linear and large enough to be finite.
    small = {p.name: min((abs(v) for v in p.starts), default=1e-3 * p.prior.width) * units.scale(p) for p in amplitudes}
    return [{**g, **small} for g in grids]


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
    base_parameters, base_initial = problem.expand(minimum.x[:, None])
    n_data = len(minimum.residual) - len(problem.prior_residuals(minimum.x[:, None]))
    columns: list[FloatArray] = []
    plan: list[tuple[str, dict[str, float], list[str]]] = []
    for name in names:
        effect = catalogue()[name]
        amplitudes = [p.name for p in effect.fitted(system) if not p.shape]
        for start in _starts(effect, system, units):
            plan.append((name, start, amplitudes))
            for amplitude in amplitudes:
                column = base_parameters[:, 0].copy()
                for other, value in start.items():
                    if other == amplitude or other not in amplitudes:
                        column[bench.names.index(other)] = value
                columns.append(column)
    parameters = np.stack(columns, axis=1)
    initial = np.repeat(base_initial, parameters.shape[1], axis=2)
    # Memory stays bounded: a few hundred trajectories at a time.
    width = max(64, int(4e7 / max(1, n_data)))
    moved = np.concatenate(
        [
            bench.residuals(parameters[:, a : a + width], initial[:, :, a : a + width])
            for a in range(0, parameters.shape[1], width)
        ],
        axis=1,
    )
    reference = minimum.residual[:n_data]
    known, _ = np.linalg.qr(minimum.jacobian[:n_data])
    target = reference - known @ (known.T @ reference)
    found: dict[str, list[tuple[float, FloatArray, FloatArray, FloatArray]]] = {name: [] for name in names}
    position = 0
    for name, start, amplitudes in plan:
        raw = moved[:, position : position + len(amplitudes)] - reference[:, None]
        position += len(amplitudes)
        size = np.array([start[a] for a in amplitudes])
        raw = np.where(np.isfinite(raw), raw, 0.0) / size
        projected = raw - known @ (known.T @ raw)
        declared = {p.name: p for p in catalogue()[name].fitted(system)}
        unit = np.array([units.scale(declared[a]) for a in amplitudes])
        lower = np.array([declared[a].bounds[0] for a in amplitudes]) * unit
        upper = np.array([declared[a].bounds[1] for a in amplitudes]) * unit
        norm = np.maximum(np.linalg.norm(projected, axis=0), 1e-300)
        solution = lsq_linear(projected / norm, -target, (lower * norm, upper * norm), tol=1e-10)
        gain = float(target @ target - 2 * solution.cost)
        values = {**start, **dict(zip(amplitudes, (solution.x / norm).tolist(), strict=True))}
        vector = np.array([values[n] for n in declared])
        found[name].append((gain, vector, raw, projected / norm))
    result = []
    for name, options in found.items():
        options.sort(key=lambda o: -o[0])
        best = options[:keep]
        starts = [(o[1], _with_shapes(catalogue()[name].fitted(system), o[2])) for o in best]
        result.append(Candidate(name, best[0][0], tuple(starts), best[0][3]))
    return sorted(result, key=lambda c: -c.score)


def _with_shapes(fitted: Sequence[Parameter], amplitudes: FloatArray) -> FloatArray:
    """Return columns for all free parameters of an effect: unknown derivatives of shapes start at zero."""
    columns, k = [], 0
    for p in fitted:
        columns.append(np.zeros(len(amplitudes)) if p.shape else amplitudes[:, k])
        k += 0 if p.shape else 1
    return np.stack(columns, axis=1)


def refit(
    model: Model,
    minimum: Minimum,
    problem: Problem,
    shortlist: Sequence[Candidate],
    *,
    iterations: int = 30,
    on_round: Callable[[int], None] | None = None,
) -> list[Refit]:
    """Refit the model with each candidate added, bounded, all together; the best of several starts of each.

    Returns
    -------
    list of Refit
        Smallest chi-square first.
    """
    problems: list[Problem] = []
    requests = []
    labels: list[str] = []
    for candidate in shortlist:
        extended = Problem(model.with_effect(candidate.effect), problem.bench, problem.units, problem.gaussian)
        where = [extended.free.index(n) for n in problem.free]
        added = [i for i in range(len(extended.free)) if i not in where]
        tail = len(extended.names) - len(extended.free)
        for vector, columns in candidate.starts:
            x = np.empty(len(extended.names))
            jacobian = np.zeros((len(minimum.residual), x.size))
            x[where], x[added] = minimum.x[: len(problem.free)], vector
            x[-tail:] = minimum.x[-tail:]
            jacobian[:, where] = minimum.jacobian[:, : len(problem.free)]
            jacobian[:, -tail:] = minimum.jacobian[:, -tail:]
            jacobian[: len(columns), added] = columns
            # The fitted parameters move with the effect: first-order compensation.
            push = minimum.residual + jacobian[:, added] @ vector
            old = [*where, *range(x.size - tail, x.size)]
            step, *_ = np.linalg.lstsq(minimum.jacobian, -push, rcond=None)
            lower, upper = extended.bounds
            x[old] = np.clip(x[old] + step, lower[old], upper[old])
            problems.append(extended)
            labels.append(candidate.effect)
            requests.append(
                levenberg_marquardt(
                    x, lower, upper, extended.scale, iterations=iterations, tolerance=1e-3, jacobian=jacobian
                )
            )
    minima = minimise(requests, answer_on(problems), on_round=on_round)
    # A quick search may stall on its carried Jacobian: the best ones, and those that a nested model cannot be worse
    # than, are finished with differences.
    order = sorted(range(len(minima)), key=lambda i: minima[i].cost)
    stalled = [i for i in order if not minima[i].cost <= minimum.cost]
    chosen = list(dict.fromkeys([*order[:_FINISHED], *stalled]))
    finished = minimise(
        [
            levenberg_marquardt(
                np.where(np.isfinite(minima[i].x), minima[i].x, problems[i].start({})),
                *problems[i].bounds,
                problems[i].scale,
                iterations=6,
                tolerance=1e-4,
            )
            for i in chosen
        ],
        answer_on([problems[i] for i in chosen]),
    )
    for i, found in zip(chosen, finished, strict=True):
        if found.cost < minima[i].cost or not np.isfinite(minima[i].cost):
            minima[i] = found
    best: dict[str, Refit] = {}
    for label, extended, found in zip(labels, problems, minima, strict=True):
        if np.isfinite(found.cost) and (label not in best or found.cost < best[label].minimum.cost):
            best[label] = Refit(label, extended, found)
    return sorted(best.values(), key=lambda r: r.chi2)


def similarity(first: FloatArray, second: FloatArray) -> float:
    """Return the largest principal cosine between two projected sensitivities: 1 when they cannot be told apart."""
    a, _ = np.linalg.qr(first)
    b, _ = np.linalg.qr(second)
    return float(np.linalg.svd(a.T @ b, compute_uv=False)[0])
