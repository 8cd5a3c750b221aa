"""The recorded input made smooth once: value, rate and acceleration at any time, and the kinks that steps must respect.

The encoder of an arm records a motion profile: rests and cruises, exactly linear, between short phases of acceleration.
Phases are found by testing second differences of growing width against the encoder's noise. A phase that one or two
constant accelerations explain to the noise, or two with a cruise between, gets them, with kinks at fitted times; any
other gets a cubic spline whose roughness maximises the marginal likelihood [1]_. All phases are then fitted together,
in one sparse least squares.

.. [1] G. Wahba, "A comparison of GCV and GML for choosing the smoothing parameter in the generalized spline smoothing
       problem", Annals of Statistics 13, 1378-1402 (1985).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt
from scipy.fft import irfft, rfft
from scipy.interpolate import BSpline, CubicSpline, PPoly
from scipy.sparse import csc_array, csr_array, diags_array, hstack, vstack
from scipy.sparse.linalg import SuperLU, splu

from discovery.errors import InputError
from discovery.recording import Recording, estimate_noise, resolution
from discovery.rig import Rig

__all__ = ["Drive", "build_drive"]

FloatArray = npt.NDArray[np.float64]

_DETECTION = 5.0  # sds of a second difference: no false phase in some 1e5 tests
_MARGIN = 2  # samples around a detected phase that belong to it, at least
_TAIL = 0.25  # part of its length that belongs to it on either side
_SHORTEST_GAP = 12  # samples; a shorter pause between two phases is not worth a straight line
_WINDOW = 60  # samples beside a phase that help to fit it alone
_LONGEST_TUNED = 4000  # samples
_LONGEST_KINKED = 2000  # samples
_ROUNDS = 4
_ITERATIONS = 15
# Where the inner kinks of one, two or three constant accelerations are first looked for, as parts of the phase.
_FIRST_KINKS: dict[int, list[tuple[float, ...]]] = {1: [()], 2: [(0.38,), (0.5,), (0.62,)], 3: [(0.35, 0.65)]}
_DENSE = 60  # a phase of fewer readings gets a knot between each two as well
_FEWEST = 8  # samples; with less, a spline through them
_FINEST = 1e-8  # error of a reading against the range of all, at least
_UPSAMPLING = 8


@dataclass(frozen=True)
class Drive:
    """An input as piecewise polynomials, constant before its first and after its last time.

    Attributes
    ----------
    breakpoints : array, shape (m + 1,)
        Times between which the input is one polynomial [s]; a step that crosses none of them sees a smooth input.
    coefficients : array, shape (d + 1, m)
        Of the powers of ``t - breakpoints[i]``, highest first, in the input's unit.
    kinks : array, shape (k,)
        Times at which acceleration, rate or value jumps: integration steps must end there.
    """

    breakpoints: FloatArray
    coefficients: FloatArray
    kinks: FloatArray

    def evaluate(self, time: npt.ArrayLike, side: Literal["left", "right"] = "right") -> FloatArray:
        """Value, rate and acceleration.

        Parameters
        ----------
        time : array_like, shape (n,)
            Any times [s]; outside the record the value is held, with zero rates.
        side : {"right", "left"}
            Which limit to take at a kink.

        Returns
        -------
        array, shape (3, n)
            Value and its first and second time derivative.
        """
        t = np.atleast_1d(np.asarray(time, np.float64))
        first, last = self.breakpoints[0], self.breakpoints[-1]
        piece = np.clip(np.searchsorted(self.breakpoints, t, side) - 1, 0, self.coefficients.shape[1] - 1)
        s = np.clip(t, first, last) - self.breakpoints[piece]
        value, rate, half_acceleration = np.zeros((3, t.size))
        for row in self.coefficients:
            half_acceleration = half_acceleration * s + rate
            rate = rate * s + value
            value = value * s + row[piece]
        inside = (t >= first) & (t < last) if side == "right" else (t > first) & (t <= last)
        return np.stack([value, np.where(inside, rate, 0.0), np.where(inside, 2.0 * half_acceleration, 0.0)])


def build_drive(recording: Recording, rig: Rig) -> Drive | None:
    """Make the input of a recording continuous in time.

    Parameters
    ----------
    recording : Recording
    rig : Rig
        Says how the input runs between samples: an arm's motor angle is smoothed to its encoder's error
        (``angle_noise``, uniform; estimated where the rig does not state it); the input of an oscillator is
        interpolated, band limited, by a cubic spline, linearly or held.

    Returns
    -------
    Drive or None
        None for a free decay, which has no input.

    Raises
    ------
    InputError
        If a band-limited input is not equally sampled.
    """
    if recording.input is None or rig.columns.input is None:
        return None
    t, u = recording.time, recording.input
    match rig.columns.input.interpolation:
        case "motion":
            noise = estimate_noise(u) if rig.angle_noise is None else rig.angle_noise / np.sqrt(3.0)
            return smooth_motion(t, u, noise)
        case "band_limited":
            return _band_limited(t, u, recording.source)
        case "linear":
            return Drive(t, np.stack([np.diff(u) / np.diff(t), u[:-1]]), t)
        case "hold":
            return Drive(np.append(t, 2.0 * t[-1] - t[-2]), u[None, :], t)
        case _:
            return _spline(t, u)


def _spline(t: FloatArray, u: FloatArray) -> Drive:
    spline = CubicSpline(t, u)
    return Drive(t, spline.c, np.empty(0))


def _band_limited(t: FloatArray, u: FloatArray, source: str) -> Drive:
    """Trigonometric interpolation: the ends' chord taken off and mirrored oddly, so that the period closes smoothly."""
    n = t.size - 1
    step = (t[-1] - t[0]) / n
    if np.max(np.abs(t - (t[0] + step * np.arange(n + 1)))) > 0.01 * step:
        raise InputError(
            f"{source}: the times are not equally spaced, so the input cannot be interpolated as band limited. "
            'Set interpolation = "spline" for the input in the rig file, or resample the recording.'
        )
    chord = u[0] + (u[-1] - u[0]) * np.arange(n + 1) / n
    odd = u - chord
    spectrum = rfft(np.concatenate([odd, -odd[-2:0:-1]]))
    spectrum[-1] *= 0.5  # the Nyquist line is shared between plus and minus once there is room beyond it
    fine = _UPSAMPLING * irfft(spectrum, 2 * n * _UPSAMPLING)[: n * _UPSAMPLING + 1]
    fine += u[0] + (u[-1] - u[0]) * np.arange(n * _UPSAMPLING + 1) / (n * _UPSAMPLING)
    return _spline(t[0] + step / _UPSAMPLING * np.arange(n * _UPSAMPLING + 1), fine)


