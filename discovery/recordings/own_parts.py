"""The parts of a recording that are motions of their own: from the release on, and between gaps of the input."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.interpolate import CubicSpline

from discovery.foundation.arrays import BoolArray, FloatArray
from discovery.foundation.errors import InputError
from discovery.foundation.sampling import gaps, median_step
from discovery.recordings.flags import Flag
from discovery.recordings.reading_noise import estimate_noise
from discovery.recordings.recording import Recording
from discovery.recordings.running_on import runs_on
from discovery.rigs.rig import RecordPart, Rig

Reader = Callable[[RecordPart], Recording]

_UNKNOWN = 0.05  # of a signal's standard deviation
_TRIED, _BESIDE = 60, 12  # places where a gap is tried, and samples on either side of it
_SHORTEST = 100  # readings of a part
_HELD = 8  # readings that tell where a body is held
_STILL, _OF_WAY = 5.0, 0.02  # noise sds of what is compared, and share of the way to rest, within which it stands still
_FAR = 20.0  # noise sds from rest
_TIMES = 16.0  # times as far, and twice as long as through two lags it takes to be seen
_GAP = 3.0  # usual steps that are a gap
_LONGER = 1.5  # noise moves both times: simulated releases reach 1.1, 99 of 100 turns of a swing 1.4


def own_parts(part: RecordPart, rig: Rig, read: Reader) -> list[tuple[RecordPart, Recording]]:
    """Read rows of a file as the motions that they are, each with its rows.

    A free body that is held away from rest is taken from its release on. Where neither the input nor the output can be
    interpolated over a gap of the times, the recording ends before the gap and begins again after it. A flag on the
    first motion says so where it is not all of the rows, and one with a doubt where the input has gaps but no good
    parts.

    Raises InputError as reading the rows does.
    """
    whole = read(part)
    edges, make = _edges(whole, rig)
    if not edges:
        return [(part, whole)]
    first = part.samples[0] if part.samples else 0
    last = part.samples[1] if part.samples else None
    places = edges if whole.rows is None else [int(whole.rows[edge]) for edge in edges]
    rows = [first + rig.columns.every * place for place in places]
    rows[-1] = last if last is not None and edges[-1] == whole.time.size else rows[-1]
    spans = list(pairwise(rows))
    found = _read_all(part, spans, whole, edges, read)
    told = make([list(span) for span in spans], bool(found))
    if not found:
        return [(part, replace(whole, flags=(*whole.flags, *told)))]
    (its, begun), *others = found
    return [(its, replace(begun, flags=(*told, *begun.flags))), *others]


def _edges(r: Recording, rig: Rig) -> tuple[list[int], Callable[[list[list[int]], bool], list[Flag]]]:
    """Return where the parts of a recording begin and end, none where it is whole, and what makes the flags."""
    if r.input is not None:
        cuts = [] if rig.view is not None else [k + 1 for k in np.flatnonzero(~bridged(r)).tolist()]
        longest = max((float(r.time[k] - r.time[k - 1]) for k in cuts), default=0.0)
        numbers = {"gaps": len(cuts), "longest": longest}

        def split(spans: list[list[int]], done: bool) -> list[Flag]:
            return [Flag("split_at_gaps" if done else "input_unknown", numbers={**numbers, "parts": spans})]

        return [0, *cuts, r.time.size] if cuts else [], split
    moves = rig.columns.output.reads != "acceleration"
    at = release(r.time, r.output[:, 0], float(r.noise[0])) if moves else None

    def held(spans: list[list[int]], done: bool) -> list[Flag]:
        level = float(np.nanmedian(r.output[:_HELD, 0]))
        numbers = {"level": level, "until": float(r.time[at or 0]) + rig.columns.time.zero, "part": spans[0]}
        name, unit = rig.columns.output.name, rig.columns.output.unit
        # Still on its way in the end: an angle, too, that has turned little.
        driven = rig.traits.returns and runs_on(r.output[at:, 0], "1")
        more = [Flag("runs_on", name, unit, {"until": numbers["until"]})] if driven else []
        return [Flag("held" if done else "held_long", name, unit, numbers), *more]

    return [] if at is None else [at, r.time.size], held


def _read_all(
    part: RecordPart, spans: list[tuple[int, int]], whole: Recording, edges: list[int], read: Reader
) -> list[tuple[RecordPart, Recording]]:
    """Return the parts; none where one is too short, or, of a driven motion, cannot be used by itself."""
    for a, b in pairwise(edges):
        if b - a < _SHORTEST or (whole.input is not None and np.ptp(whole.input[a:b]) == 0.0):
            return []
    try:
        # Behind a gap it moves, and a release is seen a little after it.
        still = [part.at_rest and edge == 0 for edge in edges]
        own = (replace(part, samples=span, at_rest=rest) for span, rest in zip(spans, still, strict=False))
        return [(its, read(its)) for its in own]
    except InputError:
        if whole.input is None:
            raise
        return []


def bridged(r: Recording) -> BoolArray:
    """Return for each step from sample to sample whether input or output can be interpolated over it, shape (n - 1,).

    A gap of the same length is tried at many places where there are samples: how far they lie from the spline through
    those beside it says what the spline is worth.
    """
    assert r.input is not None
    steps = np.diff(r.time)
    step = median_step(r.time)
    known = np.ones(steps.size, bool)
    for length in np.unique(np.round(steps[gaps(r.time)] / step).astype(int)).tolist():
        signals = [r.input, *r.output.T]
        if all(_lost(r.time, signal, length, step) for signal in signals):
            known &= np.round(steps / step) != length
    return known


def _lost(time: FloatArray, values: FloatArray, length: int, step: float) -> bool:
    """Return whether a gap of so many steps hides what a signal does: it is then off by more than its noise."""
    missing = length - 1
    width = missing + 2 * _BESIDE
    miss: list[FloatArray] = []
    for start in np.unique(np.linspace(0, time.size - width, _TRIED).astype(int)).tolist() if time.size > width else []:
        t, x = time[start : start + width], values[start : start + width]
        good = np.isfinite(x)
        hidden = np.zeros(width, bool)
        hidden[_BESIDE : _BESIDE + missing] = True
        if good.all() and not gaps(t, step).any():
            miss.append(x[hidden] - CubicSpline(t[~hidden], x[~hidden])(t[hidden]))
    if not miss:
        return False
    noise = estimate_noise(values, time)
    allowed = (_UNKNOWN * float(np.nanstd(values))) ** 2 + 2.0 * (noise if np.isfinite(noise) else 0.0) ** 2
    return bool(np.mean(np.square(np.concatenate(miss))) > allowed)


def release(time: FloatArray, values: FloatArray, noise: float) -> int | None:
    """Return the sample at which a body is let go that was held away from where it comes to rest; None if it was not.

    Under a force that begins at its release a body goes as the square of the time, and through two lags as the fourth
    power at most: it is seen to stand still for no longer than it then takes to go 16 times as far as noise hides. One
    that swings through a turning point stands still there for little less than that time (0.9 of it). What stands still
    for 1.5 times as long as the latter was held.

    That is looked for from the distance that noise hides up to 2 % of the way to rest: the first that tells cuts least
    of the motion. An acceleration that falls on the way hides a short hold at the larger ones, and disturbances hide a
    long one at the smaller. A release from nearly upright grows more slowly: of it the readings are lost that do
    not leave the noise. What runs on comes to no rest, and its way is that to the middle of its second half.

    Parameters
    ----------
    time, values : ndarray, shape (n,)
        Times [s], and readings in their unit; NaN are gaps.
    noise : float
        Standard deviation of a reading, in its unit.
    """
    good = np.flatnonzero(np.isfinite(values))
    if good.size < 4 * _HELD:
        return None
    t, x = time[good], values[good]
    level = float(np.median(x[:_HELD]))
    way = level - float(np.median(x[x.size // 2 :]))
    if abs(way) < _FAR * noise:
        return None
    gone = (level - x) * np.sign(way)
    coarsest, finest = _OF_WAY * abs(way), max(_STILL * noise / np.sqrt(_HELD), np.finfo(float).eps * abs(way))
    halvings = int(np.ceil(np.log2(max(coarsest / finest, 1.0))))
    # Medians tell a smaller distance than single readings, and pass over wild ones.
    middle = np.median(sliding_window_view(gone, _HELD), axis=1)
    stills = (max(finest, coarsest / 2**k) for k in range(halvings, -1, -1))
    found = (_release(t, gone, middle, still=still, noise=noise, way=abs(way)) for still in stills)
    return next((int(good[left]) for left in found if left is not None), None)


def _release(
    t: FloatArray, gone: FloatArray, middle: FloatArray, *, still: float, noise: float, way: float
) -> int | None:
    """Return the reading at which a body leaves where it is held within `still`, if it then goes a `way` to rest.

    `gone` (n,): how far it is on that way; `middle` (n - 7,): medians of eight readings of that.
    """
    late, far = _HELD // 2, min(_TIMES * still, 0.5 * way)
    left, reached = _first(np.abs(middle) > still), _first(middle > far)
    single = np.abs(gone) > max(still, _STILL * noise)
    out = _first(single[:-1] & single[1:])
    if left is None or reached is None or out is None or left >= reached or middle[left] < 0.0:
        return None
    at = min(left + late, out)
    # It goes by `still` to the turning point and twice as far back, at the same acceleration; times err by a reading.
    turns = (1.0 + np.sqrt(2.0)) / (np.sqrt(1.0 + far / still) - np.sqrt(2.0))
    taken = t[min(reached + late + 1, t.size - 1)] - t[left + late]
    # Nobody saw how it left where nothing was read then.
    seen = np.diff(t[max(0, min(at, left) - 1) : reached + late + 2])
    is_seen = seen.max() <= _GAP * np.median(np.diff(t))
    return at if is_seen and at >= 2 * _HELD and t[at] - t[0] >= _LONGER * turns * taken else None


def _first(true: BoolArray) -> int | None:
    """Return where something is true for the first time."""
    places = np.flatnonzero(true)
    return int(places[0]) if places.size else None
