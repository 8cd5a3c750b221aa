"""Which part of a recording moves, which is held out where no other one judges, and on which effects are searched."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from discovery.foundation.arrays import FloatArray
from discovery.mechanics.systems import system_base
from discovery.recordings.experiment import Experiment
from discovery.recordings.flags import Flag
from discovery.recordings.recording import Recording

#: A recording is looked at in so many stretches.
_STRETCHES = 60
#: It moves where the readings of a stretch scatter by so many times their noise.
MOVES = 3.0
#: Units of speeds, which are zero at rest.
_SPEEDS = ("m/s", "rad/s")
#: A speed or an input below this share of its largest is none.
_NONE = 0.1
#: A stretch moves where it scatters beyond its noise by so many standard errors of its scatter.
_BEYOND = 4.0
#: What is left behind the last of them rests where all of it scatters by no more than so many times the noise.
_RESTS = 1.5
#: So much of the motion's length is kept of the rest behind it, which shows where the body stays.
_REST_KEPT = 0.1
#: Readings of all recordings together that a search uses, and of one of them at least.
SEARCHED, _FEWEST = 16_000, 2_000
#: Where there are no more than so many times these, one fit to the whole costs more than the search saves.
_WORTH = 2.0
#: Reversals behind which the motion passes the same places in the same direction again.
_TWICE = 2
#: A reversal goes back by this part of the way between the ends of the motion, and by so many times the noise.
_BACK, _TURNS_BEYOND = 0.05, 10.0
#: Samples of a path that are looked at.
_WAY_SAMPLES = 4_000


def fitted_count(recording: Recording, *, pushed: bool = True, fewest: int = 0) -> int:
    """Return how many samples, from the first, are fitted.

    They are two thirds of those up to where the system rests, and at least half of the motion: before a step there is
    nothing to learn. The end of a free decay lies below the noise and would tell nothing about what shows in larger
    motion. It belongs to the part that is held out; but where fewer than `fewest` would be fitted, they are two thirds
    of all, and what lies in the noise is better than nothing. As many are held out where a motion is seen late, if what
    is before tells of it. A level that an input holds is no rest, where it is `pushed`, a force: the levels of a motion
    do nothing.
    """
    end = motion_end(recording, lambda _: MOVES, MOVES, pushed=pushed)
    first, seen = _begin(recording)
    half = max(seen, (first + _last_moving(recording, lambda _: MOVES)) // 2) if first else 0
    size, count = recording.time.size, max(two_thirds(end), half)
    if min(count, size - count) >= fewest:
        return count
    less = max(two_thirds(size), min(count, size - fewest))
    return less if less >= count or _scatter(recording, 0, less) > 1 + _BEYOND / np.sqrt(2 * less) else count


def thirds_apart(recordings: Sequence[Recording]) -> tuple[list[Recording], list[Recording]]:
    """Return what is fitted of driven recordings, and the rest as recordings of their own, with a flag that says so.

    Where nothing pulls a position back, what a prediction misses adds up: continued, it says little of the model.
    """
    train, rest = [], []
    for r in recordings:
        if r.input is None:
            return list(recordings), []
        count, size = fitted_count(r), r.time.size
        flag = Flag("third_apart", numbers={"fitted": count, "held": size - count, "count": size})
        train.append(replace(r.part(slice(count)), flags=(*r.flags, flag)))
        rest.append(replace(r.part(slice(count, None)), name=f"{r.name}_last_third", flags=()))
    return train, rest


def motion_end(recording: Recording, moves: Callable[[int], float], rests: float, *, pushed: bool = True) -> int:
    """Return how many samples, from the first, tell of the motion; all where nothing is seen to move, or to rest.

    `moves`: scatter beyond which a stretch of so many readings moves [noise sds]. `rests`: all that lies behind the
    last stretch that moves rests where it scatters by no more [noise sds]: what is slow moves by less than its noise in
    any stretch alone. It does not where a force or a voltage holds it there (`pushed`), nor at a steady speed.
    """
    count = recording.time.size
    end = _last_moving(recording, moves)
    settles = end == count or _scatter(recording, end, count) <= rests
    return end if settles and not _is_held(recording, end, pushed=pushed) else count


def two_thirds(samples: int) -> int:
    """Return how many samples are fitted of those in which something moves."""
    return 2 * samples // 3


def motion_over_noise(recording: Recording, first: int) -> float:
    """Return the largest scatter of any stretch from a sample on, or of all [noise sds]: how much its readings tell."""
    return max(_scatter(recording, first, None), *(scatter for *_, scatter in _stretches(recording, first)))


def _last_moving(recording: Recording, moves: Callable[[int], float]) -> int:
    """Return where the last stretch that moves ends; the end of the recording where none does."""
    ends = (last for first, last, scatter in _stretches(recording, 0) if scatter > moves(last - first))
    return max(ends, default=recording.time.size)


def _begin(recording: Recording) -> tuple[int, int]:
    """Return up to where nothing has moved, and by where something is seen to have; zero where nothing ever is."""
    stretches = (s[:2] for s in _stretches(recording, 0))
    return next((s for s in stretches if _scatter(recording, 0, s[1]) > MOVES), (0, 0))


def _is_held(recording: Recording, first: int, *, pushed: bool) -> bool:
    """Return whether what is steady from a sample on is a speed, or pushed: it tells of losses or of stiffness."""
    steady = [recording.input] if pushed and recording.input is not None else []
    steady += [c for c, unit in zip(recording.output.T, recording.units, strict=True) if unit in _SPEEDS]
    return any(
        np.isfinite(c[first:]).any() and abs(np.nanmedian(c[first:])) > _NONE * np.nanmax(np.abs(c)) for c in steady
    )


def _stretches(recording: Recording, first: int) -> list[tuple[int, int, float]]:
    """Return where each stretch begins and ends, and how far its readings scatter about their mean [noise sds]."""
    count = recording.time.size - first
    edges = np.linspace(first, recording.time.size, min(_STRETCHES, max(count // 8, 1)) + 1).astype(int)
    return [(a, b, _scatter(recording, a, b)) for a, b in pairwise(edges.tolist())]


def _scatter(recording: Recording, first: int, last: int | None) -> float:
    """Return the largest standard deviation of any channel over a range of samples [noise sds]; gaps count nothing."""
    channels = zip(recording.output[first:last].T, recording.noise.tolist(), strict=True)
    return max(float(np.std(c[np.isfinite(c)])) / noise if np.isfinite(c).any() else 0.0 for c, noise in channels)


def moving_count(recording: Recording) -> int | None:
    """Return how many samples, from the first, hold a free motion and a tenth of its length of the rest behind it.

    A law of friction is smooth near zero speed: a body that it holds creeps, however slowly, for as long as the
    recording lasts. None where the motion lasts, or where an input, which may push what rests, is recorded.
    """
    if recording.input is not None:
        return None
    kept = int(np.ceil((1 + _REST_KEPT) * motion_end(recording, lambda n: 1 + _BEYOND / float(np.sqrt(2 * n)), _RESTS)))
    return kept if kept < recording.time.size else None


def moving_part(recording: Recording) -> Recording:
    """Return a recording up to there, with a flag that says so where that is not all of it."""
    kept = moving_count(recording)
    if kept is None:
        return recording
    last, end = recording.time[[kept - 1, -1]].tolist()
    flag = Flag("at_rest", numbers={"count": recording.time.size, "kept": kept, "last": last, "end": end})
    return replace(recording.part(slice(kept)), flags=(*recording.flags, flag))


def searched_part(experiments: Sequence[Experiment]) -> tuple[Experiment, ...]:
    """Return the first parts of recordings, in proportion, with as many readings as a search uses.

    What is held out of a recording stays the same share of it. Where the part would end before anything moves, the rest
    before comes on top. Readings that passed a filter are few already.
    """
    total = sum(e.recording.time.size for e in experiments)
    if total <= _WORTH * SEARCHED or any(e.rig.view is not None for e in experiments):
        return tuple(experiments)
    return tuple(_first_part(e, SEARCHED / total) for e in experiments)


def with_flag(experiments: Sequence[Experiment]) -> tuple[Experiment, ...]:
    """Return recordings with a note on each of which a search uses a part."""
    found = []
    for whole, part in zip(experiments, searched_part(experiments), strict=True):
        r, used = whole.recording, part.recording.time.size
        told = Flag("searched_in_part", numbers={"searched": used, "count": r.time.size})
        found.append(whole if used == r.time.size else replace(whole, recording=replace(r, flags=(*r.flags, told))))
    return tuple(found)


def _first_part(experiment: Experiment, share: float) -> Experiment:
    size, fitted = experiment.recording.time.size, experiment.fitted_samples
    begin, _ = _begin(experiment.recording)
    # Of what rests first, a part may hold no motion.
    rest = begin if begin >= share * (size if fitted is None else fitted) else 0
    count = min(size, max(_FEWEST, rest + math.ceil(share * (size - rest))))
    part = experiment.first(count)
    if fitted is None:
        return part
    return replace(part, fitted_samples=max(1, rest + round((fitted - rest) * (count - rest) / (size - rest))))


def turns_back(experiments: Sequence[Experiment]) -> bool:
    """Return whether the motion of some recording reverses twice, so that it passes the same places once more.

    Where it does not, a memory of the way cannot be told from a law of the place. It is taken to do so where the
    readings do not show the motion of what effects act on: several coordinates, a moved base, an acceleration.

    `experiments`: recordings of one system.
    """
    ways = _ways(experiments)
    return ways is None or any(_reversals(*way) >= _TWICE for way in ways)


def spins(experiments: Sequence[Experiment]) -> bool:
    """Return whether the readings show that a shaft only goes on, in every recording through a full turn or more."""
    ways = _ways(experiments) if experiments[0].coordinate_unit in ("rad", "rad/s") else None
    return ways is not None and all(w.size and np.ptp(w) > 2 * np.pi and not _reversals(w, n) for w, n in ways)


def _winds(experiments: Sequence[Experiment]) -> bool:
    """Return whether an angle that is read goes farther than half a turn from its zero."""
    read = [e.recording.output[e.fitted, 0] for e in experiments if e.recording.units[0] == "rad"]
    return any(np.nanmax(np.abs(angle), initial=0.0) > np.pi for angle in read)


def course(experiments: Sequence[Experiment]) -> dict[str, bool]:
    """Return what of recordings decides which effects they could show, see `equations.lacking.candidates`."""
    return {
        "turns": turns_back(experiments),
        "spins": spins(experiments),
        "winds": _winds(experiments),
        "several": _sessions(experiments) > 1,
        "dated": any(e.drive is not None or e.recording.at_rest or e.rig.view is not None for e in experiments),
    }


def _sessions(experiments: Sequence[Experiment]) -> int:
    """Return how often it was recorded anew: near parts of one file with the same constants are of one recording."""
    parts = sorted(experiments, key=lambda e: (e.recording.sha256, str(e.recording.where), e.recording.samples or ()))
    return len(parts) - sum(_goes_on(a, b) for a, b in pairwise(parts))


def _goes_on(before: Experiment, after: Experiment) -> bool:
    """Return whether one part of a file begins where another ends, or soon: after no longer than the longer of them."""
    a, b = before.recording, after.recording
    if a.samples is None or b.samples is None or (a.sha256, a.where, a.constants) != (b.sha256, b.where, b.constants):
        return False
    gap, longest = b.samples[0] - a.samples[1], max(np.diff(a.samples)[0], np.diff(b.samples)[0])
    # Without a column of times each part begins at zero.
    if gap >= 0 and after.rig.columns.time.rate is None:
        gap, longest = b.time[0] - a.time[-1], max(np.ptp(a.time), np.ptp(b.time))
        return bool(0.0 < gap <= longest)
    return bool(gap <= longest)


def _ways(experiments: Sequence[Experiment]) -> list[tuple[FloatArray, float]] | None:
    """Return the positions of every recording, see `_way`; None where they are not those on which effects act."""
    first = experiments[0]
    base = None if first.rig.system is None else system_base(first.rig.system)
    hidden = base is not None and (base.n_coordinates > 1 or base.input_moves or base.order > 1)
    if first.reads_acceleration or hidden:
        return None
    return [_way(e, rate=base is not None and base.order == 1) for e in experiments]


def _way(experiment: Experiment, *, rate: bool) -> tuple[FloatArray, float]:
    """Return the fitted positions without gaps, and their noise; those of a body whose rate is read begin at zero."""
    time, read = experiment.recording.time[experiment.fitted], experiment.deflection[experiment.fitted]
    good = np.isfinite(read)
    time, read = time[good], read[good]
    lever = experiment.rig.length.value if experiment.system.has_rod and experiment.rig.length else 1.0
    # What a force is computed from is recorded as an input.
    noise = 0.0 if experiment.rig.view is not None else float(experiment.recording.noise.max()) / lever
    if rate:
        steps = np.diff(time)
        read = np.concatenate([[0.0], np.cumsum(0.5 * (read[1:] + read[:-1]) * steps)])
        noise *= float(np.linalg.norm(steps))
    return read[:: max(1, read.size // _WAY_SAMPLES)], noise


def _reversals(way: FloatArray, noise: float) -> int:
    """Return how often a path turns back by more than noise and a small part of it."""
    if way.size == 0:
        return 0
    least = max(_BACK * float(np.ptp(way)), _TURNS_BEYOND * noise)
    count, heading, low, high = 0, 0, way[0], way[0]
    for x in way.tolist():
        low, high = min(low, x), max(high, x)
        turned = -1 if heading >= 0 and x < high - least else 1 if heading <= 0 and x > low + least else 0
        if not turned:
            continue
        count += heading != 0
        heading, low, high = turned, x, x
    return count
