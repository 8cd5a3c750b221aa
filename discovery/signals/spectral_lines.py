"""Spectra of input and output at the lines of a multisine, and the noise at each of them.

References
----------
R. Pintelon, J. Schoukens, System Identification: A Frequency Domain Approach, 2nd ed., Wiley (2012), chapter 4.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.fft import fft, irfft, next_fast_len, rfft
from scipy.interpolate import CubicSpline
from scipy.signal import find_peaks
from scipy.signal.windows import dpss

from discovery.foundation.arrays import BoolArray, FloatArray, IntArray

MIN_LINES = 8  # within 20 dB of the strongest line; a swinging or stepping drive has fewer
EXCITED = 0.01  # power of an excited line relative to the strongest
MAX_SCATTER = 0.3  # of the amplitudes over realisations; random phases change nothing, noise has 0.5

MISMATCH = 0.01  # of the input's power, between a stretch and its repetition


class Lines(NamedTuple):
    """Powers |X_k / N|^2 of an averaged period at the lines k = 1, 2, ..., means over realisations."""

    multisine: Literal["odd", "full"]
    number: IntArray
    kinds: NDArray[np.str_]
    tones: BoolArray
    input: FloatArray
    total: FloatArray  # output as it is
    output: FloatArray  # without what unwanted input causes
    spread: FloatArray
    response: NDArray[np.complex128]


class LineNoise(NamedTuple):
    """Noise of an averaged period, as powers |Y_k / N|^2 at its lines; NaN if it is not known."""

    density: FloatArray
    rms: float  # of a single sample
    samples: int  # behind the estimate
    source: str
    kernel: FloatArray  # by which the density is smeared over neighbouring lines


def lines_of(u: FloatArray, y: FloatArray, periods: tuple[tuple[int, ...], ...], period: int) -> Lines | None:
    """Spectra of the periods, line by line; None if too few lines are excited."""
    number = np.arange(1, (period + 1) // 2)
    U, Y = (
        np.array([np.mean([rfft(x[s : s + period])[number] / period for s in starts], axis=0) for starts in periods])
        for x in (u, y)
    )
    power, total, realisations = _power(U), _power(Y), len(periods)
    kinds, tones = _classify(power)
    excited = kinds == "excited"
    if excited.sum() < MIN_LINES or _scatter(np.abs(U[:, excited])) > MAX_SCATTER:
        return None
    response = np.zeros(number.size, complex)
    first, *_, last = np.flatnonzero(excited)
    inside = slice(first, last + 1)
    response[inside] = CubicSpline(number[excited], np.mean(Y[:, excited] / U[:, excited], axis=0))(number[inside])
    error = Y - response * U
    spread = np.full(number.size, np.nan)
    if realisations > 1:
        spread[excited] = realisations / (realisations - 1) * _power(error[:, excited])
    multisine: Literal["odd", "full"] = "odd" if np.all(number[excited] % 2 == 1) else "full"
    return Lines(
        multisine,
        number,
        kinds=kinds,
        tones=tones,
        input=power,
        total=total,
        output=np.where(excited, total, _power(error)),
        spread=spread,
        response=response,
    )


def _scatter(amplitude: FloatArray) -> float:
    """Relative standard deviation of the lines' amplitudes over realisations, each scaled to the same power."""
    scaled = amplitude / np.sqrt(np.mean(amplitude**2, axis=1, keepdims=True))
    return float(np.sqrt(np.mean(np.var(scaled, axis=0)) / np.mean(scaled) ** 2))


def _power(spectra: NDArray[np.complex128]) -> FloatArray:
    """Mean over realisations of the squared magnitude of each line."""
    return np.mean(np.abs(spectra) ** 2, axis=0)


def _classify(power: FloatArray) -> tuple[NDArray[np.str_], BoolArray]:
    """Class of each line (k = 1, 2, ...) from the power of the input, and which lines hold a foreign tone."""
    number = np.arange(1, power.size + 1)
    excited = power > EXCITED * power.max()
    if np.mean(number[excited] % 2) > 0.98:
        # The few even lines of an odd multisine are tones such as mains hum.
        excited &= number % 2 == 1
    position = np.flatnonzero(excited)
    inside = (number > number[position[0]]) & (number < number[position[-1]])
    kinds = np.full(power.size, "interference")  # the longest name sets the width of the array
    kinds[:] = np.where(excited, "excited", np.where(inside, np.where(number % 2 == 1, "odd", "even"), "outside"))
    typical = np.median(power[~excited]) if not excited.all() else np.inf
    tones = ~excited & (power > max(100.0 * typical, 1e-5 * np.median(power[excited])))
    kinds[np.convolve(tones, np.ones(5), "same") > 0] = "interference"
    return kinds, tones


def tones_of(frequency: FloatArray, lines: Lines) -> tuple[float, ...]:
    """Frequency [Hz] of the strongest line of each group of lines with a foreign tone."""
    position = np.flatnonzero(lines.tones)
    groups = np.split(position, np.flatnonzero(np.diff(position) > 4) + 1)
    return tuple(float(frequency[group[np.argmax(lines.input[group])]]) for group in groups if group.size)


