"""Inverse dynamics: motion and force through zero-phase low-passes, declared in the rig file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from discovery.foundation.arrays import BoolArray, FloatArray
from discovery.foundation.errors import InputError
from discovery.foundation.estimate_text import figures
from discovery.foundation.sampling import gaps, mean_rate, median_step
from discovery.recordings.file_signals import Signals
from discovery.recordings.flags import Flag
from discovery.rigs.rig import ForceView, Rig

_ORDER = 4
_EVEN = 0.01  # of a step, by which others may differ
_SHORT = 0.5  # of a step: through times that are nearer than that a spline swings
_SAMPLES_A_PERIOD = 2.0  # of the cutoff: noise that passed it is then white, and with more, neighbours tell the same
_SETTLING = 3.0  # periods of the cutoff at either end that the ends themselves disturb


def viewed(rig: Rig, found: Signals, noise: Sequence[float], flags: list[Flag]) -> list[float]:
    """Turn motion and force into what the view shows, the force with gaps; return the noise that is left."""
    view = rig.view
    assert view is not None
    assert found.inputs is not None
    if not is_even(found.time) and can_be_evened(found.time) and not any(map(_has_gaps, found.outputs.values())):
        found.time, signals = evened(found.time, {"input": found.inputs, **found.outputs})
        found.inputs, found.outputs = signals.pop("input"), signals
        flags[:] = [flag for flag in flags if flag.code != "times_irregular"]
        flags.append(Flag("evened", numbers={"step": median_step(found.time)}))
    rate = sampling_rate(found.time, found.source)
    moved = travelled(found.time, found.inputs) if rig.integrates else found.inputs
    found.inputs = zero_phase(moved, rate, view.motion_cutoff)
    if not found.outputs:
        return list(noise)
    force = found.outputs["output"]
    if _has_gaps(force):
        raise InputError(
            f"{found.source}: the force has gaps, so it cannot be low-passed as [view] asks. Take a part without gaps "
            "with samples = [start, stop]."
        )
    used = force_samples(view, found.time, rate)
    kept = {"count": used.size, "kept": int(used.sum()), "every": _every(view, rate), "cutoff": view.cutoff}
    flags.append(Flag("force_thinned", numbers=kept))
    found.outputs["output"] = np.where(used, zero_phase(force, rate, view.cutoff), np.nan)
    return [noise_gain(rate, view.cutoff) * value for value in noise]


def _has_gaps(values: FloatArray) -> bool:
    return bool(np.isnan(values).any())


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


def travelled(time: FloatArray, speed: FloatArray) -> FloatArray:
    """Return the place (n,), from zero at the first of the times, by the integral of a spline through its speed."""
    from scipy.interpolate import CubicSpline

    return np.asarray(CubicSpline(time, speed).antiderivative()(time))


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
    used = np.zeros(time.size, bool)
    used[:: _every(view, rate)] = True
    settling = _SETTLING / view.cutoff
    return used & (time >= time[0] + settling) & (time <= time[-1] - settling)


def _every(view: ForceView, rate: float) -> int:
    return max(view.decimation or 1, int(rate / (_SAMPLES_A_PERIOD * view.cutoff)))


def cutoff_for(count: int, duration: float, *, third: bool = False) -> float:
    """Return the lowest cutoff [Hz] by which so many samples of a force are used, in its last `third` perhaps.

    See `force_samples`; a third has one end.
    """
    part, ends = (3.0, 1.0) if third else (1.0, 2.0)
    return part * (count / _SAMPLES_A_PERIOD + ends * _SETTLING) / duration


def more_of_force(view: ForceView, time: FloatArray, count: int, *, third: bool) -> str:
    """Return how a force would be compared at so many times at least, see `cutoff_for`."""
    rate, enough = mean_rate(time), cutoff_for(count + 1, float(np.ptp(time)), third=third)
    if enough > 0.5 * rate:
        return "sample it more often"
    if view.decimation and view.decimation > rate / (_SAMPLES_A_PERIOD * max(enough, view.cutoff)):
        return "lower decimation in [view], or leave it out"
    to = f"from {view.cutoff:g} to {figures(enough, 2)} Hz in [view], and motion_cutoff_hz to as much at least"
    return f"raise cutoff_hz {to}: two readings a period of it count, and none within three periods of an end"


def _sections(rate: float, cutoff: float) -> FloatArray:
    from scipy.signal import butter

    return np.asarray(butter(_ORDER, cutoff, fs=rate, output="sos"), np.float64)
