"""The least-squares cubic spline of a motion profile: straight lines, constant accelerations and smooth phases.

All phases are fitted together in one sparse system. The roughness of a smooth phase maximises the marginal likelihood
[1]_.

.. [1] G. Wahba, "A comparison of GCV and GML for choosing the smoothing parameter in the generalized spline smoothing
       problem", Annals of Statistics 13, 1378-1402 (1985).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.interpolate import BSpline, PPoly
from scipy.sparse import csc_array, csr_array, diags_array, hstack, vstack
from scipy.sparse.linalg import SuperLU, splu

from discovery.foundation.arrays import FloatArray
from discovery.recordings.drive import Drive

_LONGEST_TUNED = 4000  # samples

_STILL = 12  # readings at an end that show whether it is a rest

_DENSE = 60  # a phase of fewer readings gets a knot between each two as well


@dataclass(frozen=True)
class Phase:
    """Samples ``first <= i <= last`` with acceleration; its kinks if it is piecewise constant, else its roughness."""

    first: int
    last: int
    kinks: FloatArray | None = None
    roughness: float = 1.0


@dataclass(frozen=True)
class _System:
    """A cubic spline's least squares: normal equations of the readings, rows that must vanish, rows of roughness."""

    knots: FloatArray
    normal: csr_array
    right: FloatArray
    constraints: csr_array
    roughness: tuple[csr_array, ...]

    def saddle(self) -> csc_array:
        """Matrix with exact constraints and no normal equations of the steep roughness rows, for unit weights."""
        rows = vstack([self.constraints, *self.roughness])
        slack = np.repeat([0.0, -1.0], [self.constraints.shape[0], rows.shape[0] - self.constraints.shape[0]])
        return csc_array(vstack([hstack([self.normal, rows.T]), hstack([rows, diags_array(slack)])]))

    def solve(self, factor: SuperLU) -> FloatArray:
        """Coefficients of the spline."""
        return factor.solve(np.pad(self.right, (0, factor.shape[0] - self.right.size)))[: self.right.size]


def _assemble(
    t: FloatArray, y: FloatArray, noise: float, phases: Sequence[Phase], rests: Sequence[float] = ()
) -> _System:
    """Set up the fit: readings, straight lines in the gaps, constant accelerations between kinks, smooth phases."""
    inner = [np.repeat(p.kinks, 2) if p.kinks is not None else _phase_knots(t, p) for p in phases]
    knots = np.concatenate([np.repeat(t[0], 4), *inner, np.repeat(t[-1], 4)])
    first, second = _difference(knots, 3), _difference(knots[1:-1], 2)
    acceleration = csr_array(second @ first)
    nodes = knots[3:-3]
    h = np.diff(nodes)
    middle = 0.5 * (nodes[1:] + nodes[:-1])
    owner = np.full(h.size, -1)
    for number, phase in enumerate(phases):
        bounds = phase.kinks if phase.kinks is not None else t[[phase.first, phase.last]]
        owner[(middle > bounds[0]) & (middle < bounds[-1])] = number
    kinked = np.array([p.kinks is not None for p in phases] + [False])[owner]
    gap, constant = np.flatnonzero((owner < 0) & (h > 0)), np.flatnonzero(kinked & (h > 0))
    one = np.ones(nodes.size)
    straight = _rows([np.concatenate([gap, gap + 1])], [one[:1].repeat(2 * gap.size)], nodes.size)
    level = _rows([constant, constant + 1], [-one[constant], one[constant]], nodes.size)
    rows = [vstack([straight, level]) @ acceleration]
    if len(rests):
        rows.append(BSpline.design_matrix(np.asarray(rests), knots[1:-1], 2) @ first)
        # A rest at an end of the record is nothing but its end: the acceleration vanishes there too.
        rows.append(acceleration[[node for node, end in ((0, t[0]), (-1, t[-1])) if end in rests]])
    roughness = []
    for number, phase in enumerate(phases):
        inside = owner == number
        node = np.flatnonzero((inside[1:] | inside[:-1]) & (h[1:] > 0) & (h[:-1] > 0)) + 1
        if phase.kinks is not None:
            node = node[:0]
        left, after = h[node - 1], h[node]
        # Where a gap begins, only the phase's own spacing tells how far the jump of the third derivative is spread.
        spread = np.sqrt(np.where(inside[node - 1], left, after) + np.where(inside[node], after, left))
        weights = [1.0 / left / spread, -(1.0 / left + 1.0 / after) / spread, 1.0 / after / spread]
        jumps = _rows([node - 1, node, node + 1], weights, nodes.size) @ acceleration
        roughness.append(csr_array(np.sqrt(phase.roughness) * jumps))
    design = csr_array(BSpline.design_matrix(t, knots, 3)) / noise
    right = np.asarray(design.T @ (y / noise))
    return _System(knots, csr_array(design.T @ design), right, _scaled(csr_array(vstack(rows))), tuple(roughness))


def _scaled(rows: csr_array) -> csr_array:
    largest = abs(rows).max(axis=1).toarray().ravel() if rows.shape[0] else np.empty(0)
    return csr_array(diags_array(1.0 / np.maximum(largest, np.finfo(float).tiny)) @ rows)


