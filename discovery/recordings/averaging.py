"""Recordings read far faster than they move, or than their noise changes: averages that lose nothing of the motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from discovery.foundation.arrays import BoolArray, FloatArray
from discovery.foundation.sampling import gaps, median_step
from discovery.recordings.flags import Flag
from discovery.recordings.reading_noise import BandNoise, filled, spectrum
from discovery.recordings.recording import Recording
from discovery.recordings.rounding import lasting_rounding
from discovery.rigs.rig import Rig

#: A recording keeps at least so many readings: fewer would hardly make anything quicker.
_KEPT = 2000
#: Averages over so many times the readings that err alike are nearly independent, and at least so many are kept.
_APART, _FEWEST = 2.0, 100
#: Averages may miss the motion by this part of their own noise.
_MISSED = 0.1
#: Lines of a spectrum that are looked at together, and how far they stand out of the noise where something moves.
_LINES, _STANDS_OUT = 32, 2.0
#: By how much noise that a filter has passed stands above its mean where it is largest.
_UNEVEN = 1.5
#: Share of stretches that gaps may cost.
_LOST = 0.02


def averaged_down(recording: Recording, rig: Rig) -> Recording:
    """Return a recording with as few readings as its motion needs, and a note that says so.

    Stretches of equal length are averaged, which lowers white noise by the root of their length; that of rounding is
    kept. Their length is the largest one by which nothing that stands out of the noise, in the output or in the input,
    is missed by more than a tenth of the noise that is left. Where neighbours err alike, stretches are so long that
    averages do not, and shorter recordings are averaged, too; a doubt says where that cannot be. What was not read at a
    steady rate stays as it is; a held input and an output that passes filters ask for every reading.
    """
    held = rig.columns.input is not None and rig.columns.input.interpolation == "hold"
    alike, count = float(np.max(_together(recording))), recording.time.size
    # The smallest length of which averages err independently.
    least = int(np.ceil(_APART * alike)) if alike > 1.0 else 2
    most = count // _KEPT if least == 2 else max(count // _KEPT, least)
    steady = rig.view is None and not held and not gaps(recording.time).any()
    length = _longest(recording, least, most) if steady and count // least >= _FEWEST else 1
    if length > 1:
        return averaged(recording, length)
    if least == 2:
        return recording
    kept = Flag("alike_kept", numbers={"alike": alike, "least": least})
    return replace(recording, flags=(*recording.flags, kept))


def averaged(recording: Recording, length: int) -> Recording:
    """Return a recording whose readings are averages over so many, at the middle of their times.

    It still begins when it began, at rest if it did, with nothing read there: half an average later it moves, and half
    a reading earlier an input would have pushed it already. The first readings, and the last that fill no average, are
    left out.
    """
    count, first = recording.time.size, _first(length)
    step = median_step(recording.time)
    kept = (count - first) // length
    middles = recording.time[first : first + kept * length].reshape(kept, length).mean(axis=1)
    drive = recording.input
    told = {"count": count, "step": step, "length": length, "kept": kept, "apart": length * step}
    return replace(
        recording,
        time=np.append(recording.time[0], middles),
        input=None if drive is None else np.append(drive[0], _means(drive[first:, None], length)),
        output=np.vstack([np.full(recording.noise.size, np.nan), _means(recording.output[first:], length)]),
        noise=_noise(recording, _alike(recording), length),
        jitter=float(recording.jitter / np.sqrt(length)),
        bands=(),
        flags=(*recording.flags, Flag("averaged", numbers=told)),
    )


def _first(length: int) -> int:
    """Return the first reading of averages of which the first is one step after the start, or half a reading less."""
    return length - length // 2


def _longest(recording: Recording, least: int, most: int) -> int:
    """Return the largest length between two by which averages miss nothing of a recording; 1 where there is none."""
    present, drive = np.asarray(np.isfinite(recording.output).all(axis=1)), recording.input
    if not present.any():
        return 1
    outputs = [filled(c) for c in recording.output.T]
    spectra = [_Spectrum.of(c, sd) for c, sd in zip(outputs, _floors(recording), strict=True)]
    moved = None if drive is None or np.ptp(drive) == 0 else _Spectrum.of(drive / np.std(drive), 0.0)
    sizes, same = np.std(outputs, axis=1), _alike(recording)

    def serves(length: int) -> bool:
        if _lost(present, length) > _LOST:
            return False
        allowed = _MISSED * _noise(recording, same, length)
        # What is missed of an input is missed, in the same proportion, of what it moves.
        share = 0.0 if moved is None else moved.missed(length)
        return bool(np.all([s.missed(length) for s in spectra] <= allowed) and np.all(share * sizes <= allowed))

    return next((k for k in range(most, least - 1, -1) if serves(k)), 1)


def _together(recording: Recording) -> FloatArray:
    """Return how many neighbouring readings of each channel tell as much as one of independent noise."""
    return np.array([1.0 if band is None else band.alike for band in _bands(recording)])


def _floors(recording: Recording) -> list[float]:
    """Return the noise of each channel, as white noise that is as large as its own at any frequency."""
    return [
        sd if band is None else max(sd, band.sd) * float(np.sqrt(_UNEVEN * band.alike))
        for sd, band in zip(recording.noise.tolist(), _bands(recording), strict=True)
    ]


def _bands(recording: Recording) -> Sequence[BandNoise | None]:
    """Return of each channel the noise whose neighbours err alike; None where it is white."""
    return recording.bands or (None,) * len(recording.noise)


def _alike(recording: Recording) -> FloatArray:
    """Return the part of each channel's noise that errs alike in neighbours."""
    channels = zip(recording.output.T, recording.noise.tolist(), recording.steps.tolist(), strict=True)
    return np.array([lasting_rounding(*channel) for channel in channels])


