"""What gravity and the sine say about the scale of a motion: an angle or a height that is in another unit.

The period of a pendulum grows with its amplitude as pi / 2K(sin(A/2)) shrinks, where A is in radians: that fixes the
scale of the angle whatever the length is. A body that falls slowly feels gravity alone, and drag never makes it faster.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from scipy.special import ellipk

from discovery.declarations.units import si_factor
from discovery.foundation.arrays import FloatArray
from discovery.foundation.sampling import median_step
from discovery.recordings.flags import Flag
from discovery.rigs.rig import Rig

Motion = tuple[FloatArray, FloatArray]

_ANGLES = ("turn", "rad", "deg", "mrad")
_LENGTHS = ("m", "ft", "inch", "cm", "mm")
#: Periods in one stretch whose amplitude and frequency are measured, and stretches that are needed.
_PERIODS, _FEWEST = 2.0, 4
#: Another unit must leave less than this share of what the declared one leaves.
_SHARE = 0.04
#: Frequencies are known to this part at best: a stretch decays, other effects act.
_FLOOR = 5e-4
#: Declared, they change the period with the amplitude as well as the sine does.
_BENDING = frozenset({"quadratic_stiffness", "cubic_stiffness", "quintic_stiffness"})
#: Beyond it a pendulum turns over [rad].
_LARGEST = 3.0
#: Share of the largest speed up to which a fall is slow, and samples that it needs.
_SLOW, _SAMPLES = 0.5, 8
#: Between these shares of gravity a slow fall begins, buoyancy and drag included.
_SLOWEST, _FASTEST = 0.5, 1.1
#: Standard deviations beyond which something is sure.
_SURE = 4.0


def angle_doubt(rig: Rig, motions: Sequence[Motion]) -> Flag | None:
    """Return a doubt about the unit of the angle of a pendulum that swings freely; None where there is none.

    Motions are times [s] and angles [rad] of one pendulum; NaN are gaps. A declared law that bends the period leaves no
    doubt: the sine is not alone then.
    """
    if _BENDING.intersection(rig.declared):
        return None
    measured = [row for time, angle in motions for row in _stretches(time, angle)]
    if len(measured) < _FEWEST:
        return None
    amplitude, frequency, sd = np.array(measured).T
    declared = si_factor(rig.columns.output.unit)
    # A period that hardly grows may be that of a pendulum with a spring: only larger units say something.
    larger = [unit for unit in _ANGLES if si_factor(unit) > 2.0 * declared]
    left = {unit: _misfit(amplitude * si_factor(unit) / declared, frequency, sd) for unit in larger}
    stated = _misfit(amplitude, frequency, sd)
    unit = min(left, key=lambda name: left[name], default="")
    if not unit or not left[unit] < _SHARE * stated or stated < _SURE**2 * len(measured):
        return None
    far = float(amplitude.max())
    slower, due = (float(_slowing(np.array(a))) for a in (far * si_factor(unit) / declared, far))
    sizes = {"right": unit, "slower": 100 * slower, "due": 100 * due, "amplitude": far}
    return Flag("angle_unit", unit=rig.columns.output.unit, numbers=sizes)


def _slowing(amplitude: FloatArray) -> FloatArray:
    """Return by which part the period is longer than that of small swings."""
    return ellipk(np.sin(0.5 * amplitude) ** 2) / (0.5 * np.pi) - 1.0


def _misfit(amplitude: FloatArray, frequency: FloatArray, sd: FloatArray) -> float:
    """Return the chi-square of frequencies against the sine's law, the length being free."""
    if amplitude.max() > _LARGEST:
        return np.inf
    law = 1.0 / (1.0 + _slowing(amplitude))
    weight = 1.0 / (sd**2 + (_FLOOR * frequency) ** 2)
    small = np.sum(weight * law * frequency) / np.sum(weight * law**2)
    return float(np.sum(weight * (frequency - small * law) ** 2))


