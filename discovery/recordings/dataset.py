"""What a run works on: a rig with its training and held-out recordings."""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations
from pathlib import Path

from discovery.declarations.registry import get_effect
from discovery.foundation.arguments import as_path, as_paths, expect
from discovery.foundation.arrays import FloatArray
from discovery.foundation.errors import InputError
from discovery.mechanics import get_base
from discovery.plots.recordings import DatasetViews
from discovery.recordings.averaging import averaged_down
from discovery.recordings.copies import shared_samples
from discovery.recordings.experiment import Experiment, make_experiment
from discovery.recordings.flags import Flag
from discovery.recordings.own_parts import own_parts
from discovery.recordings.parts import fitted_count, moving_count, moving_part, thirds_apart, with_flag
from discovery.recordings.recording import Recording, read_recording
from discovery.recordings.uneven_noise import with_uneven_noise
from discovery.recordings.unit_mistakes import angle_doubt, fall_doubt
from discovery.recordings.unusable import refuse_unusable
from discovery.rigs.rig import RecordPart, Rig
from discovery.rigs.rig_file import read_rig


@dataclass(frozen=True, repr=False)
class Dataset(DatasetViews):
    """A rig with its recordings, averaged where they were read far faster than they move, input made smooth.

    Parameters
    ----------
    rig : Rig
        The system.
    train, holdout : tuple of Experiment
        Recordings to fit, and recordings that are never fitted. Where there is no hold-out, the last third of every
        training recording is kept out of the fit.
    test : tuple of Experiment
        Recordings that neither a fit nor a decision sees, for the score alone.

    Raises
    ------
    InputError
        For what is no rig, or no recording made ready for simulation.

    Examples
    --------
    >>> data = load_dataset("datasets/spring_bench/rig.toml")
    >>> data
    <Dataset 'spring bench' (oscillator): 2 to fit, 1 held out>
    >>> [axes.get_ylabel() for axes in data.plot_recordings()]
    ['output [mm]', 'output [mm]', 'output [mm]']
    """

    rig: Rig
    train: tuple[Experiment, ...]
    holdout: tuple[Experiment, ...]
    test: tuple[Experiment, ...] = ()

    def __post_init__(self) -> None:
        expect(self.rig, Rig, "rig", "Read one with read_rig(path).")
        for role in ("train", "holdout", "test"):
            given = getattr(self, role)
            found = tuple(given) if isinstance(given, Iterable) else (given,)
            for item in found:
                expect(item, Experiment, role, "Make one with make_experiment(recording, rig), or use load_dataset.")
            object.__setattr__(self, role, found)

    @cached_property
    def everything(self) -> tuple[tuple[str, Experiment], ...]:
        """All recordings that are fitted or decide, with their roles."""
        return (*(("train", e) for e in self.train), *(("holdout", e) for e in self.holdout))

    @property
    def with_test(self) -> tuple[tuple[str, Experiment], ...]:
        """These, and those for the score alone, with their roles."""
        return (*self.everything, *(("test", e) for e in self.test))


def _whole(path: Path, rig: Rig) -> RecordPart:
    """Return the whole of a file; it begins at rest if the rig file says so of it from its first row on."""
    named = (p for parts in rig.records.values() for p in parts if os.path.realpath(p.file) == os.path.realpath(path))
    parts = list(named)
    at_rest = any(p.at_rest and not (p.samples and p.samples[0]) for p in parts)
    return RecordPart(path, at_rest=at_rest, constants=parts[0].constants if parts else ())


def read_to_predict(path: Path, rig: Rig) -> Recording:
    """Read times and input of a file that is to be predicted, with the constants that the rig file says of it."""
    return replace(read_recording(path, rig, with_output=False), constants=_whole(path, rig).constants)


def _read(part: RecordPart, rig: Rig) -> Recording:
    path = part.file
    if not os.path.exists(path):
        # Public measured data lie in the user's data folder, not beside the rig file.
        from discovery_datasets import registry

        name = registry.registered(path)
        if name is not None:
            try:
                path = registry.locate(name)
            except registry.DataUnavailable as error:
                raise InputError(f"{path} does not exist, and the {error}") from None
    read = read_recording(path, rig, part.samples, where=part.where, name=part.name)
    declared = {} if rig.system is None else rig.system.constants
    own = [Flag("own_constant", n, declared[n].unit, {"value": value}) for n, value in part.constants]
    known = {key: getattr(part, key) for key in ("at_rest", "constants", "where", "samples")}
    return replace(read, **known, flags=(*read.flags, *own))


