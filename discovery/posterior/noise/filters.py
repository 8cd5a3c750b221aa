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
from numpy.typing import NDArray

from discovery.foundation.compiled_function import compiled

__all__ = ["FAST", "LANES", "TOGETHER", "exponential", "oscillating", "padded"]

FloatArray = NDArray[np.float64]

LANES = 32
FAST = {"contract", "reassoc", "nsz", "arcp"}
# So many numbers are multiplied before the logarithm of their product is taken.
TOGETHER = 8
# Samples are as far apart as the two before them if the intervals differ by less than this part.
_SAME = 1e-10


@compiled(nogil=True, fastmath=FAST, error_model="numpy")
def _exponential(time, seen, residual, share, tau, innovation, sums):
    n, c, k = residual.shape
    keep = innovation.shape[2] > 0
    s = np.empty(8 * LANES)
    # Rows of s: mean, variance, decay, innovation variance, quadratic form, logarithms, product, share.
    m, p, d, v, q, log, prod, a = (
        0, LANES, 2 * LANES, 3 * LANES, 4 * LANES, 5 * LANES, 6 * LANES, 7 * LANES,
    )  # fmt: skip
    for first in range(0, k, LANES):
        s[q : log + LANES] = 0.0
        s[prod : prod + LANES] = 1.0
        s[a : a + LANES] = share[first : first + LANES]
        for channel in range(c):
            s[m : m + LANES] = 0.0
            s[p : p + LANES] = s[a : a + LANES]
            gap = -1.0
            held = 0
            for i in range(n):
                if i > 0:
                    step = time[i] - time[i - 1]
                    if abs(step - gap) > _SAME * step:
                        gap = step
                        for j in range(LANES):
                            s[d + j] = math.exp(-step / tau[first + j])
                    for j in range(LANES):
                        s[m + j] *= s[d + j]
                        s[p + j] = s[a + j] + s[d + j] * s[d + j] * (s[p + j] - s[a + j])
                if not seen[i, channel]:
                    continue
                row = residual[i, channel]
                for j in range(LANES):
                    off = row[first + j] - s[m + j]
                    white = 1.0 - s[a + j]
                    total = s[p + j] + white
                    gain = s[p + j] / total
                    s[v + j] = total
                    s[q + j] += off * off / total
                    s[prod + j] *= total
                    s[m + j] += gain * off
                    s[p + j] = gain * white
                    if keep:
                        innovation[i, channel, first + j] = off / math.sqrt(total)
                held += 1
                if held == TOGETHER:
                    held = 0
                    for j in range(LANES):
                        s[log + j] += math.log(s[prod + j])
                        s[prod + j] = 1.0
        for j in range(LANES):
            sums[first + j] = s[q + j]
            sums[k + first + j] = s[log + j] + math.log(s[prod + j])


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


@compiled(nogil=True, fastmath=FAST, error_model="numpy")
def _oscillating(time, seen, residual, share, omega, xi, slope, innovation, sums):
    n, c, k = residual.shape
    keep = innovation.shape[2] > 0
    phi = np.empty(4 * LANES)
    s = np.empty(9 * LANES)
    # Rows of s: means of q and q', their covariance, quadratic form, logarithms, product, share.
    x, y, xx, xy, yy, q, log, prod, a = (
        0, LANES, 2 * LANES, 3 * LANES, 4 * LANES, 5 * LANES, 6 * LANES, 7 * LANES, 8 * LANES,
    )  # fmt: skip
    for first in range(0, k, LANES):
        w, b = omega[first : first + LANES], xi[first : first + LANES]
        s[:prod] = 0.0
        s[prod : prod + LANES] = 1.0
        s[a : a + LANES] = share[first : first + LANES]
        for j in range(LANES):
            s[xx + j] = s[a + j]
            s[yy + j] = s[a + j] * w[j] * w[j]
        gap = -1.0
        held = 0
        for i in range(n):
            if i > 0:
                step = time[i] - time[i - 1]
                if abs(step - gap) > _SAME * step:
                    gap = step
                    _transition(step, w, b, phi)
                for j in range(LANES):
                    f, g, h, e = phi[j], phi[LANES + j], phi[2 * LANES + j], phi[3 * LANES + j]
                    mean = f * s[x + j] + g * s[y + j]
                    s[y + j] = h * s[x + j] + e * s[y + j]
                    s[x + j] = mean
                    # What is known beyond the stationary covariance decays; the rest is the stationary one.
                    still = s[a + j] * w[j] * w[j]
                    u, t, z = s[xx + j] - s[a + j], s[xy + j], s[yy + j] - still
                    s[xx + j] = s[a + j] + f * f * u + 2.0 * f * g * t + g * g * z
                    s[xy + j] = f * h * u + (f * e + g * h) * t + g * e * z
                    s[yy + j] = still + h * h * u + 2.0 * h * e * t + e * e * z
            for channel in range(c):
                if not seen[i, channel]:
                    continue
                row, r = residual[i, channel], slope[i, channel]
                for j in range(LANES):
                    off = row[first + j] - r * s[x + j]
                    white = 1.0 - s[a + j]
                    cross, other = r * s[xx + j], r * s[xy + j]
                    total = r * cross + white
                    s[q + j] += off * off / total
                    s[prod + j] *= total
                    s[x + j] += cross / total * off
                    s[y + j] += other / total * off
                    s[yy + j] -= other * other / total
                    s[xy + j] *= white / total
                    s[xx + j] *= white / total
                    if keep:
                        innovation[i, channel, first + j] = off / math.sqrt(total)
                held += 1
                if held == TOGETHER:
                    held = 0
                    for j in range(LANES):
                        s[log + j] += math.log(s[prod + j])
                        s[prod + j] = 1.0
        for j in range(LANES):
            sums[first + j] = s[q + j]
            sums[k + first + j] = s[log + j] + math.log(s[prod + j])