def _stretches(time: FloatArray, angle: FloatArray) -> list[tuple[float, float, float]]:
    """Return amplitude, frequency [rad/s] and its standard deviation in stretches of a few periods."""
    good = np.isfinite(angle)
    if not good.any():
        return []
    t, x = time[good], angle[good] - np.median(angle[good])
    crossings = np.flatnonzero(np.diff(np.signbit(x)))
    if crossings.size < 4 or np.ptp(t) <= 0:
        return []
    first = np.pi / median_step(t[crossings])
    edges = np.arange(t[0], t[-1], _PERIODS * 2.0 * np.pi / first)
    found = []
    for start, stop in pairwise(np.searchsorted(t, edges).tolist()):
        # A coarse encoder may read one value at the end of a decay.
        if stop - start >= 8 * _PERIODS and np.ptp(x[start:stop]) > 0:
            row = _sine(t[start:stop], x[start:stop], first)
            # What noise makes of a stretch says nothing.
            found += [row] if 0.0 < row[2] < 0.02 * row[1] else []
    return found


def _sine(t: FloatArray, x: FloatArray, guess: float) -> tuple[float, float, float]:
    """Fit a decaying sine about a free centre: amplitude in the middle, frequency and its standard deviation."""
    from scipy.optimize import least_squares

    s = t - t.mean()

    def shape(p: FloatArray) -> FloatArray:
        phase = p[0] * s
        swing = (p[1] * np.cos(phase) + p[2] * np.sin(phase)) * (1.0 + p[3] * s)
        return swing + p[4] - x

    scale = np.sqrt(2.0) * np.std(x)
    start = [np.mean(x * f(guess * s)) * 2.0 for f in (np.cos, np.sin)]
    fit = least_squares(shape, [guess, *start, 0.0, 0.0], x_scale=[guess, scale, scale, guess, scale], max_nfev=50)
    slopes = np.asarray(fit.jac, np.float64)
    try:
        covariance = np.linalg.inv(slopes.T @ slopes) * 2.0 * fit.cost / max(t.size - 5, 1)
    except np.linalg.LinAlgError:
        return 0.0, guess, np.inf
    return float(np.hypot(fit.x[1], fit.x[2])), float(abs(fit.x[0])), float(np.sqrt(abs(covariance[0, 0])))


def fall_doubt(rig: Rig, motion: Motion) -> Flag | None:
    """Return a doubt about the units of a fall, times [s] and heights [m]; None where there is none. NaN are gaps."""
    gravity = rig.gravity.value if rig.gravity else np.nan
    good = np.isfinite(motion[1])
    found = slow_fall(motion[0][good], motion[1][good])
    if found is None:
        return None
    fall, sd, slow = found
    too_slow = slow and fall + _SURE * sd < _SLOWEST * gravity
    if not too_slow and not fall - _SURE * sd > _FASTEST * gravity:
        return None
    declared = si_factor(rig.columns.output.unit)
    fits = [u for u in _LENGTHS if 0.85 < fall * si_factor(u) / declared / gravity < 1.1]
    return Flag("fall_rate", numbers={"found": fall, "gravity": gravity, "right": fits[0] if fits else ""})


def slow_fall(t: FloatArray, height: FloatArray) -> tuple[float, float, bool] | None:
    """Return what acceleration a fall has where it is slow, as at its beginning or at the top of a throw.

    Times [s] and heights [m] are finite. None where they are too few.

    Returned: downwards, with its standard deviation [m/s^2], and whether the fall is slow anywhere; where it is not, of
    its first samples.
    """
    if t.size < _SAMPLES:
        return None
    speed = np.abs(np.gradient(height, t))
    # The first run of slow samples: it ends where drag counts, and a bounce later is no fall.
    steps = np.diff((speed <= _SLOW * np.quantile(speed, 0.95)).astype(int), prepend=0, append=0)
    runs = zip(np.flatnonzero(steps > 0).tolist(), np.flatnonzero(steps < 0).tolist(), strict=True)
    first, last = next((run for run in runs if run[1] - run[0] >= _SAMPLES), (0, 0))
    part = slice(first, max(last, _SAMPLES))
    s = t[part] - t[first]
    basis = np.vander(s, 3)
    solution, *_ = np.linalg.lstsq(basis, height[part], rcond=None)
    rest = height[part] - basis @ solution
    variance = np.sum(rest**2) / max(s.size - 3, 1) * np.linalg.inv(basis.T @ basis)[0, 0]
    return -2.0 * float(solution[0]), 2.0 * float(np.sqrt(variance)), last > 0
