"""Which effect explains a residual: sensitivities of the whole catalogue in one call.

The score of a candidate is how much of chi-square its linear effect could remove once the fitted parameters have
absorbed what they can. Scores only rank and provide starts, see `discovery.screening.refits`: finite effects mislead
linear scores.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from discovery.declarations.effect import Effect
from discovery.declarations.registry import get_effect
from discovery.estimation.least_squares import Minimum
from discovery.estimation.natural_units import NaturalUnits
from discovery.estimation.problem import Problem
from discovery.foundation.arrays import FloatArray, IntArray
from discovery.foundation.workers import single_algebra
from discovery.screening.bounded_gain import bounded_gains, grams
from discovery.screening.responses import Grid, Responses, plan, respond
from discovery.simulation.simulate import THREADS

#: Makes columns (n, k) white under a model error.
White = Callable[[FloatArray], FloatArray]
#: Grid of shape parameters scanned for an effect, in declared natural units, where its declaration gives no starts.
_SHAPE_GRID = 48
#: An effect with at most so many shapes is tried at each of its declared sizes, else at the smallest.
_FEW_SHAPES = 12
#: Starts of a refit differ: the cosine between their sensitivities is at most this,
_DISTINCT = 0.9
#: and they are chosen among so many of the best.
_COMPARED = 24
_STARTS = 3
#: Effects with many shapes have many minima: so many times as many starts.
_MANY = 3
#: Gains within this part of the largest are equal.
_TIE = 1e-9


@dataclass(frozen=True)
class Shapes:
    """What the shapes of an effect on its grid could do to a residual, to first order."""

    #: (u, n): of amplitudes, what the fitted parameters leave of them; shapes may share some.
    responses: NDArray[np.float32]
    rows: IntArray  # (t, k), which of them belong to each shape
    #: (t, k, k): makes an orthonormal basis of these, see `discovery.screening.bounded_gain.bounded_gains`.
    transform: FloatArray
    gains: FloatArray  # (t,), chi-square that each removes within its bounds

    def bases(self, shapes: IntArray) -> NDArray[np.float32]:
        """Return the orthonormal directions of some shapes, shape (shapes, k, n)."""
        return self.transform[shapes].astype(np.float32) @ self.responses[self.rows[shapes]]

    def under(self, white: White, known: FloatArray) -> Shapes:
        """Return the same under a model error, less some orthonormal directions (n, p) that are white under it."""
        seen = white(self.responses.T.astype(float))
        responses = np.ascontiguousarray((seen - known @ (known.T @ seen)).T, np.float32)
        gram, push = grams(responses, self.rows, np.zeros(len(seen)))
        free = np.full(push.shape, np.inf)
        return replace(self, responses=responses, transform=bounded_gains(gram, push, -free, free)[2])

    def powers(self, noise: NDArray[np.float32]) -> FloatArray:
        """Return the chi-square that each shape would remove from each column of (n, r), bounds ignored, (t, r)."""
        seen = self.responses @ noise
        return np.square(self.transform @ seen[self.rows]).sum(axis=1)


@dataclass(frozen=True)
class Start:
    """Where a refit may begin."""

    values: FloatArray  # (f,), of what a refit estimates
    sizes: IntArray  # (k,), which of them are amplitudes
    responses: Responses  # of amplitudes
    #: rows, simulated (k,), or (k * recordings,): which responses are those of this start, and to what amplitudes.
    rows: IntArray
    simulated: FloatArray
    effect: str  # id
    #: (recordings,): what each recording has of its own; empty where the effect has nothing of the kind.
    own: FloatArray = field(kw_only=True)

    def columns(self) -> FloatArray:
        """Return the sensitivity (n, f); unknown derivatives, those of shapes, are zero."""
        columns = np.zeros((self.responses.left.shape[1], self.values.size))
        moved = self.responses.moved(self.rows) / self.simulated
        if self.own.size:
            effect, k = get_effect(self.effect), self.sizes.size
            least = [effect.turned(np.zeros(k), own) for own in self.own]
            turns = np.array([[effect.turned(one, own) for own in self.own] for one in np.eye(k)]) - least
            moved = moved @ turns.transpose(2, 1, 0).reshape(-1, k)
        columns[:, self.sizes] = moved
        return columns

    def of_recordings(self, problem: Problem) -> dict[str, float]:
        """Return what recordings have of their own by name, in a problem with the effect."""
        parameter = get_effect(self.effect).own()
        if parameter is None or not self.own.size:
            return {}
        row = 2 + problem.bench.own.index(parameter.name)
        return {s.name: float(self.own[s.experiment]) for s in problem.states if s.row == row}


@dataclass(frozen=True)
class Candidate:
    """One candidate effect with its linear score."""

    effect: str  # id
    score: float  # chi-square that its linear sensitivity removes, fitted parameters re-adjusted
    starts: tuple[Start, ...]  # the best ones of a refit
    #: (n, k): orthonormal directions of the best start, orthogonal to what fitted parameters absorb.
    sensitivity: FloatArray
    shapes: Shapes  # every shape on the grid


def grid_of(effect: Effect, system: str, units: NaturalUnits) -> list[dict[str, float]]:
    """Return finite values of an effect in the problem's units: a grid over shapes and sizes."""
    shapes = [p for p in effect.fitted(system) if p.shape]
    amplitudes = [p for p in effect.fitted(system) if not p.shape]
    scale = {p.name: units.scale(p) for p in (*shapes, *amplitudes)}
    grids: list[dict[str, float]] = [{}]
    for p in shapes:
        low, high = max(p.bounds[0], 1e-3 * p.prior.width), p.bounds[1]
        values = p.starts or tuple(np.geomspace(low, min(high, 20 * p.prior.width), _SHAPE_GRID))
        grids = [{**g, p.name: v * scale[p.name]} for g in grids for v in values]
    # Declared sizes, smallest first, are small enough to be linear, and large enough to matter.
    sizes = {p: sorted({abs(v) for v in p.starts if v}) or [1e-3 * p.prior.width] for p in amplitudes}
    levels = max((len(s) for s in sizes.values()), default=1) if len(grids) <= _FEW_SHAPES else 1
    return [
        {**g, **{p.name: s[min(level, len(s) - 1)] * scale[p.name] for p, s in sizes.items()}}
        for g in grids
        for level in range(levels)
    ]


