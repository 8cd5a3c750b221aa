"""The recorded input made smooth once: an encoder's motion profile, or an interpolation that the rig file names."""

from __future__ import annotations

import numpy as np
from scipy.fft import irfft, rfft

from discovery.foundation.arrays import FloatArray
from discovery.foundation.errors import InputError
from discovery.recordings.drive import Drive, spline_drive
from discovery.recordings.motion_profile import smooth_motion
from discovery.recordings.reading_noise import estimate_noise
from discovery.recordings.recording import Recording
from discovery.rigs.rig import Rig

_UPSAMPLING = 8


def build_drive(recording: Recording, rig: Rig) -> Drive | None:
    """Make the input of a recording continuous in time; None for a free decay, which has none.

    The rig says how the input runs between samples: a motion, such as an arm's motor angle, is smoothed to its
    encoder's error (``angle_noise``, uniform; estimated where the rig does not state it); any other is interpolated,
    band limited, by a cubic spline (``"auto"`` too, until `discovery.estimation.input_choice` has chosen), linearly or
    held.

    Raises
    ------
    InputError
        If a band-limited input is not equally sampled.
    """
    if recording.input is None or rig.columns.input is None:
        return None
    t, u = recording.time, recording.input
    match rig.columns.input.interpolation:
        case "motion":
            noise = estimate_noise(u) if rig.angle_noise is None else rig.angle_noise / np.sqrt(3.0)
            return smooth_motion(t, u, noise)
        case "band_limited":
            return _band_limited(t, u, recording.source)
        case "linear":
            return Drive(t, np.stack([np.diff(u) / np.diff(t), u[:-1]]), t)
        case "hold":
            return Drive(np.append(t, 2.0 * t[-1] - t[-2]), u[None, :], t)
        case _:
            return spline_drive(t, u)


def _band_limited(t: FloatArray, u: FloatArray, source: str) -> Drive:
    """Trigonometric interpolation: the ends' chord taken off and mirrored oddly, so that the period closes smoothly."""
    n = t.size - 1
    step = (t[-1] - t[0]) / n
    if np.max(np.abs(t - (t[0] + step * np.arange(n + 1)))) > 0.01 * step:
        raise InputError(
            f"{source}: the times are not equally spaced, so the input cannot be interpolated as band limited. "
            'Set interpolation = "spline" for the input in the rig file, or resample the recording.'
        )
    chord = u[0] + (u[-1] - u[0]) * np.arange(n + 1) / n
    odd = u - chord
    spectrum = rfft(np.concatenate([odd, -odd[-2:0:-1]]))
    spectrum[-1] *= 0.5  # the Nyquist line is shared between plus and minus once there is room beyond it
    fine = _UPSAMPLING * irfft(spectrum, 2 * n * _UPSAMPLING)[: n * _UPSAMPLING + 1]
    fine += u[0] + (u[-1] - u[0]) * np.arange(n * _UPSAMPLING + 1) / (n * _UPSAMPLING)
    return spline_drive(t[0] + step / _UPSAMPLING * np.arange(n * _UPSAMPLING + 1), fine)
