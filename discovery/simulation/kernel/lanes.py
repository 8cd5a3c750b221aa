"""What every kernel does beside its own mathematics: loops over lanes, compiled once a process for all kernels.

`w` is the flat array of a kernel; a row is where the numbers of all lanes for one quantity begin in it. The array `at`
holds the numbers of `PLACES`: as arguments of their own the compiler would know them, and compile each function anew
for every kernel.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

from discovery.simulation.kernel.vectormath import atan2, cos, put, sin

#: What `at` tells of a kernel: first rows of parameters, states, motion (Y, S, K, F), readings, sums, the largest miss,
#: times and ages; numbers of parameters, of states, of lanes, and of all.
PLACES = ("P", "S", "Y", "R", "C", "M", "T", "L", "N_PARAMETERS", "N_STATES", "LANES", "SIZE")
PARAMETER, STATE, MOTION, READING, SUM, LARGEST, TIME, AGE, N_PARAMETERS, N_STATES, LANES, SIZE = range(len(PLACES))

FAST = {"contract", "reassoc", "nsz", "arcp"}
#: For what other compiled functions call, so without what others would need.
_INLINED: dict[str, Any] = {"forceinline": True, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
#: In a step nothing is allocated; counting who refers to an array would take an atomic instruction a lane.
_UNCOUNTED: dict[str, Any] = {"_nrt": False}
inner = njit(fastmath=FAST, error_model="numpy", **_INLINED, **_UNCOUNTED)


@njit(**_INLINED)
def workspace(at):
    """Return an array of zeros, which begins where a cache line does."""
    w = np.zeros(at[SIZE] + 8)
    return w[-w.ctypes.data % 64 // 8 :]


@inner
def hermite(f, h):
    """Weights of q0, q1, q0', q1', q0'', q1'' at fraction f of a step h."""
    f3 = f * f * f
    p1 = f3 * (10.0 + f * (-15.0 + 6.0 * f))
    d0 = f - f3 * (6.0 + f * (-8.0 + 3.0 * f))
    d1 = f3 * (-4.0 + f * (7.0 - 3.0 * f))
    c0 = 0.5 * (f * f + f3 * (-3.0 + f * (3.0 - f)))
    c1 = 0.5 * f3 * (1.0 + f * (-2.0 + f))
    return 1.0 - p1, p1, h * d0, h * d1, h * h * c0, h * h * c1


@inner
def cubic(f, h):
    """Weights of v0, v1, v0', v1' at fraction f of a step h."""
    p1 = f * f * (3.0 - 2.0 * f)
    return 1.0 - p1, p1, h * f * (1.0 - f) * (1.0 - f), h * f * f * (f - 1.0)


@inner
def _angle(x, y, motor):
    """Angle of the tip that is nearest to the motor's: a tip cannot be half a turn ahead of its hub."""
    ahead = atan2(y, x) - motor
    return motor + ahead - 2.0 * math.pi * np.floor(ahead / (2.0 * math.pi) + 0.5)


@inner
def _across(x, y, motor):
    """Distance of the tip from the axis of the hub."""
    return cos(motor) * y - sin(motor) * x


@inner
def _lagging(w, rows, i):
    """Whether the instrument of a lane is late: one of some amplitudes is there, or there are none."""
    for k in range(rows.size):
        if w[rows[k] + i] != 0.0:
            return True
    return rows.size == 0


@inner
def _waits(w, at, due, n_out, reach, i):
    """Whether the next output of a lane is read before a time."""
    return due[i] < n_out and not w[at[TIME] + i] - w[at[AGE] + i] > reach


@inner
def begin(w, at, parameters, initial, first):
    """Copy parameters and initial states, from column `first` on, and set the sums to zero."""
    lanes = at[LANES]
    for k in range(at[N_PARAMETERS]):
        for i in range(lanes):
            w[at[PARAMETER] + k * lanes + i] = parameters[k, first + i]
    for k in range(at[N_STATES]):
        for i in range(lanes):
            w[at[STATE] + k * lanes + i] = initial[k, first + i]
    # Those of all channels, and the largest miss behind them.
    for i in range(at[SUM], at[LARGEST] + lanes):
        w[i] = 0.0