@dataclass(frozen=True)
class _Phase:
    """Samples ``first <= i <= last`` with acceleration; its kinks if it is piecewise constant, else its roughness."""

    first: int
    last: int
    kinks: FloatArray | None = None
    roughness: float = 1.0


def smooth_motion(t: FloatArray, y: FloatArray, noise: float) -> Drive:
    """Fit a motion profile to the readings of an encoder.

    Parameters
    ----------
    t, y : array, shape (n,)
        Times [s] and readings.
    noise : float
        Standard deviation of a reading's error, in the unit of `y`; raised to the rounding of `y` if it is below.

    Returns
    -------
    Drive
        Cubic pieces; acceleration is continuous but at the kinks, and zero in rests and cruises; the rate is zero in
        rests.
    """
    if t.size < _FEWEST:
        return _spline(t, y)
    noise = max(noise, resolution(y), _FINEST * float(np.ptp(y)))
    active = _active(t, y, noise)
    for _ in range(_ROUNDS):
        found = _phases(active)
        starts = [0, *(phase.last + 1 for phase in found)]
        stops = [*(phase.first for phase in found[1:]), t.size]
        rooms = map(slice, starts, stops)
        phases = [_describe(t, y, noise, phase, room) for phase, room in zip(found, rooms, strict=False)]
        drive = _fit(t, y, noise, phases)
        # The gentle ends of a phase show in the residual only, once its steep part is explained.
        missed = _active(t, y - drive.evaluate(t)[0], noise) & ~active
        if not missed.any():
            break
        active |= missed
    return drive