def load_dataset(
    rig_path: str | os.PathLike[str],
    train: str | os.PathLike[str] | Sequence[str | os.PathLike[str]] = (),
    holdout: str | os.PathLike[str] | Sequence[str | os.PathLike[str]] = (),
    *,
    keep_third: bool = True,
    estimate_noise: bool = False,
) -> Dataset:
    """Read a rig file and recordings.

    Where the zero of the recordings' clock is farther away than they last, times are counted from the earliest reading.

    Parameters
    ----------
    rig_path : path
        TOML rig file.
    train, holdout : path or sequence of path
        Recordings; where `train` is empty, the rig file's own [records].
    keep_third : bool
        Keep the last third of every training recording, or of its motion where that ends sooner, out of the fit where
        there is no hold-out: see `discovery.recordings.parts`.
    estimate_noise : bool
        Take the noise of each channel from its scatter from sample to sample, whatever the rig file states.

    Raises
    ------
    InputError
        For anything that cannot be used, naming file, column, row and remedy.

    Examples
    --------
    >>> data = load_dataset("datasets/spring_bench/rig.toml")
    >>> [e.recording.name for e in data.train], [e.recording.name for e in data.holdout]
    (['train_high', 'train_low'], ['holdout'])
    """
    rig = read_rig(as_path(rig_path, "rig_path", "Give the path of a rig file."))
    rig = rig.with_noise_estimated() if estimate_noise else rig
    files = "Give the path of a recording, or a list of them."
    fitted, held = as_paths(train, "train", files), as_paths(holdout, "holdout", files)
    parts = {
        "train": [_whole(p, rig) for p in fitted] or list(rig.records.get("train", ())),
        "holdout": [_whole(p, rig) for p in held] or ([] if fitted else list(rig.records.get("holdout", ()))),
        "test": [] if fitted or held else list(rig.records.get("test", ())),
    }
    if not parts["train"]:
        raise InputError(
            f"{rig_path}: there is nothing to fit. Give --train FILE, or a train list under [records] in the rig file."
        )
    read = _taken(rig, parts)
    if zero := _clock_zero([recording for listed in read.values() for _, recording in listed]):
        rig = rig.counted_from(zero)
        read = _taken(rig, parts)
    parts = {role: [part for part, _ in listed] for role, listed in read.items()}
    found = {role: [recording for _, recording in listed] for role, listed in read.items()}
    _refuse_twins(found)
    _distinguish(found, parts)
    found = with_uneven_noise(rig, found)
    found = _doubted(rig, {role: [averaged_down(r, rig) for r in listed] for role, listed in found.items()})
    to_fit, found["holdout"] = _to_fit(rig, found, keep_third=keep_third)
    dataset = Dataset(
        rig,
        to_fit,
        # The start of one that judges is fitted to its motion; its errors are told of all of it.
        with_flag([make_experiment(r, rig, fitted_samples=moving_count(r)) for r in found["holdout"]]),
        tuple(make_experiment(r, rig) for r in found["test"]),
    )
    refuse_unusable(dataset.with_test)
    return dataset


def _taken(rig: Rig, parts: dict[str, list[RecordPart]]) -> dict[str, list[tuple[RecordPart, Recording]]]:
    """Return the recordings of each role, with the part of a file that each is."""
    return {
        role: [taken for part in listed for taken in own_parts(part, rig, lambda its: _read(its, rig))]
        for role, listed in parts.items()
    }


def _clock_zero(recordings: Sequence[Recording]) -> float:
    """Return the first time of recordings where the zero of their clock is farther than they last, otherwise zero [s].

    A drift counts from zero: that far from it, it would be an offset, too.
    """
    first, last = min(r.time[0] for r in recordings), max(r.time[-1] for r in recordings)
    return float(first) if abs(first) > last - first else 0.0


