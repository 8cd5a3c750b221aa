"""The recorded input made smooth once: an encoder's motion profile, or an interpolation that the rig file names."""

from __future__ import annotations

import numpy as np
from scipy.fft import irfft, rfft

from discovery.foundation.arrays import BoolArray, FloatArray
from discovery.foundation.errors import InputError
from discovery.foundation.sampling import median_step
from discovery.recordings.drive import Drive, spline_drive
from discovery.recordings.profile_spline import Phase, fit_phases, likeliest_roughness
from discovery.recordings.reading_noise import estimate_noise
from discovery.recordings.recording import Recording
from discovery.recordings.rounding import resolution
from discovery.rigs.rig import Rig

_UPSAMPLING = 8

_DETECTION = 5.0  # sds of a second difference: no false phase in some 1e5 tests
_MARGIN = 2  # samples around a detected phase that belong to it, at least
_TAIL = 0.25  # part of its length that belongs to it on either side
_SHORTEST_GAP = 12  # samples; a shorter pause between two phases is not worth a straight line
_WINDOW = 60  # samples beside a phase that help to fit it alone
_LONGEST_KINKED = 2000  # samples
_ROUNDS = 4
_ITERATIONS = 15
# Where the inner kinks of one, two or three constant accelerations are first looked for, as parts of the phase.
_FIRST_KINKS: dict[int, list[tuple[float, ...]]] = {1: [()], 2: [(0.38,), (0.5,), (0.62,)], 3: [(0.35, 0.65)]}
_FEWEST = 8  # samples; with less, a spline through them
_FINEST = 1e-8  # error of a reading against the range of all, at least


def build_drive(recording: Recording, rig: Rig) -> Drive | None:
    """Make the input of a recording continuous in time; None for a free decay, which has none.

    The rig says how the input runs between samples: a motion, such as an arm's motor angle, is smoothed to its
    encoder's error (``angle_noise``, uniform; estimated where the rig does not state it); any other is interpolated,
    band limited, by a cubic spline (``"auto"`` too, until `discovery.estimation.input_choice` has chosen), linearly or
    held.

    Raises InputError if a band-limited input is not equally sampled.
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


def smooth_motion(t: FloatArray, y: FloatArray, noise: float) -> Drive:
    """Fit a motion profile to the readings y (n,) of an encoder at times t (n,) [s].

    `noise` is the standard deviation of a reading's error, in the unit of `y`; it is raised to the rounding of `y` if
    it is below. Pieces are cubic; acceleration is continuous but at the kinks, and zero in rests and cruises; the rate
    is zero in rests.

    Phases are found by testing second differences of growing width against the encoder's noise. A phase that one or two
    constant accelerations explain to the noise, or two with a cruise between, gets them, with kinks at fitted times;
    any other gets a smooth course. `discovery.recordings.profile_spline` then fits them all together.
    """
    if t.size < _FEWEST:
        return spline_drive(t, y)
    noise = max(noise, resolution(y, t), _FINEST * float(np.ptp(y)))
    active = _active(t, y, noise)
    for _ in range(_ROUNDS):
        found = _phases(active)
        starts = [0, *(phase.last + 1 for phase in found)]
        stops = [*(phase.first for phase in found[1:]), t.size]
        rooms = map(slice, starts, stops)
        phases = [_describe(t, y, noise, phase, room) for phase, room in zip(found, rooms, strict=False)]
        drive = fit_phases(t, y, noise, phases)
        # The gentle ends of a phase show in the residual only, once its steep part is explained.
        missed = _active(t, y - drive.evaluate(t)[0], noise) & ~active
        if not missed.any():
            break
        active |= missed
    return drive


def _active(t: FloatArray, y: FloatArray, noise: float) -> BoolArray:
    """Find where a straight line does not explain three neighbouring means of 1, 2, 4, ... readings."""
    active = np.zeros(t.size, bool)
    width = 1
    while 3 * width <= t.size:
        kernel_t = _means(t, width)
        kernel_y = _means(y, width)
        before, middle, after = slice(None, -2 * width), slice(width, -width), slice(2 * width, None)
        share = (kernel_t[middle] - kernel_t[before]) / (kernel_t[after] - kernel_t[before])
        bend = kernel_y[middle] - (1.0 - share) * kernel_y[before] - share * kernel_y[after]
        sd = noise * np.sqrt((1.0 + (1.0 - share) ** 2 + share**2) / width)
        # A phase that a narrower test has found would be seen from afar by a wide one: only undisturbed windows count.
        disturbed = np.concatenate([[0], np.cumsum(active)])
        clean = disturbed[3 * width :] == disturbed[: -3 * width]
        hits = np.flatnonzero((np.abs(bend) > _DETECTION * sd) & clean)
        marks = np.zeros(t.size + 1)
        np.add.at(marks, hits + width // 2, 1.0)
        np.add.at(marks, hits + 3 * width - width // 2, -1.0)
        active |= np.cumsum(marks)[:-1] > 0
        width *= 2
    return active


def _phases(active: BoolArray) -> list[Phase]:
    """Join the samples that are not on a straight line into phases, with margins."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], active, [0]]))).reshape(-1, 2)
    margin = np.maximum(_MARGIN, (_TAIL * (edges[:, 1] - edges[:, 0])).astype(int))
    merged: list[list[int]] = []
    for first, last in np.column_stack([edges[:, 0] - margin, edges[:, 1] - 1 + margin]).tolist():
        if merged and first - merged[-1][1] <= _SHORTEST_GAP:
            merged[-1][1] = max(last, merged[-1][1])
        else:
            merged.append([first, last])
    end = active.size - 1
    return [
        Phase(0 if first < _SHORTEST_GAP else first, end if last > end - _SHORTEST_GAP else last)
        for first, last in merged
    ]