def padded(residual: FloatArray, *rows: FloatArray) -> tuple[FloatArray, list[FloatArray]]:
    """Return residuals (n, c, k) and rows (k,) with the last set repeated up to whole blocks of lanes."""
    k = residual.shape[2]
    which = np.minimum(np.arange(-(-k // LANES) * LANES), k - 1)
    spread = [np.broadcast_to(np.asarray(row, float), (k,))[which] for row in rows]
    return np.ascontiguousarray(residual if which.size == k else residual[:, :, which]), spread


def exponential(
    time: FloatArray, seen: NDArray[np.bool_], residual: FloatArray, share: FloatArray, tau: FloatArray, keep: bool
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Filter residuals of unit variance, a share of which is exponentially correlated (Ornstein and Uhlenbeck).

    Parameters
    ----------
    time : ndarray, shape (n,)
        [s].
    seen : ndarray of bool, shape (n, c)
        False in gaps.
    residual : ndarray, shape (n, c, k)
        Channels are independent of each other.
    share, tau : ndarray, shape (k,)
        Share of the variance [-] and correlation time [s].
    keep : bool
        Whether the innovations are wanted.

    Returns
    -------
    square, log_variance : ndarray, shape (k,)
        Sums of the squared innovations over their variances and of the logarithms of these variances.
    innovation : ndarray, shape (n, c, k)
        White and of unit variance, zero in gaps; empty unless wanted.
    """
    k = residual.shape[2]
    block, (a, t) = padded(residual, share, tau)
    innovation, sums = np.zeros((*seen.shape, block.shape[2] if keep else 0)), np.empty(2 * a.size)
    _exponential(time, seen, block, a, t, innovation, sums)
    return sums[:k], sums[a.size : a.size + k], innovation[:, :, :k]


def oscillating(
    time: FloatArray,
    seen: NDArray[np.bool_],
    residual: FloatArray,
    share: FloatArray,
    omega: FloatArray,
    xi: FloatArray,
    slope: FloatArray,
    keep: bool,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Filter residuals with a part that is one damped oscillator under white noise, seen by all channels.

    Parameters
    ----------
    time, seen, residual, keep
        As in `exponential`; the variance is one where `slope` is.
    share, omega, xi : ndarray, shape (k,)
        Share of the variance [-], angular frequency [rad/s] and damping [1/s] of the oscillator.
    slope : ndarray, shape (n, c)
        What a channel sees of the oscillator.

    Returns
    -------
    square, log_variance, innovation
        As of `exponential`.
    """
    k = residual.shape[2]
    block, (a, w, b) = padded(residual, share, omega, xi)
    innovation, sums = np.zeros((*seen.shape, block.shape[2] if keep else 0)), np.empty(2 * a.size)
    _oscillating(time, seen, block, a, w, b, slope, innovation, sums)
    return sums[:k], sums[a.size : a.size + k], innovation[:, :, :k]