def _to_fit(
    rig: Rig, found: dict[str, list[Recording]], *, keep_third: bool
) -> tuple[tuple[Experiment, ...], list[Recording]]:
    """Return what is fitted and what is held out: where nothing is, a last third of each training recording."""
    train, held = found["train"], found["holdout"]
    alone = keep_third and not held
    if alone and get_base(rig.base).drifts(map(get_effect, rig.declared)):
        train, held = thirds_apart(train)
    return with_flag([_fitted(r, rig, alone=alone and not held) for r in train]), held


def _fitted(recording: Recording, rig: Rig, *, alone: bool) -> Experiment:
    """Return the experiment of a recording that is fitted, up to where it rests; in part where it stands alone."""
    moving = moving_part(recording)
    pushed = get_base(rig.base).is_pushed
    count = fitted_count(moving, pushed=pushed, fewest=rig.traits.fewest) if alone else None
    return make_experiment(moving, rig, fitted_samples=count)


def _doubted(rig: Rig, found: dict[str, list[Recording]]) -> dict[str, list[Recording]]:
    """Return recordings with a flag on each whose scale gravity contradicts."""

    def motions(*recordings: Recording) -> list[tuple[FloatArray, FloatArray]]:
        return [(r.time, r.output[:, 0]) for r in recordings]

    def doubt(r: Recording) -> Flag | None:
        if rig.traits.falls:
            return fall_doubt(rig, *motions(r))
        # Swings of different size say more together, unless one of them alone is in another unit.
        return together or angle_doubt(rig, motions(r))

    every = [r for listed in found.values() for r in listed]
    free = rig.gravity is not None and rig.view is None and all(r.input is None for r in every)
    if not free:
        return found
    together = angle_doubt(rig, motions(*every)) if rig.traits.hangs else None
    return {
        role: [replace(r, flags=(*r.flags, said)) if (said := doubt(r)) else r for r in listed]
        for role, listed in found.items()
    }


def _refuse_twins(found: dict[str, list[Recording]]) -> None:
    """Refuse the same samples of the same file twice: a hold-out that was fitted judges nothing."""
    seen: dict[object, str] = {}
    for role, listed in found.items():
        for r in listed:
            key = r.sha256, r.where, r.samples
            if key in seen:
                raise InputError(
                    f"{r.source} is given twice, as {seen[key]} and as {role}: its samples would count twice, or judge "
                    "a fit that has seen them. Name each recording once."
                )
            seen[key] = role
    pairs = [(one, other, "train") for one, other in combinations(found["train"], 2)]
    pairs += [(r, other, role) for r in found["train"] for role in ("holdout", "test") for other in found[role]]
    for one, other, role in pairs:
        at = shared_samples(one, other)
        if at is None:
            continue
        harm = "fitted too: they would count twice. Give parts that do not overlap."
        if role != "train":
            harm = "fitted: it would judge a fit that has seen them. "
            harm += f"Give another recording as {role}, or parts that do not overlap."
        raise InputError(f"{other.source}, from sample {at} on, repeats readings of {one.source}, which is {harm}")


def _distinguish(found: dict[str, list[Recording]], parts: dict[str, list[RecordPart]]) -> None:
    """Name recordings that share a name by the rows they are of, and number those that still do."""
    _rename(found, lambda role, i, r: _rows_name(r.name, parts[role][i]) if parts[role][i].name is None else r.name)
    count: dict[str, int] = {}

    def numbered(role: str, i: int, recording: Recording) -> str:
        count[recording.name] = count.get(recording.name, 0) + 1
        return f"{recording.name}_{count[recording.name]}"

    _rename(found, numbered)


def _rename(found: dict[str, list[Recording]], name: Callable[[str, int, Recording], str]) -> None:
    names = Counter(r.name for listed in found.values() for r in listed)
    for role, listed in found.items():
        for i, recording in enumerate(listed):
            if names[recording.name] > 1:
                listed[i] = replace(recording, name=name(role, i, recording))


def _rows_name(name: str, part: RecordPart) -> str:
    """Name rows of a file by the values that pick them, numbers with their column, or by their place in it."""
    words = [value if isinstance(value, str) else f"{column}_{value:g}" for column, value in part.where]
    name = re.sub(r"[^\w.+-]+", "_", "_".join(words)).strip("_").lower() if words else name
    return f"{name}_{part.samples[0]}-{part.samples[1]}" if part.samples else name