def _means(values: FloatArray, width: int) -> FloatArray:
    total = np.cumsum(np.concatenate([[0.0], values - values[0]]))
    return (total[width:] - total[:-width]) / width + values[0]


def _describe(t: FloatArray, y: FloatArray, noise: float, phase: Phase, room: slice) -> Phase:
    """Choose between constant accelerations and a smooth course, on a phase and the undisturbed readings beside it."""
    start = max(room.start, phase.first - _WINDOW)
    window = slice(start, min(room.stop, phase.last + 1 + _WINDOW))
    local = Phase(phase.first - start, phase.last - start)
    t, y = t[window], y[window]
    if phase.last - phase.first < _LONGEST_KINKED and local.first > 2 and local.last < t.size - 3:
        for pieces in (1, 2, 3):
            kinks = _constant_accelerations(t, y, noise, local, pieces)
            if kinks is not None:
                return Phase(phase.first, phase.last, kinks)
    # A smooth phase begins and ends below the threshold: it may reach into the gaps beside it.
    reach = (phase.last - phase.first) // 3
    before, after = min(reach, (phase.first - room.start) // 4), min(reach, (room.stop - 1 - phase.last) // 4)
    local = Phase(local.first - min(before, local.first), min(local.last + after, t.size - 1))
    return Phase(local.first + start, local.last + start, roughness=likeliest_roughness(t, y, noise, local))


def _constant_accelerations(t: FloatArray, y: FloatArray, noise: float, phase: Phase, pieces: int) -> FloatArray | None:
    """Fit kink times and constant accelerations by Gauss-Newton; None if the readings contradict them."""
    step = median_step(t)
    s = t - t[0]
    # The kinks of the next phase may reach almost half way through the gap.
    lowest, highest = 0.55 * s[phase.first], 0.55 * s[phase.last] + 0.45 * s[-1]
    freedom = max(t.size - 2 * pieces - 3, 0)
    limit = freedom + 3.0 * np.sqrt(2.0 * freedom)
    best: tuple[float, FloatArray] | None = None
    span = s[phase.last] - s[phase.first]
    stride = max(4.0 * step, 0.1 * span)
    for inner in _FIRST_KINKS[pieces]:
        kinks = s[phase.first] + span * np.array([0.2, *inner, 0.8])
        chi2 = np.inf
        for _ in range(_ITERATIONS):
            ramps = np.maximum(s[:, None] - kinks, 0.0)
            shapes = 0.5 * (ramps[:, :-1] ** 2 - ramps[:, 1:] ** 2)
            linear = np.column_stack([np.ones_like(s), s, shapes])
            solution = np.linalg.lstsq(linear, y, rcond=None)[0]
            residual = y - linear @ solution
            before, chi2 = chi2, float(np.sum((residual / noise) ** 2))
            if chi2 > 10.0 * limit and chi2 > 0.9 * before:
                break
            jumps = np.diff(solution[2:], prepend=0.0, append=0.0)
            full = np.column_stack([linear, -jumps * ramps])
            move = np.linalg.lstsq(full, residual, rcond=None)[0][linear.shape[1] :]
            kinks = np.clip(np.sort(kinks + np.clip(move, -stride, stride)), lowest, highest)
            if np.max(np.abs(move)) < 1e-6 * step:
                break
        # Three pieces are a ramp, a cruise and a ramp; three free steps would imitate a smooth course.
        cruise = pieces < 3 or abs(solution[3]) < 0.05 * np.max(np.abs(solution[2:]))
        if cruise and np.min(np.diff(kinks)) > step and (best is None or chi2 < best[0]):
            best = chi2, kinks
    return best[1] + t[0] if best is not None and best[0] <= limit else None