def _noise(recording: Recording, same: FloatArray, length: int) -> FloatArray:
    """Return the noise of averages, of which a part is the same in neighbours."""
    return np.asarray(
        np.sqrt((recording.noise**2 - same**2) * np.minimum(1.0, _together(recording) / length) + same**2)
    )


def _means(columns: FloatArray, length: int) -> FloatArray:
    """Return values at the middles of stretches: means, less what the curvature between neighbours adds to them."""
    kept = len(columns) // length
    means = columns[: kept * length].reshape(kept, length, -1).mean(axis=1)
    bend = np.diff(means, 2, axis=0) / 24
    bend = np.where(np.isfinite(bend), bend, 0.0)
    return np.asarray(means - (1 - 1 / length**2) * np.concatenate([bend[:1], bend, bend[-1:]]))


def _lost(present: BoolArray, length: int) -> float:
    """Return which share of the readings that are present stretches with a gap in them lose."""
    present = present[_first(length) :]
    used = present.size // length * length
    whole = present[:used].reshape(-1, length).all(axis=1).sum() * length
    return float(1 - whole / present.sum()) - (present.size - used) / present.size


@dataclass(frozen=True)
class _Spectrum:
    """What stands out of the noise of a channel: angular frequencies a reading [rad], and the power of each."""

    turn: FloatArray
    power: FloatArray

    @classmethod
    def of(cls, channel: FloatArray, noise: float) -> _Spectrum:
        """Return the spectrum of a channel without gaps."""
        n = channel.size
        power = 2 * np.abs(spectrum(channel)) ** 2 / n
        size = power.size // _LINES * _LINES
        bands = power[:size].reshape(-1, _LINES).mean(axis=1)
        floor = max(float(np.median(bands[bands.size // 2 :])), 2 * noise**2 / n)
        lines = np.flatnonzero(np.repeat(bands > _STANDS_OUT * floor, _LINES))
        return cls(2 * np.pi * lines / n, power[lines])

    def missed(self, length: int) -> float:
        """Return by how much averages over so many readings miss it, rms."""
        # The response of a mean over the stretch, and of what is taken off for its curvature.
        with np.errstate(divide="ignore", invalid="ignore"):
            mean = np.where(self.turn > 0, np.sin(self.turn * length / 2) / (length * np.sin(self.turn / 2)), 1.0)
        response = mean * (1 + (1 - 1 / length**2) * (1 - np.cos(self.turn * length)) / 12)
        return float(np.sqrt(np.sum(self.power * (1 - response) ** 2)))
