"""Inverse dynamics: motion and force through zero-phase low-passes, declared in the rig file."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from discovery.foundation.arrays import BoolArray, FloatArray
from discovery.foundation.errors import InputError
from discovery.foundation.sampling import gaps, mean_rate, median_step
from discovery.rigs.rig import ForceView

_ORDER = 4
_EVEN = 0.01  # of a step, by which others may differ
_SHORT = 0.5  # of a step: through times that are nearer than that a spline swings
_SAMPLES_A_PERIOD = 2.0  # of the cutoff: noise that passed it is then white, and with more, neighbours tell the same
_SETTLING = 3.0  # periods of the cutoff at either end that the ends themselves disturb


def is_even(time: FloatArray) -> bool:
    """Return whether the steps between times are equal, up to a hundredth."""
    steps = np.diff(time)
    return bool(np.max(np.abs(steps - steps.mean())) <= _EVEN * steps.mean())


def can_be_evened(time: FloatArray) -> bool:
    """Return whether steps between times are alike enough for splines: none half as long again, none half as long."""
    return not gaps(time).any() and bool(np.diff(time).min() > _SHORT * median_step(time))


def evened(time: FloatArray, signals: Mapping[str, FloatArray]) -> tuple[FloatArray, dict[str, FloatArray]]:
    """Return as many times (n,) in equal steps, and signals (n,) there, by cubic splines."""
    from scipy.interpolate import CubicSpline

    even = np.linspace(time[0], time[-1], time.size)
    return even, {name: np.asarray(CubicSpline(time, values)(even)) for name, values in signals.items()}


def sampling_rate(time: FloatArray, source: str) -> float:
    """Return the rate of times [Hz] whose steps must be equal, up to a hundredth."""
    if not is_even(time):
        raise InputError(
            f"{source}: the times are not equally spaced, so the signals cannot be low-passed as [view] asks. Take a "
            "part without gaps with samples = [start, stop]."
        )
    return mean_rate(time)


def zero_phase(values: FloatArray, rate: float, cutoff: float) -> FloatArray:
    """Low-pass equally spaced samples (n, ...) along the first axis: a Butterworth filter of order 4, to and fro.

    The amplitude is halved at `cutoff` [Hz]; from half the rate [Hz] on nothing is done.
    """
    from scipy.signal import sosfiltfilt

    if cutoff >= 0.5 * rate:
        return values
    return np.asarray(sosfiltfilt(_sections(rate, cutoff), values, axis=0), np.float64)


def noise_gain(rate: float, cutoff: float) -> float:
    """Return by how much `zero_phase` reduces the standard deviation of white noise."""
    from scipy.signal import sosfreqz

    if cutoff >= 0.5 * rate:
        return 1.0
    _, response = sosfreqz(_sections(rate, cutoff), worN=np.linspace(0.0, np.pi, 16385))
    return float(np.sqrt(np.mean(np.abs(response) ** 4)))


def force_samples(view: ForceView, time: FloatArray, rate: float) -> BoolArray:
    """Mark the samples of the force that are used, without those that the ends disturb.

    They are thinned as `view` says, and at least until their noise is white.
    """
    every = max(view.decimation or 1, int(rate / (_SAMPLES_A_PERIOD * view.cutoff)))
    used = np.zeros(time.size, bool)
    used[::every] = True
    settling = _SETTLING / view.cutoff
    return used & (time >= time[0] + settling) & (time <= time[-1] - settling)


def _sections(rate: float, cutoff: float) -> FloatArray:
    from scipy.signal import butter

    return np.asarray(butter(_ORDER, cutoff, fs=rate, output="sos"), np.float64)
