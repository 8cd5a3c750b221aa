"""What a periodic multisine says by itself: noise level, even and odd nonlinear distortion, before any model.

A linear system in steady state answers a multisine at the excited lines only. Of an odd multisine, which excites odd
multiples of 1 / period, even powers of a nonlinearity fall on even lines and odd powers on odd lines: on those left
free, and on the excited ones, where they change with the random phases from realisation to realisation. What does not
repeat from period to period is noise. What the measured input holds at lines that it should not is taken off through
the frequency response, interpolated between the excited lines.

References
----------
R. Pintelon, J. Schoukens, System Identification: A Frequency Domain Approach, 2nd ed., Wiley (2012), chapter 4.
J. Schoukens, R. Pintelon, T. Dobrowiecki, Y. Rolain, Automatica 41 (2005) 491 (odd multisines, robust method).
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.fft import fft, irfft, next_fast_len, rfft
from scipy.interpolate import CubicSpline
from scipy.signal import find_peaks
from scipy.signal.windows import dpss
from scipy.stats import f as f_distribution

if TYPE_CHECKING:
    from discovery.recording import Recording

__all__ = ["Distortion", "Multisine", "analyse_multisine"]

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

_Parity = Literal["odd", "even", "odd or even"]
_Basis = Literal["unexcited lines", "spread over realisations"]

IRREGULAR = 0.05  # of a sampling interval: times may be rounded
MISMATCH = 0.01  # of the input's power, between a stretch and its repetition
MIN_LINES = 8  # within 20 dB of the strongest line; a swinging or stepping drive has fewer
EXCITED = 0.01  # power of an excited line relative to the strongest
MAX_SCATTER = 0.3  # of the amplitudes over realisations; random phases change nothing, noise has 0.5
SIGNIFICANCE = 1e-3
MARGIN_DB = 1.0  # noise through a resonance makes its own estimate less certain than white noise would


class _Periods(NamedTuple):
    period: int
    stretches: list[tuple[int, int]]


class _Lines(NamedTuple):
    """Powers |X_k / N|^2 of an averaged period at the lines k = 1, 2, ..., means over realisations."""

    multisine: Literal["odd", "full"]
    number: IntArray
    kinds: NDArray[np.str_]
    tones: NDArray[np.bool_]
    input: FloatArray
    total: FloatArray  # output as it is
    output: FloatArray  # without what unwanted input causes
    spread: FloatArray
    response: NDArray[np.complex128]


class _Noise(NamedTuple):
    density: FloatArray
    rms: float  # of a single sample
    samples: int  # behind the estimate
    source: str
    kernel: FloatArray  # by which the density is smeared over neighbouring lines


@dataclass(frozen=True)
class Distortion:
    """Nonlinear distortion of one parity within the excited band.

    Attributes
    ----------
    parity : str
        ``"odd"``, ``"even"``, or ``"odd or even"`` if the multisine excites both kinds of lines.
    basis : str
        ``"unexcited lines"``, or ``"spread over realisations"``: of the excited lines, around the mean response. The
        second sees what changes with the phases; the rest of the distortion looks like a change of that response.
    lines : int
        Number of lines used.
    level, noise : float
        Rms of the distortion (noise taken off) and of the noise on these lines, in the output's unit.
    ratio_db : float
        Power, noise included, over that of the noise, averaged over these lines [dB]; NaN if the noise is not known.
    limit_db : float
        Ratio that white noise alone exceeds with a probability of 0.001 (F distribution), and 1 dB more.
    peak : float
        Frequency around which the power is largest [Hz].
    detected : bool or None
        Whether the ratio exceeds the limit; None if that cannot be judged.
    """

    parity: _Parity
    basis: _Basis
    lines: int
    level: float
    noise: float
    ratio_db: float
    limit_db: float
    peak: float
    detected: bool | None


@dataclass(frozen=True)
class Multisine:
    """Spectrum of a recording under a periodic multisine, line by line.

    Levels are rms values of the sine at a line, of one averaged period, in the signal's unit.

    Attributes
    ----------
    period : int
        Samples.
    rate : float
        Sampling rate [Hz].
    periods : tuple of tuple of int
        First sample of every whole period that was used, by realisation.
    kind : str
        ``"odd"`` or ``"full"``.
    settling : float
        Time after the start of a realisation until its periods repeat [s].
    steady : bool
        Whether every period used lies behind it; no verdicts otherwise, as transients reach every line.
    frequency : ndarray, shape (n,)
        Of every line k / period, k = 1, 2, ... [Hz].
    line_class : ndarray of str, shape (n,)
        ``"excited"``, ``"odd"`` and ``"even"`` (unexcited, in the band), ``"outside"`` or ``"interference"`` (near a
        tone of the input that is no line of the period, such as mains hum or drift; used for nothing).
    input, output : ndarray, shape (n,)
        Levels; the output in the band without the part that unwanted input causes.
    spread : ndarray, shape (n,)
        Level of the variation over realisations at excited lines, NaN elsewhere and for a single realisation.
    noise : ndarray, shape (n,)
        Level of the noise; NaN if it is not known.
    noise_rms : float
        Standard deviation of the output's noise over all frequencies but those tones, of single samples.
    noise_source : str
        How it was found.
    interference : tuple of float
        Frequencies of the tones [Hz].
    distortions : tuple of Distortion
    unit : str
        Of the output.
    """

    period: int
    rate: float
    periods: tuple[tuple[int, ...], ...]
    kind: Literal["odd", "full"]
    settling: float
    steady: bool
    frequency: FloatArray
    line_class: NDArray[np.str_]
    input: FloatArray
    output: FloatArray
    spread: FloatArray
    noise: FloatArray
    noise_rms: float
    noise_source: str
    interference: tuple[float, ...]
    distortions: tuple[Distortion, ...]
    unit: str

    def verdict(self) -> tuple[str, ...]:
        """Say in one sentence each what the noise is and whether there is distortion, of which parity."""
        known = np.isfinite(self.noise_rms)
        level = f"{self.noise_rms:.3g} {self.unit} rms ({self.noise_source})"
        noise = f"noise: {level if known else self.noise_source}"
        return (noise, *(self._sentence(distortion) for distortion in self.distortions))

    def _sentence(self, found: Distortion) -> str:
        if found.detected is None:
            why = "the noise is not known" if self.steady else "the periods were not seen to settle"
            return f"{found.parity} nonlinearity: cannot be judged, {why}"
        where = f"{found.basis}, {found.lines} lines"
        if not found.detected:
            limit = f"the limit is {found.limit_db:.1f} dB"
            return f"{found.parity} nonlinearity: no, {found.ratio_db:.1f} dB above the noise; {limit} ({where})"
        against = f"{found.level:.3g} against {found.noise:.3g} {self.unit} rms, most near {found.peak:.3g} Hz"
        return (
            f"{found.parity} nonlinearity: yes, {found.ratio_db:.1f} dB above the noise, {against} ({where}): "
            f"{found.parity} powers are suggested"
        )

    def summary(self) -> dict[str, Any]:
        """Return the numbers of the analysis without its arrays; NaN where one is not known."""
        excited = self.frequency[self.line_class == "excited"]
        return {
            "kind": self.kind,
            "period_samples": self.period,
            "period_s": self.period / self.rate,
            "realisations": len(self.periods),
            "periods": [len(starts) for starts in self.periods],
            "excited_lines": int(excited.size),
            "band_hz": [float(excited[0]), float(excited[-1])],
            "settling_s": self.settling,
            "steady": self.steady,
            "unit": self.unit,
            "noise_rms": self.noise_rms,
            "noise_source": self.noise_source,
            "interference_hz": list(self.interference),
            "distortions": [asdict(distortion) for distortion in self.distortions],
            "verdict": list(self.verdict()),
        }


def analyse_multisine(recording: Recording, channel: int = 0) -> Multisine | None:
    """Find the periods of a multisine in the input and read noise and distortion off the output's lines.

    Realisations with different phases may follow one another, with or without pauses; the period is found on the
    input, as the lag at which stretches of it come again (or come again with the opposite sign, at half the period of
    an odd multisine). It must be a whole number of samples.

    Parameters
    ----------
    recording : Recording
        Uniformly sampled; periods with gaps are left out.
    channel : int
        Column of the output.

    Returns
    -------
    Multisine or None
        None if the input is missing, irregularly sampled, or no multisine: nothing in it comes again, or fewer than
        eight lines carry it.
    """
    time = recording.time
    if recording.input is None or time.size < 64:
        return None
    step = float(time[-1] - time[0]) / (time.size - 1)
    if np.max(np.abs(time - np.linspace(time[0], time[-1], time.size))) > IRREGULAR * step:
        return None
    u, y = recording.input - recording.input.mean(), recording.output[:, channel]
    found = _find_periods(u)
    if found is None:
        return None
    settled, settling = _settling(y, found)
    periods, behind = _windows(u, y, found, settling)
    lines = _lines(u, y, periods, found.period) if periods else None
    if lines is None:
        return None
    steady = settled and behind
    share = float(np.mean([1.0 / len(starts) for starts in periods]))
    floor = _noise(u, y, found, settling if settled else None, lines, share)
    rate = 1.0 / step
    frequency = lines.number * rate / found.period
    return Multisine(
        period=found.period,
        rate=rate,
        periods=periods,
        kind=lines.multisine,
        settling=settling / rate,
        steady=steady,
        frequency=frequency,
        line_class=lines.kinds,
        input=np.sqrt(2.0 * lines.input),
        output=np.sqrt(2.0 * lines.output),
        spread=np.sqrt(2.0 * lines.spread),
        noise=np.sqrt(2.0 * floor.density),
        noise_rms=floor.rms,
        noise_source=floor.source,
        interference=_tones(frequency, lines),
        distortions=_distortions(lines, frequency, floor, len(periods), steady),
        unit=recording.units[channel],
    )


def _find_periods(u: FloatArray) -> _Periods | None:
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
    return _Periods(best[1], best[2]) if best[2] else None


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
        if stop - start >= 2 * width and (not stretches or start > stretches[-1][1] - width):
            stretches.append((int(start), int(stop) + lag))
    return stretches


def _changes(x: FloatArray, found: _Periods, skip: int) -> list[FloatArray]:
    """Differences between samples one period apart, of each stretch that is long enough, after the first ``skip``."""
    spare = [stop - start - found.period for start, stop in found.stretches]
    long = max(32, max(spare) // 2)
    return [
        x[start + found.period + skip : stop] - x[start + skip : stop - found.period]
        for (start, stop), length in zip(found.stretches, spare, strict=True)
        if length >= long
    ]


def _settling(y: FloatArray, found: _Periods) -> tuple[bool, int]:
    """Whether the periods of the output were seen to become equal, and the samples that this takes."""
    changes = _changes(y, found, 0)
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


def _windows(u: FloatArray, y: FloatArray, found: _Periods, settling: int) -> tuple[tuple[tuple[int, ...], ...], bool]:
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


def _lines(u: FloatArray, y: FloatArray, periods: tuple[tuple[int, ...], ...], period: int) -> _Lines | None:
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
    return _Lines(
        multisine, number, kinds, tones, power, total, np.where(excited, total, _power(error)), spread, response
    )


def _scatter(amplitude: FloatArray) -> float:
    """Relative standard deviation of the lines' amplitudes over realisations, each scaled to the same power."""
    scaled = amplitude / np.sqrt(np.mean(amplitude**2, axis=1, keepdims=True))
    return float(np.sqrt(np.mean(np.var(scaled, axis=0)) / np.mean(scaled) ** 2))


