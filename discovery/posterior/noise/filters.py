"""Kalman filters of correlated residuals, compiled, many parameter sets side by side.

Residuals are in units of the whole noise. A filter of the process costs the same at every sample, whether samples are
regular or not (R. Kalman, Trans. ASME
J. Basic Engineering 82 (1960) 35; for these processes D. Foreman-Mackey et al., Astronomical Journal 154 (2017) 220).
Loops over parameter sets are innermost and have a constant length.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from discovery.foundation.arrays import BoolArray, FloatArray
from discovery.foundation.compiled_function import compiled

LANES = 32
FAST = {"contract", "reassoc", "nsz", "arcp"}
# So many numbers are multiplied before the logarithm of their product is taken.
TOGETHER = 8
# Samples are as far apart as the two before them if the intervals differ by less than this part.
_SAME = 1e-10


# First numbers of the rows of a block of lanes: quadratic form, logarithms, their product to come, share; ...
_Q, _LOG, _PROD, _SHARE = (LANES * row for row in range(4))
# ... mean, variance and decay of the exponential process; ...
_M, _P, _D = (LANES * row for row in range(4, 7))
# ... means of q and q' of the oscillator, and their covariance.
_X, _Y, _XX, _XY, _YY = (LANES * row for row in range(4, 9))


@njit(fastmath=FAST, error_model="numpy", forceinline=True)
def _begin(s, share):
    s[:] = 0.0
    s[_PROD : _PROD + LANES] = 1.0
    s[_SHARE : _SHARE + LANES] = share


@njit(fastmath=FAST, error_model="numpy", forceinline=True)
def _take_logarithm(s):
    for j in range(LANES):
        s[_LOG + j] += math.log(s[_PROD + j])
        s[_PROD + j] = 1.0


@njit(fastmath=FAST, error_model="numpy", forceinline=True)
def _finish(s, first, k, sums):
    for j in range(LANES):
        sums[first + j] = s[_Q + j]
        sums[k + first + j] = s[_LOG + j] + math.log(s[_PROD + j])


@compiled(nogil=True, fastmath=FAST, error_model="numpy")
def _exponential(time, seen, residual, share, tau, innovation, sums):
    n, c, k = residual.shape
    keep = innovation.shape[2] > 0
    s = np.empty(7 * LANES)
    for first in range(0, k, LANES):
        _begin(s, share[first : first + LANES])
        for channel in range(c):
            s[_M : _M + LANES] = 0.0
            s[_P : _P + LANES] = s[_SHARE : _SHARE + LANES]
            gap = -1.0
            held = 0
            for i in range(n):
                if i > 0:
                    step = time[i] - time[i - 1]
                    if abs(step - gap) > _SAME * step:
                        gap = step
                        for j in range(LANES):
                            s[_D + j] = math.exp(-step / tau[first + j])
                    for j in range(LANES):
                        s[_M + j] *= s[_D + j]
                        s[_P + j] = s[_SHARE + j] + s[_D + j] * s[_D + j] * (s[_P + j] - s[_SHARE + j])
                if not seen[i, channel]:
                    continue
                row = residual[i, channel]
                for j in range(LANES):
                    off = row[first + j] - s[_M + j]
                    white = 1.0 - s[_SHARE + j]
                    total = s[_P + j] + white
                    gain = s[_P + j] / total
                    s[_Q + j] += off * off / total
                    s[_PROD + j] *= total
                    s[_M + j] += gain * off
                    s[_P + j] = gain * white
                    if keep:
                        innovation[i, channel, first + j] = off / math.sqrt(total)
                held += 1
                if held == TOGETHER:
                    held = 0
                    _take_logarithm(s)
        _finish(s, first, k, sums)


@njit(fastmath=FAST, error_model="numpy", forceinline=True)
def _transition(step, omega, xi, phi):
    """Fill the transition of (q, q') over a step of q'' + xi q' + omega^2 q = 0, four rows of lanes."""
    for j in range(LANES):
        half = 0.5 * xi[j]
        square = omega[j] * omega[j] - half * half
        if square > 0.0:
            fast = math.sqrt(square)
            decay = math.exp(-half * step)
            even, odd = decay * math.cos(fast * step), decay * math.sin(fast * step) / fast
        else:
            slow = math.sqrt(-square)
            up, down = math.exp((slow - half) * step), math.exp(-(slow + half) * step)
            even = 0.5 * (up + down)
            odd = 0.5 * (up - down) / slow if slow > 1e-9 * omega[j] else step * even
        phi[j] = even + half * odd
        phi[LANES + j] = odd
        phi[2 * LANES + j] = -omega[j] * omega[j] * odd
        phi[3 * LANES + j] = even - half * odd


@njit(fastmath=FAST, error_model="numpy", forceinline=True)
def _carry(s, omega, phi):
    """Carry means and covariance of the oscillator over a step of this transition."""
    for j in range(LANES):
        f, g, h, e = phi[j], phi[LANES + j], phi[2 * LANES + j], phi[3 * LANES + j]
        mean = f * s[_X + j] + g * s[_Y + j]
        s[_Y + j] = h * s[_X + j] + e * s[_Y + j]
        s[_X + j] = mean
        # What is known beyond the stationary covariance decays; the rest is the stationary one.
        still = s[_SHARE + j] * omega[j] * omega[j]
        u, t, z = s[_XX + j] - s[_SHARE + j], s[_XY + j], s[_YY + j] - still
        s[_XX + j] = s[_SHARE + j] + f * f * u + 2.0 * f * g * t + g * g * z
        s[_XY + j] = f * h * u + (f * e + g * h) * t + g * e * z
        s[_YY + j] = still + h * h * u + 2.0 * h * e * t + e * e * z


@njit(fastmath=FAST, error_model="numpy", forceinline=True)
def _correct(s, slope, residual, innovation, keep):
    """Correct the oscillator by the residuals of one channel."""
    for j in range(LANES):
        off = residual[j] - slope * s[_X + j]
        white = 1.0 - s[_SHARE + j]
        cross, other = slope * s[_XX + j], slope * s[_XY + j]
        total = slope * cross + white
        s[_Q + j] += off * off / total
        s[_PROD + j] *= total
        s[_X + j] += cross / total * off
        s[_Y + j] += other / total * off
        s[_YY + j] -= other * other / total
        s[_XY + j] *= white / total
        s[_XX + j] *= white / total
        if keep:
            innovation[j] = off / math.sqrt(total)


@compiled(nogil=True, fastmath=FAST, error_model="numpy")
def _oscillating(time, seen, residual, share, omega, xi, slope, innovation, sums):
    n, c, k = residual.shape
    keep = innovation.shape[2] > 0
    phi = np.empty(4 * LANES)
    s = np.empty(9 * LANES)
    for first in range(0, k, LANES):
        lanes = slice(first, first + LANES)
        w, b = omega[lanes], xi[lanes]
        _begin(s, share[lanes])
        for j in range(LANES):
            s[_XX + j] = s[_SHARE + j]
            s[_YY + j] = s[_SHARE + j] * w[j] * w[j]
        gap = -1.0
        held = 0
        for i in range(n):
            if i > 0:
                step = time[i] - time[i - 1]
                if abs(step - gap) > _SAME * step:
                    gap = step
                    _transition(step, w, b, phi)
                _carry(s, w, phi)
            for channel in range(c):
                if not seen[i, channel]:
                    continue
                _correct(s, slope[i, channel], residual[i, channel, lanes], innovation[i, channel, lanes], keep)
                held += 1
                if held == TOGETHER:
                    held = 0
                    _take_logarithm(s)
        _finish(s, first, k, sums)


def padded(residual: FloatArray, *rows: FloatArray) -> tuple[FloatArray, list[FloatArray]]:
    """Return residuals (n, c, k) and rows (k,) with the last set repeated up to whole blocks of lanes."""
    k = residual.shape[2]
    which = np.minimum(np.arange(-(-k // LANES) * LANES), k - 1)
    spread = [np.broadcast_to(np.asarray(row, float), (k,))[which] for row in rows]
    return np.ascontiguousarray(residual if which.size == k else residual[:, :, which]), spread


def exponential(
    time: FloatArray, seen: BoolArray, residual: FloatArray, share: FloatArray, tau: FloatArray, keep: bool
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Filter residuals of unit variance, a share of which is exponentially correlated (Ornstein and Uhlenbeck).

    Times (n,) [s], which readings were seen (n, c), and residuals (n, c, k), whose channels are independent of each
    other; share of the variance and correlation time [s], both (k,). Returned are the sums of the squared innovations
    over their variances and of the logarithms of these variances, both (k,), and the innovations (n, c, k), white and
    of unit variance, zero in gaps; empty unless `keep` asks for them.
    """
    k = residual.shape[2]
    block, (a, t) = padded(residual, share, tau)
    innovation, sums = np.zeros((*seen.shape, block.shape[2] if keep else 0)), np.empty(2 * a.size)
    _exponential(time, seen, residual=block, share=a, tau=t, innovation=innovation, sums=sums)
    return sums[:k], sums[a.size : a.size + k], innovation[:, :, :k]


def oscillating(
    time: FloatArray,
    seen: BoolArray,
    residual: FloatArray,
    share: FloatArray,
    omega: FloatArray,
    xi: FloatArray,
    slope: FloatArray,
    keep: bool,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Filter residuals with a part that is one damped oscillator under white noise, seen by all channels.

    Arguments and results are those of `exponential`, but for the angular frequency omega [rad/s] and the damping xi
    [1/s] of the oscillator, each (k,), and what a channel sees of it, slope (n, c): the variance is one where the slope
    is.
    """
    k = residual.shape[2]
    block, (a, w, b) = padded(residual, share, omega, xi)
    innovation, sums = np.zeros((*seen.shape, block.shape[2] if keep else 0)), np.empty(2 * a.size)
    _oscillating(time, seen, residual=block, share=a, omega=w, xi=b, slope=slope, innovation=innovation, sums=sums)
    return sums[:k], sums[a.size : a.size + k], innovation[:, :, :k]
