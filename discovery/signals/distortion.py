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
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.stats import f as f_distribution

from discovery.foundation.arrays import BoolArray, FloatArray
from discovery.signals.spectral_lines import (
    MIN_LINES,
    LineNoise,
    Lines,
    find_periods,
    line_noise,
    lines_of,
    settling_of,
    tones_of,
    whole_periods,
)

if TYPE_CHECKING:
    from discovery.recordings.recording import Recording

IRREGULAR = 0.05  # of a sampling interval: times may be rounded
SIGNIFICANCE = 1e-3
MARGIN_DB = 1.0  # noise through a resonance makes its own estimate less certain than white noise would

Parity = Literal["odd", "even", "odd or even"]
Basis = Literal["unexcited lines", "spread over realisations"]


def analyse_multisine(recording: Recording) -> Multisine | None:
    """Find the periods of a multisine in the input and read noise and distortion off the lines of the first output.

    Realisations with different phases may follow one another, with or without pauses; the period is found on the input,
    as the lag at which stretches of it come again (or come again with the opposite sign, at half the period of an odd
    multisine). It must be a whole number of samples. Periods with gaps are left out. None if the input is missing,
    irregularly sampled, or no multisine: nothing in it comes again, or fewer than eight lines carry it.
    """
    time = recording.time
    if recording.input is None or time.size < 64:
        return None
    step = float(time[-1] - time[0]) / (time.size - 1)
    if np.max(np.abs(time - np.linspace(time[0], time[-1], time.size))) > IRREGULAR * step:
        return None
    u, y = recording.input - recording.input.mean(), recording.output[:, 0]
    found = find_periods(u)
    if found is None:
        return None
    settled, settling = settling_of(y, found)
    periods, behind = whole_periods(u, y, found, settling)
    lines = lines_of(u, y, periods, found.period) if periods else None
    if lines is None:
        return None
    steady = settled and behind
    share = float(np.mean([1.0 / len(starts) for starts in periods]))
    floor = line_noise(u, y, found, settling if settled else None, lines, share)
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
        interference=tones_of(frequency, lines),
        distortions=_distortions(lines, frequency, floor, len(periods), steady),
        unit=recording.units[0],
    )


def _distortions(
    lines: Lines, frequency: FloatArray, floor: LineNoise, realisations: int, steady: bool
) -> tuple[Distortion, ...]:
    """One entry for each parity that the multisine can tell; unexcited lines are preferred to the spread."""
    samples = floor.samples * float(np.mean(lines.kinds != "outside"))

    def judged(parity: Parity, use: BoolArray, spread: bool = False) -> Distortion:
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
    first: Parity = "odd or even" if both else "odd"
    free = odd | even if both else odd
    found = []
    if free.sum() >= MIN_LINES:
        found.append(judged(first, free))
    elif realisations > 1:
        found.append(judged(first, excited, spread=True))
    if not both and even.sum() >= MIN_LINES:
        found.append(judged("even", even))
    return tuple(found)


@dataclass(frozen=True)
class Distortion:
    """Nonlinear distortion of one parity within the excited band."""

    parity: Parity  # ``"odd"``, ``"even"``, or ``"odd or even"`` if the multisine excites both kinds of lines
    #: ``"unexcited lines"``, or ``"spread over realisations"``: of the excited lines, around the mean response. The
    #: second sees what changes with the phases; the rest of the distortion looks like a change of that response.
    basis: Basis
    lines: int  # number of lines used
    #: level, noise: rms of the distortion (noise taken off) and of the noise on these lines, in the output's unit.
    level: float
    noise: float
    #: Power, noise included, over that of the noise, averaged over these lines [dB]; NaN if the noise is not known.
    ratio_db: float
    limit_db: float  # ratio that white noise alone exceeds with a probability of 0.001 (F distribution), and 1 dB more
    peak: float  # frequency around which the power is largest [Hz]
    detected: bool | None  # whether the ratio exceeds the limit; None if that cannot be judged


@dataclass(frozen=True)
class Multisine:
    """Spectrum of a recording under a periodic multisine, line by line.

    Levels are rms values of the sine at a line, of one averaged period, in the signal's unit.
    """

    period: int  # samples
    rate: float  # sampling rate [Hz]
    periods: tuple[tuple[int, ...], ...]  # first sample of every whole period that was used, by realisation
    kind: Literal["odd", "full"]  # ``"odd"`` or ``"full"``
    settling: float  # time after the start of a realisation until its periods repeat [s]
    steady: bool  # whether every period used lies behind it; no verdicts otherwise, as transients reach every line
    frequency: FloatArray  # (n,), of every line k / period, k = 1, 2, ... [Hz].
    #: (n,): ``"excited"``, ``"odd"`` and ``"even"`` (unexcited, in the band), ``"outside"`` or ``"interference"`` (near
    #: a tone of the input that is no line of the period, such as mains hum or drift; used for nothing).
    line_class: NDArray[np.str_]
    #: input, output (n,): levels; the output in the band without the part that unwanted input causes.
    input: FloatArray
    output: FloatArray
    #: (n,): level of the variation over realisations at excited lines, NaN elsewhere and for a single realisation.
    spread: FloatArray
    noise: FloatArray  # (n,), level of the noise; NaN if it is not known
    noise_rms: float  # standard deviation of the output's noise over all frequencies but those tones, of single samples
    noise_source: str  # how it was found
    interference: tuple[float, ...]  # frequencies of the tones [Hz]
    distortions: tuple[Distortion, ...]
    unit: str  # of the output

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