def _power(spectra: NDArray[np.complex128]) -> FloatArray:
    """Mean over realisations of the squared magnitude of each line."""
    return np.mean(np.abs(spectra) ** 2, axis=0)


def _classify(power: FloatArray) -> tuple[NDArray[np.str_], NDArray[np.bool_]]:
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


def _tones(frequency: FloatArray, lines: _Lines) -> tuple[float, ...]:
    """Frequency [Hz] of the strongest line of each group of lines with a foreign tone."""
    position = np.flatnonzero(lines.tones)
    groups = np.split(position, np.flatnonzero(np.diff(position) > 4) + 1)
    return tuple(float(frequency[group[np.argmax(lines.input[group])]]) for group in groups if group.size)


def _noise(u: FloatArray, y: FloatArray, found: _Periods, settling: int | None, lines: _Lines, share: float) -> _Noise:
    """Noise at each line of the average of 1 / ``share`` periods, from changes after ``settling`` where it is known."""
    period, number = found.period, lines.number
    changes: list[tuple[FloatArray, FloatArray]] = []
    if settling is not None:
        changes = list(zip(_changes(y, found, settling), _changes(u, found, settling), strict=True))
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
        return _Noise(share * np.maximum(leaked[2 * number], 0.0), rms, samples, "change from period to period", kernel)
    outside = np.flatnonzero(lines.kinds == "outside")
    outside = outside[outside.size // 2 :]
    if outside.size < 2 * MIN_LINES or number[outside[0]] < number[lines.kinds == "excited"][-1]:
        unknown = "not known, no period is repeated and no line is free above the band"
        return _Noise(np.full(number.size, np.nan), np.nan, 0, unknown, np.ones(1))
    # Odd or even products may reach these lines: the quieter parity counts.
    level = min(float(np.mean(lines.total[outside[number[outside] % 2 == parity]])) for parity in (0, 1))
    rms, source = float(np.sqrt(period * level)), "lines above the band, taken as white"
    return _Noise(np.full(number.size, level), rms, outside.size, source, np.ones(1))


def _distortions(
    lines: _Lines, frequency: FloatArray, floor: _Noise, realisations: int, steady: bool
) -> tuple[Distortion, ...]:
    """One entry for each parity that the multisine can tell; unexcited lines are preferred to the spread."""
    samples = floor.samples * float(np.mean(lines.kinds != "outside"))

    def judged(parity: _Parity, use: NDArray[np.bool_], spread: bool = False) -> Distortion:
        power = np.where(use, lines.spread if spread else lines.output, 0.0)
        # The noise is smeared over frequency as its pieces are short; so is what is compared with it.
        weight = np.convolve(use, floor.kernel, "same")[use]
        smeared = np.convolve(power, floor.kernel, "same")[use] / weight
        noise = floor.density[use]
        total, expected, count = float(2.0 * np.sum(power)), float(2.0 * np.sum(noise)), int(np.sum(use))
        width = max(3, count // 100)
        ratio_db = limit_db = float("nan")
        if expected > 0.0:
            freedom = 2.0 * count * (realisations - spread)
            limit = float(f_distribution.isf(SIGNIFICANCE, freedom, samples))
            ratio_db = float(10.0 * np.log10(np.mean(smeared / noise)))
            limit_db = float(10.0 * np.log10(limit)) + MARGIN_DB
        return Distortion(
            parity=parity,
            basis="spread over realisations" if spread else "unexcited lines",
            lines=count,
            level=max(total - expected, 0.0) ** 0.5,
            noise=expected**0.5,
            ratio_db=ratio_db,
            limit_db=limit_db,
            peak=float(frequency[use][np.argmax(np.convolve(power[use], np.ones(width), "same"))]),
            detected=ratio_db > limit_db if steady and expected > 0.0 else None,
        )

    odd, even, excited = (lines.kinds == kind for kind in ("odd", "even", "excited"))
    # Sums and differences of odd numbers tell the powers apart; once even lines are excited, they do not.
    both = lines.multisine == "full"
    first: _Parity = "odd or even" if both else "odd"
    free = odd | even if both else odd
    found = []
    if free.sum() >= MIN_LINES:
        found.append(judged(first, free))
    elif realisations > 1:
        found.append(judged(first, excited, spread=True))
    if not both and even.sum() >= MIN_LINES:
        found.append(judged("even", even))
    return tuple(found)
