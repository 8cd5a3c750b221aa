"""Result of the analysis of a multisine: its spectrum line by line, noise and nonlinear distortion, and the verdict."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from discovery.foundation.arrays import FloatArray

Parity = Literal["odd", "even", "odd or even"]
Basis = Literal["unexcited lines", "spread over realisations"]


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

    parity: Parity
    basis: Basis
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
