"""Covariance of an output-error fit, what the data cannot determine, and what the solver's error does to the answer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from discovery.estimation.bench import Bench
from discovery.estimation.least_squares import Minimum
from discovery.estimation.problem import Problem, side_by_side
from discovery.foundation.arrays import FloatArray, IntArray
from discovery.foundation.sampling import median_step
from discovery.recordings.experiment import Experiment
from discovery.simulation.kernel.compile import leaps
from discovery.simulation.runge_kutta import CLASSICAL, dormand_prince

#: The residual's spectrum is averaged over a 32nd of all frequencies, and over nine lines at least.
_BANDS = 64
_NARROWEST = 4
#: Leaps that are tried, and the first of them in natural times: an error of the order of 1e-5.
_LEAPS, _FIRST_LEAP = 6, 0.75
#: Parameters of which nothing is known are moved by this part of their scale.
_LITTLE = 1e-3
#: Slopes err by so much of themselves at most: their intervals then do by about as much.
_ERROR = 0.5


def covariance_of(
    problem: Problem, minimum: Minimum
) -> tuple[FloatArray, dict[str, str], tuple[dict[str, float], ...]]:
    """Return the covariance of the estimates from the Jacobian at the minimum, by singular values.

    Returned: `covariance` (p, p): for residuals as correlated as those that are left, never below the instrument's
    white noise and what the model idealises; NaN rows where an interval is missing; `reasons`: why an interval is
    missing, by parameter; `directions`: combinations of parameters that the data do not determine.
    """
    names, p, jacobian = problem.names, len(problem.names), minimum.jacobian
    # What the rig knows within an uncertainty stays uncertain at its bound, and passes that on to the others.
    bound = zip(names, minimum.at_bound, strict=True)
    reasons = {n: "at its bound" for n, b in bound if b and n not in problem.gaussian}
    size = np.sqrt(np.einsum("np,np->p", jacobian, jacobian))
    for n, z in zip(names, size, strict=True):
        if z == 0:
            reasons.setdefault(n, "the data do not depend on it")
    use = np.array([n not in reasons for n in names])
    covariance = np.full((p, p), np.nan)
    directions: list[dict[str, float]] = []
    if use.any():
        scaled = jacobian[:, use] / size[use]
        _, singular, rows = np.linalg.svd(scaled, full_matrices=False)
        # Below this, round-off of the differences decides.
        weak = singular < 1e-6 * singular[0]
        kept = [n for n, u in zip(names, use, strict=True) if u]
        for row in rows[weak]:
            directions.append({n: float(v) for n, v in zip(kept, row, strict=True) if abs(v) > 0.1})
            reasons |= dict.fromkeys(directions[-1], "not identifiable from these recordings")
        inverse = (rows[~weak].T / singular[~weak] ** 2) @ rows[~weak]
        honest = inverse @ _score_covariance(scaled, minimum.residual, problem) @ inverse
        covariance[np.ix_(use, use)] = honest / np.outer(size[use], size[use])
        lost = [names.index(n) for n in reasons]
        covariance[lost, :] = covariance[:, lost] = np.nan
    return covariance, reasons, tuple(directions)


def given(covariance: FloatArray, held: Sequence[int]) -> FloatArray:
    """Return a covariance (p, p) where some parameters are where they are, as at a bound: theirs is zero.

    Without their rows alone the others would keep what only moves together with them.
    """
    across = covariance[:, held]
    return covariance - across @ np.linalg.pinv(covariance[np.ix_(held, held)], hermitian=True) @ across.T


def principal_spread(covariance: FloatArray) -> FloatArray:
    """Return the principal axes of a covariance (p, p), each a column as long as its standard deviation.

    What has no interval, rows of NaN, does not spread.
    """
    covariance = np.nan_to_num(covariance)
    size = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    safe = np.where(size > 0, size, 1.0)
    power, axes = np.linalg.eigh(covariance / np.outer(safe, safe))
    return safe[:, None] * axes * np.sqrt(np.maximum(power, 0.0))


def _idealised(problem: Problem, experiment: Experiment, channel: int, lines: int) -> FloatArray:
    """Return the power of the model's own error, over that of white noise, at the lines of a spectrum.

    A base is no beam: what it idealises moves with the arm, so it is taken as correlated over the natural
    time (Kennedy and O'Hagan, Journal of the Royal Statistical Society B 63 (2001) 425). Its size is known from a finer
    model.
    """
    base, units, recording = problem.model.mechanics, problem.units, experiment.recording
    own = base.accuracy * (1.0 if recording.units[channel] == "rad" else units.length)
    if own == 0.0:
        return np.zeros(lines)
    gap = median_step(recording.time)
    frequency = np.pi / gap * np.linspace(0.0, 1.0, lines)
    share = (own / float(recording.noise[channel])) ** 2
    return share * 2 * units.time / gap / (1 + (frequency * units.time) ** 2)


def _score_covariance(jacobian: FloatArray, residual: FloatArray, problem: Problem) -> FloatArray:
    """Return the covariance of J^T r for noise with the smoothed spectrum of the residual.

    Never below white noise and what the model idealises. With the inverse of J^T J on both sides it is the sandwich of
    Huber and White for correlated residuals, in the frequency domain (Hannan, Multiple Time Series, 1970, chapter VII).
    """
    bench = problem.bench
    # What the rig states is independent of the recordings.
    total = jacobian[bench.n_rows :].T @ jacobian[bench.n_rows :]
    for experiment, (rows, present) in zip(bench.experiments, bench.blocks(), strict=True):
        n = len(present)
        left, slopes = residual[rows].reshape(present.shape), jacobian[rows].reshape(*present.shape, -1)
        for c, count in enumerate(present.sum(axis=0)):
            power = np.abs(np.fft.rfft(left[:, c])) ** 2 / max(1, int(count))
            width = max(_NARROWEST, power.size // _BANDS)
            around = np.pad(power, width, mode="reflect" if power.size > width else "edge")
            smooth = np.convolve(around, np.ones(2 * width + 1) / (2 * width + 1), mode="valid")
            spectrum = np.fft.rfft(slopes[:, c], axis=0)
            twice = np.full(power.size, 2.0)
            twice[0] = 1.0
            if n % 2 == 0:
                twice[-1] = 1.0
            least = 1.0 + _idealised(problem, experiment, c, power.size)
            weight = twice * np.maximum(smooth, least) / n
            total += np.real(spectrum.conj().T @ (spectrum * weight[:, None]))
    return total


def solver_shift(problem: Problem, minimum: Minimum, covariance: FloatArray) -> float:
    """Return the largest shift of the minimum against a solve with half the step, in standard deviations.

    It is that of the generalised estimate under the model error of the problem. Where the steps do not resolve the
    slopes of the readings, it is the largest that their change allows.
    """
    known = np.isfinite(np.diag(covariance))
    if not known.any():
        return float("nan")
    halved = half_step(problem, minimum, np.sqrt(np.diag(covariance)))
    rows = halved.change.size
    change = problem.whitened(halved.change[:, None])[:, 0]
    if not halved.resolves_slopes:
        return float(np.linalg.norm(change))
    slopes = minimum.jacobian[:, known].copy()
    slopes[:rows] = problem.whitened(slopes[:rows])
    # What is known beside the recordings does not move.
    push = np.append(-change, np.zeros(len(slopes) - rows))
    step, *_ = np.linalg.lstsq(slopes, push, rcond=None)
    return float(np.max(np.abs(step) / np.sqrt(np.diag(covariance)[known])))


def longest_leap(problem: Problem, minimum: Minimum, shift: float) -> float | None:
    """Return the step of the method of order eight that hardly moves the minimum [s].

    None where the method does not suit the terms, or takes more than half of the work of the classical one.

    `problem`: fitted by the classical method. `shift`: largest shift of any combination of estimates against half the
    step, in the standard deviations that the stated noise alone would give it.
    """
    bench, order = problem.bench, dormand_prince().order
    least = bench.step * len(dormand_prince().nodes) / len(CLASSICAL.nodes) / 0.5
    leap = _FIRST_LEAP * problem.units.time
    jacobian = minimum.jacobian[: bench.n_rows]
    for _ in range(_LEAPS):
        if leap < least or not leaps(bench.base, bench.effects):
            break
        leaping = Bench(bench.base, bench.effects, bench.experiments, bench.step, leap)
        coarse, fine = (b.residuals(*problem.expand(minimum.x[:, None]))[:, 0] for b in (leaping, leaping.finer(2)))
        change = fine - coarse
        if np.isfinite(change).all():
            step, *_ = np.linalg.lstsq(jacobian, change, rcond=None)
            found = float(np.linalg.norm(jacobian @ step))
            if found <= shift:
                return leap
            leap *= float(np.clip(0.9 * (shift / found) ** (1 / order), 0.3, 0.9))
        else:
            leap *= 0.5
    return None


@dataclass(frozen=True)
class Probed:
    """Points around a vector within its bounds, from which derivatives are taken.

    What is free of a recording moves that one alone. That of all recordings is moved at once, so that derivatives cost
    as many simulations for ten of them as for one (Curtis, Powell and Reid, Journal of the Institute of Mathematics and
    its Applications 13 (1974) 117).
    """

    points: FloatArray  # (m, 2 g + 1), the vector, then all points above it, then all below
    apart: FloatArray  # (m,), how far apart those of a number are
    at: IntArray  # (m,), which of the g points of either side each number is moved at
    owner: IntArray  # (m,), recording that each moves alone; -1 for all of them

    @classmethod
    def around(cls, problem: Problem, x: FloatArray, size: FloatArray) -> Probed:
        """Return the points around a vector (m,), each number moved by its own size either way."""
        free, each = len(problem.free), np.arange(x.size)
        owner = np.array([-1] * free + [state.experiment for state in problem.states], np.int64)
        # The first states of all recordings share a point, and so do the second ones.
        named = [*range(free), *(free + state.row for state in problem.states)]
        at = np.unique(named, return_inverse=True)[1]
        count = int(at.max(initial=-1)) + 1
        low, high = problem.bounds
        up, down = np.minimum(x + size, high), np.maximum(x - size, low)
        points = np.repeat(x[:, None], 2 * count + 1, axis=1)
        points[each, 1 + at], points[each, 1 + count + at] = up, down
        apart = up - down
        return cls(points, np.where(apart > 0, apart, 1.0), at, owner)

    @property
    def count(self) -> int:
        """Number of points."""
        return self.points.shape[1]

    def columns(self, number: int, experiment: Experiment, channels: FloatArray) -> FloatArray:
        """Return derivatives of one experiment by every number and its residual, shape (n, c, m + 1) [noise sds]."""
        noise, count = experiment.recording.scatter[:, :, None], self.count // 2
        slopes = (channels[:, :, 1 : count + 1] - channels[:, :, count + 1 :])[:, :, self.at] / self.apart / noise
        slopes[:, :, ~np.isfinite(slopes).all(axis=(0, 1)) | ((self.owner >= 0) & (self.owner != number))] = 0.0
        residual = (channels[:, :, :1] - experiment.recording.output[:, :, None]) / noise
        return np.concatenate([slopes, residual], axis=2)


def simulated(bench: Bench, problems: Sequence[Problem], probes: Sequence[Probed]) -> list[list[FloatArray]]:
    """Return the columns of every recording of a bench, for each problem: all in one simulation."""
    edges = np.cumsum([0, *(probe.count for probe in probes)])
    channels = bench.predict(*side_by_side(problems, [probe.points for probe in probes]))
    return [
        [
            probe.columns(i, e, c[:, :, first : first + probe.count])
            for i, (e, c) in enumerate(zip(bench.experiments, channels, strict=True))
        ]
        for first, probe in zip(edges, probes, strict=False)
    ]


@dataclass(frozen=True)
class HalfStep:
    """What half the step changes at a parameter vector."""

    change: FloatArray  # (n,), of the fitted residuals, laid out as those of a bench [noise sds]
    resolves_slopes: bool  # whether it leaves the derivatives of the readings as they are


def half_step(problem: Problem, minimum: Minimum, sd: FloatArray) -> HalfStep:
    """Return what half the step changes, from one simulation on either.

    Dry friction on steps that are too long makes the motion chatter: differences of readings are then the solver's and
    not the model's, far larger than its slopes, and intervals made of them far too narrow.

    `problem`: on the simulators in question. `minimum`: where, with the derivatives of which intervals were made. `sd`
    (p,): standard deviations of the parameters, by which they are moved; what has none, NaN, is not judged.
    """
    known = np.isfinite(sd) & (sd > 0)
    probe = Probed.around(problem, minimum.x, np.where(known, sd, _LITTLE * problem.scale))
    with np.errstate(over="ignore", invalid="ignore"):
        (own,), (finer,) = (simulated(b, [problem], [probe]) for b in (problem.bench, problem.bench.finer(2)))
        size, apart = (sd * _sizes(each) for each in (finer, [a - b for a, b in zip(own, finer, strict=True)]))
        moved = [b[:, :, -1] - a[:, :, -1] for a, b in zip(own, finer, strict=True)]
    # What is so uncertain that the motion blows up within it tells nothing of the steps.
    judged = known & np.isfinite(size) & np.isfinite(apart)
    # By one standard deviation readings move by about their noise; by less where something else tells the parameter.
    resolved = apart <= _ERROR * np.maximum(size, 1.0)
    # Two that chatter may agree by chance, but move readings by far less than those of which the deviation was made.
    promised = sd * np.linalg.norm(minimum.jacobian[: problem.bench.n_rows], axis=0)
    resolved &= size >= _ERROR * np.minimum(promised, 1.0)
    fitted = [np.where(here, m[: len(here)], 0.0) for m, (_, here) in zip(moved, problem.bench.blocks(), strict=True)]
    return HalfStep(np.concatenate([each.reshape(-1) for each in fitted]), bool(resolved[judged].all()))


def _sizes(columns: Sequence[FloatArray]) -> FloatArray:
    """Return by how much all readings move per unit of every parameter, shape (p,) [noise sds]."""
    slopes = [c[:, :, :-1].reshape(-1, c.shape[2] - 1) for c in columns]
    return np.asarray(np.linalg.norm(np.concatenate(slopes), axis=0), np.float64)