@inner
def present(w, at, on, amplitudes, members):
    """Tell which effects are present in any lane, alone and in groups."""
    on[:] = False
    for k in range(amplitudes.shape[0]):
        for i in range(at[LANES]):
            if w[amplitudes[k, 0] + i] != 0.0:
                on[amplitudes[k, 1]] = True
    for k in range(members.shape[0]):
        if on[members[k, 0]]:
            on[members[k, 1]] = True


@inner
def play(w, at, motion, n):
    """Give all lanes the motion of one, which was kept: rows of Y, S, K and F."""
    lanes = at[LANES]
    for k in range(4 * at[N_STATES]):
        for i in range(lanes):
            w[at[MOTION] + k * lanes + i] = motion[n, k]


@inner
def keep(w, at, motion, n):
    """Keep the motion of the first lane."""
    for k in range(4 * at[N_STATES]):
        motion[n, k] = w[at[MOTION] + k * at[LANES]]


@inner
def turn(w, at, channel, motor):
    """Make of the tip's place its angle, or its distance from the hub's axis."""
    x, lanes = at[READING], at[LANES]
    if channel == 1:
        for i in range(lanes):
            w[x + i] = _angle(w[x + i], w[x + lanes + i], motor)
    elif channel == 2:
        for i in range(lanes):
            w[x + i] = _across(w[x + i], w[x + lanes + i], motor)


@inner
def store(w, at, k, out, j, place):
    """Copy the readings of a channel to where they are wanted."""
    put(out, (j, k, place), w, at[READING] + k * at[LANES], at[LANES])  # type: ignore[call-arg]


@inner
def result(w, at, count, sums, first):
    """Return the sums of squares of every channel, and the largest miss."""
    lanes = at[LANES]
    for k in range(count):
        for i in range(lanes):
            sums[k, first + i] = w[at[SUM] + k * lanes + i]
    for i in range(lanes):
        sums[count, first + i] = w[at[LARGEST] + i]


@inner
def tally(w, at, k, i):
    """Add what a channel misses to its sum of squares and to the largest miss."""
    lanes = at[LANES]
    miss = w[at[READING] + k * lanes + i]
    size = abs(miss)
    w[at[SUM] + k * lanes + i] += miss * miss
    w[at[LARGEST] + i] = size if size > w[at[LARGEST] + i] else w[at[LARGEST] + i]


@inner
def score_prompt(w, at, lags, k, out, j, place):
    """Add up what a channel misses in those lanes of a late block that are not late."""
    lanes = at[LANES]
    for i in range(lanes):
        if not _lagging(w, lags, i):
            tally(w, at, k, i)
            if out.shape[0] > 0:
                out[j, k, place + i] = w[at[READING] + k * lanes + i]


@inner
def wait(w, at, lags, due, out_time):
    """Let late lanes wait for their first output; return how many outputs a block without others has read."""
    done = out_time.size
    for i in range(due.size):
        w[at[TIME] + i] = out_time[0]
        due[i] = 0
        if not _lagging(w, lags, i):
            due[i] = out_time.size
            done = 0
    return done


@inner
def unread(due, n_out):
    """Return how many outputs are not yet read."""
    count = 0
    for i in range(due.size):
        count += n_out - due[i]
    return count


@inner
def waiting(w, at, due, n_out, reach):
    """Return how many lanes have an output to read."""
    count = 0
    for i in range(due.size):
        count += 1 if _waits(w, at, due, n_out, reach, i) else 0
    return count


@inner
def score_late(w, at, due, reach, channel, out_time, out_drive, target, weight, out, place):
    """Weigh and add up what lanes with an output to read miss, each at the time of its own."""
    x, lanes = at[READING], at[LANES]
    for i in range(lanes):
        if _waits(w, at, due, out_time.size, reach, i):
            if channel == 1:
                w[x + i] = _angle(w[x + i], w[x + lanes + i], out_drive[due[i], 0])
            elif channel == 2:
                w[x + i] = _across(w[x + i], w[x + lanes + i], out_drive[due[i], 0])
            for k in range(target.shape[1]):
                w[x + k * lanes + i] = weight[due[i], k] * (w[x + k * lanes + i] - target[due[i], k])
                tally(w, at, k, i)
                if out.shape[0] > 0:
                    out[due[i], k, place + i] = w[x + k * lanes + i]
            due[i] += 1
            if due[i] < out_time.size:
                w[at[TIME] + i] = out_time[due[i]]
