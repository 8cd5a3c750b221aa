"""Whether an input repeats: its period in samples, and where it comes again."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft
from scipy.signal import find_peaks

from discovery.foundation.arrays import FloatArray
from discovery.foundation.sampling import stretches

MISMATCH = 0.01  # of the input's power, between a stretch and its repetition


class Periods(NamedTuple):
    """Period of an input in samples, and the stretches [start, stop) in which it comes again."""

    period: int
    stretches: list[tuple[int, int]]


def find_periods(u: FloatArray) -> Periods | None:
    """Period and stretches of the input: the lag, with its sign, at which most of its power comes again."""
    n = u.size
    spectrum = rfft(u, next_fast_len(2 * n))
    likeness = irfft(np.abs(spectrum) ** 2, next_fast_len(2 * n))[:n]
    best: tuple[float, int, list[tuple[int, int]]] = (0.0, 0, [])
    for sign in (1, -1):
        peaks, _ = find_peaks(sign * likeness, height=0.01 * likeness[0])
        peaks = peaks[(peaks >= 16) & (peaks < n - 16)]
        for lag in peaks[np.argsort(-sign * likeness[peaks], kind="stable")][:32]:
            # An odd multisine repeats half a period later with the opposite sign.
            period = int(lag) if sign > 0 else 2 * int(lag)
            stretches = _repeating(u, int(lag), sign)
            usable = [stretch for stretch in stretches if stretch[1] - stretch[0] >= period]
            again = sum((stop - start - lag) * float(np.var(u[start:stop])) for start, stop in stretches)
            # A sweep or a slow signal may happen to resemble itself for a short while.
            if usable and again > max(best[0], 0.25 * lag * float(np.var(u))):
                best = (again, period, usable)
    return Periods(best[1], best[2]) if best[2] else None


def _repeating(u: FloatArray, lag: int, sign: int) -> list[tuple[int, int]]:
    """Stretches [start, stop) in which every sample equals ``sign`` times the one a lag away, within `MISMATCH`."""
    width = max(16, lag // 64)
    square, variance = (u[lag:] - sign * u[:-lag]) ** 2, float(np.var(u))
    total = np.concatenate([[0.0], np.cumsum(square)])
    same = total[width:] - total[:-width] < MISMATCH * 2.0 * width * variance
    found: list[tuple[int, int]] = []
    for start, end in stretches(same):
        stop = end - 1 + width
        # The first and the last window may hold a few samples of what is next to them: they exceed the input's noise.
        alien = square[start:stop] > max(30.0 * np.median(square[start:stop]), 1e-12 * variance)
        half = width // 2
        stop -= half - int(np.argmax(alien[-half:])) if alien[-half:].any() else 0
        start += half - int(np.argmax(alien[:half][::-1])) if alien[:half].any() else 0
        if stop - start < 2 * width or (found and start <= found[-1][1] - width):
            continue
        # What hardly moves is like anything: it repeats where it differs little by its own motion.
        if np.mean(square[start:stop]) < MISMATCH * 2.0 * float(np.var(u[start : stop + lag])):
            found.append((int(start), int(stop) + lag))
    return found