def _phase_knots(t: FloatArray, phase: Phase) -> FloatArray:
    times = t[phase.first : phase.last + 1]
    # Readings much closer than their neighbours would only spoil the conditioning.
    times = times[np.concatenate([[True], np.diff(times) > 0.2 * np.median(np.diff(times))])]
    if times.size < _DENSE:
        times = np.sort(np.concatenate([times, 0.5 * (times[1:] + times[:-1])]))
    return times[(times > t[0]) & (times < t[-1])]


def _difference(knots: FloatArray, degree: int) -> csr_array:
    """Matrix that takes B-spline coefficients of a degree to those of the derivative (de Boor 2001, chapter X)."""
    n = knots.size - degree - 1
    weight = degree / (knots[degree + 1 : degree + n] - knots[1:n])
    return csr_array(diags_array(np.stack([-weight, weight]), offsets=[0, 1], shape=(n - 1, n)))


def _rows(columns: Sequence[npt.NDArray[np.intp]], weights: Sequence[FloatArray], size: int) -> csr_array:
    count = columns[0].size
    index = np.tile(np.arange(count), len(columns))
    return csr_array((np.concatenate(weights), (index, np.concatenate(columns))), shape=(count, size))


def likeliest_roughness(t: FloatArray, y: FloatArray, noise: float, phase: Phase) -> float:
    """Weight of the squared fourth derivative that maximises the marginal likelihood, to a decade."""
    if phase.last - phase.first > _LONGEST_TUNED:
        # The liveliest of some parts of a long phase decides.
        size = _LONGEST_TUNED // 8
        starts = np.linspace(phase.first, phase.last - size, 8).astype(int)
        parts = [slice(start, start + size) for start in starts]
        return min(likeliest_roughness(t[part], y[part], noise, Phase(0, size - 1)) for part in parts)
    system = _assemble(t, y - y.mean(), noise, [phase])
    rough = system.roughness[0]
    natural = system.normal.diagonal().sum() / max(float((rough**2).sum()), np.finfo(float).tiny)
    costs: dict[int, float] = {}
    saddle = system.saddle()
    slack = np.flatnonzero(saddle.indices == np.repeat(np.arange(saddle.shape[1]), np.diff(saddle.indptr)))
    slack = slack[saddle.data[slack] < 0.0]

    def cost(decade: int) -> float:
        if decade not in costs:
            saddle.data[slack] = -1.0 / (natural * 10.0**decade)
            factor = splu(saddle)
            # The saddle point's determinant is that of the posterior's precision over that of the prior's.
            log_determinant = float(np.log(np.abs(factor.U.diagonal())).sum())
            costs[decade] = log_determinant - float(system.right @ system.solve(factor))
        return costs[decade]

    coarse = min(range(-3, 3 + int(6.0 * np.log10(phase.last - phase.first + 2.0)), 3), key=cost)
    return float(natural * 10.0 ** min(range(coarse - 2, coarse + 3), key=cost))


def fit_phases(t: FloatArray, y: FloatArray, noise: float, phases: Sequence[Phase]) -> Drive:
    """Fit all phases together, and once more with zero rate in those gaps, and at those ends, that are rests."""
    rests: list[float] = []
    spline = _solve(t, y, noise, phases, rests)
    edges = [
        t[0],
        *(e for p in phases for e in (p.kinks[[0, -1]] if p.kinks is not None else t[[p.first, p.last]])),
        t[-1],
    ]
    for start, stop in zip(edges[::2], edges[1::2], strict=True):
        readings = np.count_nonzero((t >= start) & (t <= stop))
        middle = 0.5 * (start + stop)
        # Four sds of a fitted slope.
        if readings > 2 and abs(spline(middle, 1)) * (stop - start) < 4.0 * noise * np.sqrt(12.0 / readings):
            rests.append(middle)
    rests += _still_ends(t, y, noise, phases)
    if rests:
        spline = _solve(t, y, noise, phases, rests)
    pieces = PPoly.from_spline(spline.tck)
    keep = np.flatnonzero(np.diff(pieces.x) > 0)
    kinks = np.concatenate([np.empty(0), *(p.kinks for p in phases if p.kinks is not None)])
    return Drive(np.append(pieces.x[keep], pieces.x[-1]), pieces.c[:, keep], kinks)


def _still_ends(t: FloatArray, y: FloatArray, noise: float, phases: Sequence[Phase]) -> list[float]:
    """Return the ends of the record at which a smooth phase lies although the readings there do not move yet."""
    ends = []
    for phase in phases:
        at_start, at_stop = phase.first == 0, phase.last == t.size - 1
        for part, end, touched in ((slice(None, _STILL), t[0], at_start), (slice(-_STILL, None), t[-1], at_stop)):
            if phase.kinks is not None or not touched:
                continue
            centred = t[part] - t[part].mean()
            drift = np.ptp(t[part]) * float(centred @ y[part]) / float(centred @ centred)
            # Four sds of a fitted slope.
            if abs(drift) < 4.0 * noise * np.sqrt(12.0 / _STILL):
                ends.append(float(end))
    return ends


def _solve(t: FloatArray, y: FloatArray, noise: float, phases: Sequence[Phase], rests: Sequence[float]) -> BSpline:
    system = _assemble(t, y - y[0], noise, phases, rests)
    return BSpline(system.knots, system.solve(splu(system.saddle())) + y[0], 3)
