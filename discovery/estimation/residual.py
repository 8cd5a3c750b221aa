"""What a model leaves: size, whiteness, spectrum, and what the residual depends on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from scipy import stats

from discovery.estimation.problem import Problem
from discovery.foundation.arrays import FloatArray
from discovery.foundation.sampling import median_step, stride
from discovery.recordings.experiment import Experiment

#: Bins of the averaged residual in one period of the motion.
BINS_PER_PERIOD = 24
#: A prediction that errs by so many times the largest reading has blown up.
_BLOWN = 1e6
#: What leaves so many times the variance of the noise leaves little, however small the motion.
_NOISE = 4.0


@dataclass(frozen=True)
class Dependence:
    """How much of a residual's variance a state explains (correlation ratio over 12 quantile bins, F test)."""

    variable: str
    share: float
    p_value: float


@dataclass(frozen=True)
class ResidualReport:
    """A residual in numbers."""

    rms: float  # root mean square in units of the noise, all channels
    reduced_chi2: float  # mean square of the normalised residual
    #: Rms of the residual averaged over bins of a 24th of a period, with the noise's share removed, in units of the
    #: noise per sample: what is not noise and is slow enough to be motion.
    systematic: float
    autocorrelation: float  # at lag one, mean of the channels
    #: Probability of such autocorrelations (20 lags) in white noise; the smallest of the channels, times their number.
    ljung_box_p: float
    #: frequency, spectrum: one-sided power spectral density of the normalised residual, Welch, first recording [Hz],
    #: [1/Hz].
    frequency: tuple[float, ...]
    spectrum: tuple[float, ...]
    dependence: tuple[Dependence, ...]  # strongest first

    @property
    def white(self) -> bool:
        """Whether white noise is not rejected at one per cent."""
        return self.ljung_box_p > 0.01

    def summary(self) -> dict[str, Any]:
        """Return a JSON-ready description."""
        return {**asdict(self), "white": self.white}


def systematic_share(residual: FloatArray, time: FloatArray, period: float) -> float:
    """Return the rms of the bin-averaged normalised residual (n, c) with the noise's share removed.

    Averages over bins of `period` / 24 hold noise of variance 1/count; the excess of their mean square over that is
    the square of the result (zero where there is no excess).
    """
    label = np.floor((time - time[0]) / (period / BINS_PER_PERIOD)).astype(np.int64)
    excess: list[float] = []
    for channel in residual.T:
        good = np.isfinite(channel)
        count = np.bincount(label[good], minlength=label[-1] + 1)
        total = np.bincount(label[good], channel[good], minlength=label[-1] + 1)
        use = count > 0
        excess.append(float(np.mean((total[use] / count[use]) ** 2 - 1.0 / count[use])))
    return float(np.sqrt(max(0.0, float(np.mean(excess)))))


# A motion may blow up after the last fitted sample.
@np.errstate(over="ignore", invalid="ignore")
def _normalised(experiments: Sequence[Experiment], predictions: Sequence[FloatArray]) -> list[FloatArray]:
    """Return the residuals of the fitted samples in noise sds, NaN elsewhere, each (n, c)."""
    return [
        np.where(e.weights() > 0, (p - e.recording.output) * e.weights(), np.nan)
        for e, p in zip(experiments, predictions, strict=True)
    ]


def roughness(experiments: Sequence[Experiment], predictions: Sequence[FloatArray], period: float) -> float:
    """Return the systematic share of what predictions leave of the fitted samples [noise sds], rms over recordings."""
    parts = zip(_normalised(experiments, predictions), experiments, strict=True)
    shares = [systematic_share(part, e.recording.time, period) for part, e in parts]
    return float(np.sqrt(np.mean(np.square(shares))))