def _active(t: FloatArray, y: FloatArray, noise: float) -> npt.NDArray[np.bool_]:
    """Find where a straight line does not explain three neighbouring means of 1, 2, 4, ... readings."""
    active = np.zeros(t.size, bool)
    width = 1
    while 3 * width <= t.size:
        kernel_t = _means(t, width)
        kernel_y = _means(y, width)
        before, middle, after = slice(None, -2 * width), slice(width, -width), slice(2 * width, None)
        share = (kernel_t[middle] - kernel_t[before]) / (kernel_t[after] - kernel_t[before])
        bend = kernel_y[middle] - (1.0 - share) * kernel_y[before] - share * kernel_y[after]
        sd = noise * np.sqrt((1.0 + (1.0 - share) ** 2 + share**2) / width)
        # A phase that a narrower test has found would be seen from afar by a wide one: only undisturbed windows count.
        disturbed = np.concatenate([[0], np.cumsum(active)])
        clean = disturbed[3 * width :] == disturbed[: -3 * width]
        hits = np.flatnonzero((np.abs(bend) > _DETECTION * sd) & clean)
        marks = np.zeros(t.size + 1)
        np.add.at(marks, hits + width // 2, 1.0)
        np.add.at(marks, hits + 3 * width - width // 2, -1.0)
        active |= np.cumsum(marks)[:-1] > 0
        width *= 2
    return active


def _phases(active: npt.NDArray[np.bool_]) -> list[_Phase]:
    """Join the samples that are not on a straight line into phases, with margins."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], active, [0]]))).reshape(-1, 2)
    margin = np.maximum(_MARGIN, (_TAIL * (edges[:, 1] - edges[:, 0])).astype(int))
    merged: list[list[int]] = []
    for first, last in np.column_stack([edges[:, 0] - margin, edges[:, 1] - 1 + margin]).tolist():
        if merged and first - merged[-1][1] <= _SHORTEST_GAP:
            merged[-1][1] = max(last, merged[-1][1])
        else:
            merged.append([first, last])
    end = active.size - 1
    return [
        _Phase(0 if first < _SHORTEST_GAP else first, end if last > end - _SHORTEST_GAP else last)
        for first, last in merged
    ]


def _means(values: FloatArray, width: int) -> FloatArray:
    total = np.cumsum(np.concatenate([[0.0], values - values[0]]))
    return (total[width:] - total[:-width]) / width + values[0]


def _describe(t: FloatArray, y: FloatArray, noise: float, phase: _Phase, room: slice) -> _Phase:
    """Choose between constant accelerations and a smooth course, on a phase and the undisturbed readings beside it."""
    start = max(room.start, phase.first - _WINDOW)
    window = slice(start, min(room.stop, phase.last + 1 + _WINDOW))
    local = _Phase(phase.first - start, phase.last - start)
    t, y = t[window], y[window]
    if phase.last - phase.first < _LONGEST_KINKED and local.first > 2 and local.last < t.size - 3:
        for pieces in (1, 2, 3):
            kinks = _constant_accelerations(t, y, noise, local, pieces)
            if kinks is not None:
                return _Phase(phase.first, phase.last, kinks)
    # A smooth phase begins and ends below the threshold: it may reach into the gaps beside it.
    reach = (phase.last - phase.first) // 3
    before, after = min(reach, (phase.first - room.start) // 4), min(reach, (room.stop - 1 - phase.last) // 4)
    local = _Phase(local.first - min(before, local.first), min(local.last + after, t.size - 1))
    return _Phase(local.first + start, local.last + start, roughness=_roughness(t, y, noise, local))


def _constant_accelerations(
    t: FloatArray, y: FloatArray, noise: float, phase: _Phase, pieces: int
) -> FloatArray | None:
    """Fit kink times and constant accelerations by Gauss-Newton; None if the readings contradict them."""
    step = float(np.median(np.diff(t)))
    s = t - t[0]
    # The kinks of the next phase may reach almost half way through the gap.
    lowest, highest = 0.55 * s[phase.first], 0.55 * s[phase.last] + 0.45 * s[-1]
    freedom = max(t.size - 2 * pieces - 3, 0)
    limit = freedom + 3.0 * np.sqrt(2.0 * freedom)
    best: tuple[float, FloatArray] | None = None
    span = s[phase.last] - s[phase.first]
    stride = max(4.0 * step, 0.1 * span)
    for inner in _FIRST_KINKS[pieces]:
        kinks = s[phase.first] + span * np.array([0.2, *inner, 0.8])
        chi2 = np.inf
        for _ in range(_ITERATIONS):
            ramps = np.maximum(s[:, None] - kinks, 0.0)
            shapes = 0.5 * (ramps[:, :-1] ** 2 - ramps[:, 1:] ** 2)
            linear = np.column_stack([np.ones_like(s), s, shapes])
            solution = np.linalg.lstsq(linear, y, rcond=None)[0]
            residual = y - linear @ solution
            before, chi2 = chi2, float(np.sum((residual / noise) ** 2))
            if chi2 > 10.0 * limit and chi2 > 0.9 * before:
                break
            jumps = np.diff(solution[2:], prepend=0.0, append=0.0)
            full = np.column_stack([linear, -jumps * ramps])
            move = np.linalg.lstsq(full, residual, rcond=None)[0][linear.shape[1] :]
            kinks = np.clip(np.sort(kinks + np.clip(move, -stride, stride)), lowest, highest)
            if np.max(np.abs(move)) < 1e-6 * step:
                break
        # Three pieces are a ramp, a cruise and a ramp; three free steps would imitate a smooth course.
        cruise = pieces < 3 or abs(solution[3]) < 0.05 * np.max(np.abs(solution[2:]))
        if cruise and np.min(np.diff(kinks)) > step and (best is None or chi2 < best[0]):
            best = chi2, kinks
    return best[1] + t[0] if best is not None and best[0] <= limit else None


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
    t: FloatArray, y: FloatArray, noise: float, phases: Sequence[_Phase], rests: Sequence[float] = ()
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


def _phase_knots(t: FloatArray, phase: _Phase) -> FloatArray:
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


def _roughness(t: FloatArray, y: FloatArray, noise: float, phase: _Phase) -> float:
    """Weight of the squared fourth derivative that maximises the marginal likelihood, to a decade."""
    if phase.last - phase.first > _LONGEST_TUNED:
        # The liveliest of some parts of a long phase decides.
        size = _LONGEST_TUNED // 8
        starts = np.linspace(phase.first, phase.last - size, 8).astype(int)
        parts = [slice(start, start + size) for start in starts]
        return min(_roughness(t[part], y[part], noise, _Phase(0, size - 1)) for part in parts)
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


def _fit(t: FloatArray, y: FloatArray, noise: float, phases: Sequence[_Phase]) -> Drive:
    """Fit all phases together, and once more with zero rate in those gaps that are rests."""
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
    if rests:
        spline = _solve(t, y, noise, phases, rests)
    pieces = PPoly.from_spline(spline.tck)
    keep = np.flatnonzero(np.diff(pieces.x) > 0)
    kinks = np.concatenate([np.empty(0), *(p.kinks for p in phases if p.kinks is not None)])
    return Drive(np.append(pieces.x[keep], pieces.x[-1]), pieces.c[:, keep], kinks)


def _solve(t: FloatArray, y: FloatArray, noise: float, phases: Sequence[_Phase], rests: Sequence[float]) -> BSpline:
    system = _assemble(t, y - y[0], noise, phases, rests)
    return BSpline(system.knots, system.solve(splu(system.saddle())) + y[0], 3)
