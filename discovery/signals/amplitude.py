"""Frequency and damping against amplitude, from the free decay of a motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from discovery.foundation.arrays import FloatArray
from discovery.foundation.sampling import median_step


@dataclass(frozen=True)
class Backbone:
    """Instantaneous frequency and damping of a free decay against amplitude, each (k,).

    The amplitude [q] is the mean of neighbouring extremes. The frequency [Hz] is from the time between extremes, the
    damping the decay rate of the energy, 2 ln(a_0/a_1) / (t_1 - t_0) [1/s]; xi of a linear oscillator.
    """

    amplitude: FloatArray
    frequency: FloatArray
    damping: FloatArray


def backbone(time: FloatArray, deflection: FloatArray, period: float, start: float) -> Backbone:
    """Return frequency and damping from the extremes of a free decay, times [s] and deflections [q]; NaN marks gaps.

    Extremes are vertices of parabolas fitted to a third of a half period around each turning point; frequency and
    damping are taken over whole periods, so that an offset of the rest position cancels to first order. `period` is a
    rough one [s], and from `start` on the system moves freely [s].
    """
    good = np.isfinite(deflection) & (time >= start)
    t, d = time[good], deflection[good]
    if t.size < 10 or t[-1] - t[0] < 2 * period:
        return Backbone(np.empty(0), np.empty(0), np.empty(0))
    width = max(1, round(period / 12 / median_step(t)))
    smooth = np.convolve(d, np.ones(2 * width + 1) / (2 * width + 1), mode="same")
    slope = np.sign(np.diff(smooth))
    slope[slope == 0] = 1
    turning = np.flatnonzero(slope[1:] != slope[:-1]) + 1
    times: list[float] = []
    values: list[float] = []
    for index in turning:
        near = np.abs(t - t[index]) < period / 6
        if near.sum() < 5 or (times and t[index] - times[-1] < 0.3 * period):
            continue
        # Half an arc, at an end or beside a gap, would put the vertex elsewhere.
        sides = t[index] - t[near][0], t[near][-1] - t[index]
        if min(sides) < 0.8 * period / 6:
            continue
        c, b, a = np.polynomial.polynomial.polyfit(t[near] - t[index], d[near], 2)
        if a == 0:
            continue
        vertex = -b / (2 * a)
        if abs(vertex) < period / 6:
            times.append(float(t[index] + vertex))
            values.append(float(c - b * b / (4 * a)))
    when, extreme = np.array(times), np.array(values)
    if when.size < 5:
        return Backbone(np.empty(0), np.empty(0), np.empty(0))
    swing = np.abs(np.diff(extreme)) / 2
    # Swing k lies between extremes k and k+1; two swings later is one period later.
    span = when[2:] - when[:-2]
    with np.errstate(divide="ignore", invalid="ignore"):
        decay = 2 * np.log(swing[:-2] / swing[2:]) / (when[2:-1] - when[:-3])
    n = decay.size
    return Backbone(swing[1 : n + 1], 1.0 / ((span[:n] + span[1 : n + 1]) / 2), decay)