def line_noise(
    u: FloatArray, y: FloatArray, found: Periods, settling: int | None, lines: Lines, share: float
) -> LineNoise:
    """Noise at each line of the average of 1 / ``share`` periods, from changes after ``settling`` where it is known."""
    period, number = found.period, lines.number
    changes: list[tuple[FloatArray, FloatArray]] = []
    if settling is not None:
        changes = list(zip(period_changes(y, found, settling), period_changes(u, found, settling), strict=True))
    samples = sum(int(np.isfinite(dy).sum()) for dy, _ in changes)
    width = min(period, max(64, samples // 8), *(dy.size for dy, _ in changes)) if changes else 0
    frames = []
    if width >= 32:
        # Slepian tapers use short pieces to their ends; each has unit energy.
        tapers, bins, position = dpss(width, 2.0, 3), np.arange(width // 2 + 1), number * width / period
        response = np.interp(bins, position, lines.response)
        for dy, du in changes:
            for start in range(0, dy.size - width + 1, width // 2):
                piece = slice(start, start + width)
                if np.isfinite(dy[piece]).all():
                    frames.append(rfft(tapers * dy[piece]) - response * rfft(tapers * du[piece]))
    if frames:
        tones = position[lines.tones]
        clean = np.array([not np.any(np.abs(tones - k) < 2.0) for k in bins])
        # A difference has twice the power of the noise; |Y_k / N|^2 of white noise is its variance over N.
        density = _power(np.concatenate(frames)) / (2.0 * period)
        reach = (number.size - 1) // 2
        kernel = np.mean(np.abs(fft(tapers, period)) ** 2, axis=0)[np.arange(-reach, reach + 1)]
        # Noise is not periodic: that of a whole period leaks from a resonance to the other lines (Fejér's kernel).
        half_lines = np.interp(np.arange(period + 1) * 0.5 * width / period, bins[clean], density[clean])
        covariance = irfft(half_lines, 2 * period)
        lag = np.arange(2 * period)
        leaked = rfft(covariance * (1.0 - share * np.minimum(lag, 2 * period - lag) / period)).real
        rms = float(np.sqrt(period * covariance[0]))
        return LineNoise(
            share * np.maximum(leaked[2 * number], 0.0), rms, samples, "change from period to period", kernel
        )
    outside = np.flatnonzero(lines.kinds == "outside")
    outside = outside[outside.size // 2 :]
    if outside.size < 2 * MIN_LINES or number[outside[0]] < number[lines.kinds == "excited"][-1]:
        unknown = "not known, no period is repeated and no line is free above the band"
        return LineNoise(np.full(number.size, np.nan), np.nan, 0, unknown, np.ones(1))
    # Odd or even products may reach these lines: the quieter parity counts.
    level = min(float(np.mean(lines.total[outside[number[outside] % 2 == parity]])) for parity in (0, 1))
    rms, source = float(np.sqrt(period * level)), "lines above the band, taken as white"
    return LineNoise(np.full(number.size, level), rms, outside.size, source, np.ones(1))


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
    edges = np.flatnonzero(np.diff(np.concatenate([[False], same, [False]])))
    stretches: list[tuple[int, int]] = []
    for start, end in zip(edges[::2], edges[1::2], strict=True):
        stop = end - 1 + width
        # The first and the last window may hold a few samples of what is next to them: they exceed the input's noise.
        alien = square[start:stop] > max(30.0 * np.median(square[start:stop]), 1e-12 * variance)
        half = width // 2
        stop -= half - int(np.argmax(alien[-half:])) if alien[-half:].any() else 0
        start += half - int(np.argmax(alien[:half][::-1])) if alien[:half].any() else 0
        if stop - start < 2 * width or (stretches and start <= stretches[-1][1] - width):
            continue
        # What hardly moves is like anything: it repeats where it differs little by its own motion.
        if np.mean(square[start:stop]) < MISMATCH * 2.0 * float(np.var(u[start : stop + lag])):
            stretches.append((int(start), int(stop) + lag))
    return stretches


def period_changes(x: FloatArray, found: Periods, skip: int) -> list[FloatArray]:
    """Differences between samples one period apart, of each stretch that is long enough, after the first ``skip``."""
    spare = [stop - start - found.period for start, stop in found.stretches]
    long = max(32, max(spare) // 2)
    return [
        x[start + found.period + skip : stop] - x[start + skip : stop - found.period]
        for (start, stop), length in zip(found.stretches, spare, strict=True)
        if length >= long
    ]


def settling_of(y: FloatArray, found: Periods) -> tuple[bool, int]:
    """Whether the periods of the output were seen to become equal, and the samples that this takes."""
    changes = period_changes(y, found, 0)
    if not changes:
        return False, 0
    length = min(change.size for change in changes)
    block = max(16, length // 12)
    blocks = np.array([change[: length // block * block].reshape(-1, block) for change in changes])
    power = np.nanmean(np.where(np.isfinite(blocks).any(axis=(0, 2), keepdims=True), blocks, 0.0) ** 2, axis=(0, 2))
    floor = 4.0 * float(np.mean(power[2 * power.size // 3 :]))
    late = np.flatnonzero(power > floor)
    settling = 0
    if late.size:
        # Transients decay exponentially: at their rate so far, wait for another 15 dB.
        decayed_db = 10.0 * np.log10(power[late[0]] / floor) if floor > 0.0 else np.inf
        settling = int((late[-1] + 1) * block * (1.0 + min(15.0 / decayed_db, 2.0)))
    longest = 3 * length // 4
    return settling <= longest, min(settling, longest)


def whole_periods(
    u: FloatArray, y: FloatArray, found: Periods, settling: int
) -> tuple[tuple[tuple[int, ...], ...], bool]:
    """First samples of the whole periods that end each stretch, and whether all of them lie behind the transient."""
    period, steady, windows = found.period, True, []
    for start, stop in found.stretches:
        count = (stop - start - settling) // period
        starts = [stop - (j + 1) * period for j in reversed(range(max(count, 1)))]
        starts = [s for s in starts if np.isfinite(y[s : s + period]).all()]
        if starts and np.var(u[starts[0] : starts[0] + period]) > 0.1 * np.var(u):
            windows.append(tuple(starts))
            steady = steady and count > 0
    return tuple(windows), steady