def screen(minimum: Minimum, problem: Problem, names: Sequence[str], *, keep: int = _STARTS) -> list[Candidate]:
    """Score candidate effects by their sensitivities around a fitted model, all in one batched simulation.

    `minimum`: that of the fitted model on `problem`, whose bench must contain every candidate. `names`: candidate
    effect ids. `keep`: number of starts kept for each, at most; three times as many for effects with many shapes.
    Returned: highest score first.
    """
    bench, units, system = problem.bench, problem.units, problem.model.mechanics.system
    grids, settings = _planned(tuple(get_effect(name) for name in names), system, units, len(bench.experiments))
    # Beside a motion that blows up nothing is gained, and every candidate begins as declared.
    reference, slopes = (np.where(np.isfinite(x), x, 0.0)[: bench.n_rows] for x in (minimum.residual, minimum.jacobian))
    known, _ = np.linalg.qr(slopes)
    target = reference - known @ (known.T @ reference)
    with single_algebra():
        with ThreadPoolExecutor(THREADS) as pool:
            responses = respond(pool, bench, problem.expand(minimum.x[:, None]), settings, reference, known)
        scored = [_scored(name, grids[name], responses, target, units, keep) for name in names]
    return sorted(scored, key=lambda c: -c.score)


@lru_cache(maxsize=64)
def _planned(
    effects: tuple[Effect, ...], system: str, units: NaturalUnits, recordings: int
) -> tuple[dict[str, Grid], list[dict[str, float]]]:
    """Return what is simulated for some effects: the same around every fit of the same recordings."""
    return plan({effect.id(): grid_of(effect, system, units) for effect in effects}, system, recordings)


def _scored(
    name: str, grid: Grid, responses: Responses, target: FloatArray, units: NaturalUnits, keep: int
) -> Candidate:
    """Return the candidate of one effect: the amplitudes of every shape that remove most, and the best starts."""
    count = len(grid.rows)
    # Of an amplitude that recordings tell apart, one for each of them.
    parts = grid.rows.shape[1] // grid.sizes.size
    each = np.repeat(grid.sizes, parts)
    parameters = [grid.fitted[i] for i in each]
    sizes = grid.values[:, each]
    low, high = (np.array([p.bounds[end] * units.scale(p) for p in parameters]) / sizes for end in (0, 1))
    stays = np.array([p.threshold for p in parameters])
    limits = low, np.where(stays, 1.0, high)
    first = int(grid.rows.min())
    own, rows = responses.left[first : int(grid.rows.max()) + 1], grid.rows - first
    gram, push = grams(own, rows, target)
    gain, solution, transform = bounded_gains(gram, push, *limits)
    shapes = Shapes(own, rows, transform, gain)
    # Shapes that rounding alone tells apart stay in the order of the grid.
    removed = np.maximum(gain, 0.0)
    order = np.argsort(-np.round(removed / max(_TIE * removed.max(), 1e-300)), kind="stable")
    bases = shapes.bases(order[:_COMPARED])
    starts = []
    # To first order two thresholds may do the same, and only one of them be where the recordings pass it.
    chosen = slice(None) if stays.any() else _distinct(bases, keep if count <= _FEW_SHAPES else _MANY * keep)
    for i in order[chosen]:
        values, each_own = grid.values[i].copy(), np.zeros(parts if parts > 1 else 0)
        # At the bound where it vanishes an effect would never leave, though a larger one may be right: it begins as
        # declared.
        if solution[i].any():
            found = (np.where(stays, 1.0, solution[i]) * sizes[i]).reshape(-1, parts).T
            values[grid.sizes], each_own = get_effect(name).gathered(found) if parts > 1 else (found[0], each_own)
        starts.append(Start(values, grid.sizes, responses, grid.rows[i], sizes[i], name, own=each_own))
    return Candidate(name, float(gain[order[0]]), tuple(starts), bases[0].T.astype(float), shapes)


def _distinct(bases: NDArray[np.float32], keep: int) -> list[int]:
    """Return which of the best (t, k, n), best first, differ: peaks of the grid, not neighbours on one of them."""
    chosen: list[int] = []
    free = np.arange(len(bases))
    while free.size and len(chosen) < keep:
        chosen.append(int(free[0]))
        free = free[1:]
        likeness = np.linalg.svd(bases[free] @ bases[chosen[-1]].T, compute_uv=False)[:, -1]
        free = free[likeness < _DISTINCT]
    return chosen