def _ljung_box(series: FloatArray, lags: int = 20) -> tuple[float, float]:
    """Return the lag-one autocorrelation and the p-value of Ljung and Box, Biometrika 65 (1978) 297."""
    n = series.size
    centred = series - series.mean()
    variance = centred @ centred
    if variance == 0:
        return 0.0, 1.0
    lags = min(lags, n // 5)
    r = np.array([float(centred[k:] @ centred[:-k]) for k in range(1, lags + 1)]) / variance
    statistic = n * (n + 2) * float(np.sum(r**2 / (n - np.arange(1, lags + 1))))
    return float(r[0]), float(stats.chi2.sf(statistic, lags))


def memory(series: FloatArray) -> float:
    """Return the variance of the mean of a series over that of white noise: (1 + r) / (1 - r), with r at lag one.

    It is taken about zero: what is off throughout is no noise of single readings.
    """
    power = float(series @ series)
    correlation = min(float(series[1:] @ series[:-1]) / power, 0.99) if power else 0.0
    return (1 + correlation) / (1 - correlation)


def correlation_length(experiments: Sequence[Experiment], predictions: Sequence[FloatArray]) -> float:
    """Return by how much the variance of a mean of fitted residuals exceeds that of white noise, at least one.

    The mean of the channels, each taken as a first-order process, see `memory`.
    """
    lengths = [memory(c[np.isfinite(c)]) for part in _normalised(experiments, predictions) for c in part.T]
    return max(1.0, float(np.mean(lengths)))


def _dependence(name: str, variable: FloatArray, residual: FloatArray) -> Dependence:
    edges = np.unique(np.quantile(variable, np.linspace(0, 1, 13)))
    label = np.clip(np.searchsorted(edges, variable, side="right") - 1, 0, max(0, edges.size - 2))
    count = np.bincount(label)
    mean = np.bincount(label, residual) / np.maximum(count, 1)
    between = float(np.sum(count * (mean - residual.mean()) ** 2))
    total = float(np.sum((residual - residual.mean()) ** 2))
    k, n = int(np.sum(count > 0)), residual.size
    if total == 0 or k < 2:
        return Dependence(name, 0.0, 1.0)
    f = (between / (k - 1)) / max((total - between) / (n - k), 1e-300)
    return Dependence(name, between / total, float(stats.f.sf(f, k - 1, n - k)))


def _states(experiment: Experiment, period: float) -> dict[str, FloatArray]:
    """Return measured states by which a residual may be sorted; rates by central differences of bin averages."""
    t = experiment.recording.time
    d = experiment.deflection
    good = np.isfinite(d)
    filled = np.interp(t, t[good], d[good])
    width = max(3, int(period / BINS_PER_PERIOD / max(median_step(t), 1e-12)) | 1)
    smooth = np.convolve(np.pad(filled, width // 2, mode="edge"), np.ones(width) / width, mode="valid")
    rate = np.gradient(smooth, t)
    scale = period / (2 * np.pi)
    return {
        "time": t,
        "deflection" if experiment.system.has_rod else "output": filled,
        "rate": rate,
        "phase": np.arctan2(-rate * scale, smooth),
        "amplitude": np.hypot(rate * scale, smooth),
        # Without a rod it is the deflection once more.
        **({"angle": filled + experiment.motor_angle} if experiment.system.has_rod else {}),
    }


def examine(experiments: Sequence[Experiment], predictions: Sequence[FloatArray], period: float) -> ResidualReport:
    """Examine the fitted part of recordings.

    `predictions` each (n, c): what the model says about each. `period`: period of the motion [s].
    """
    parts = _normalised(experiments, predictions)
    flat = np.concatenate([p.ravel() for p in parts])
    everything = flat[good := np.isfinite(flat)]
    lags, p_values = zip(*(_ljung_box(c[np.isfinite(c)]) for part in parts for c in part.T), strict=True)
    from scipy.signal import welch

    # Of a force one reading of several is compared: they have a rate of their own.
    rows = np.flatnonzero(np.isfinite(parts[0]).all(axis=1))
    every = stride(rows)
    compared = parts[0][int(rows[:1].sum()) % every :: every]
    clean = np.where(np.isfinite(compared), compared, 0.0)
    rate = 1.0 / (every * median_step(experiments[0].recording.time))
    frequency, density = welch(clean, rate, nperseg=min(1024, len(clean)), axis=0)
    dependence = []
    states = [_states(e, period) for e in experiments]
    for before, after in pairwise(states):
        # One recording after the other: what drifts may drift otherwise in each.
        after["time"] = after["time"] + (before["time"][-1] - after["time"][0])
    for name in states[0]:
        value = np.concatenate([np.repeat(s[name], p.shape[1]) for s, p in zip(states, parts, strict=True)])
        dependence.append(_dependence(name, value[good], flat[good]))
    return ResidualReport(
        rms=float(np.sqrt(np.mean(everything**2))),
        reduced_chi2=float(np.mean(everything**2)),
        systematic=roughness(experiments, predictions, period),
        autocorrelation=float(np.mean(lags)),
        ljung_box_p=float(min(1.0, min(p_values) * len(p_values))),
        frequency=tuple(frequency.tolist()),
        spectrum=tuple(density.mean(axis=1).tolist()),
        dependence=tuple(sorted(dependence, key=lambda d: -d.share)),
    )


@np.errstate(over="ignore", invalid="ignore")
def errors(prediction: FloatArray, measured: FloatArray) -> dict[str, float]:
    """Return rms, mean and peak of the error: Euclidean distance over the channels, samples with finite output only.

    They are infinite where the prediction of one of these is not finite, or beyond all measure.

    `prediction` (n, c or more), `measured` (n, c): free-run prediction and measurement.
    """
    prediction = prediction[:, : measured.shape[1]]
    taken = np.isfinite(measured).all(axis=1)
    distance = np.sqrt(np.sum((prediction[taken] - measured[taken]) ** 2, axis=1))
    largest = float(np.abs(measured[taken]).max(initial=0.0))
    distance[~(distance <= (_BLOWN * largest or np.inf))] = np.inf
    if distance.size == 0:
        return dict.fromkeys(("rms", "mean", "peak"), float("nan"))
    rms = float(np.sqrt(np.mean(distance**2)))
    return {"rms": rms, "mean": float(distance.mean()), "peak": float(distance.max())}


def variance_left(problem: Problem, chi2: float) -> float:
    """Return which part of the variance of the readings a fit leaves; zero where that is little more than the noise.

    `problem`: what was fitted. `chi2`: sum of squared normalised residuals of the fit.
    """
    spread = 0.0
    for e in problem.bench.experiments:
        read = np.where(e.weights() > 0, e.recording.output, np.nan) * e.weights()
        spread += float(np.nansum((read - np.nanmean(read, axis=0)) ** 2))
    return chi2 / spread if chi2 > _NOISE * problem.bench.n_data else 0.0


def explains(problem: Problem, chi2: float, left: float) -> bool:
    """Return whether a fit leaves a small part of the variance of the motion, or little more than the noise.

    `problem`: of a motion that is simulated. `chi2`: sum of squared normalised residuals of the fit. `left`: what
    counts as a small part.
    """
    spread = 0.0
    for e in problem.bench.experiments:
        # Of an arm the tip may be read, and its deflection is an angle.
        lever = problem.units.length if e.system.has_rod and e.recording.units[0] != "rad" else 1.0
        read = lever * e.deflection[e.fitted] / e.recording.noise[0]
        spread += float(np.nansum((read - np.nanmean(read)) ** 2))
    return bool(chi2 < max(left * spread, _NOISE * problem.bench.n_data))
