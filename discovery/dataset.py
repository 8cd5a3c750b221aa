"""What a run works on: a rig with its training and held-out recordings."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

from discovery.errors import InputError
from discovery.experiment import Experiment, make_experiment
from discovery.recording import Recording, read_recording
from discovery.rig import RecordPart, Rig
from discovery.rig_file import read_rig

__all__ = ["Dataset", "load_dataset"]


@dataclass(frozen=True)
class Dataset:
    """A rig with its recordings, input made smooth.

    Parameters
    ----------
    rig : Rig
        The system.
    train, holdout : tuple of Experiment
        Recordings to fit, and recordings that are never fitted. Where there is no hold-out, the last third of every
        training recording is kept out of the fit.
    """

    rig: Rig
    train: tuple[Experiment, ...]
    holdout: tuple[Experiment, ...]

    @cached_property
    def everything(self) -> tuple[tuple[str, Experiment], ...]:
        """All recordings with their roles."""
        return (*(("train", e) for e in self.train), *(("holdout", e) for e in self.holdout))


def _part(path: Path, samples: tuple[int, int] | None, rig: Rig) -> Recording:
    if not path.exists():
        # Public measured data lie in the user's data folder, not beside the rig file.
        from discovery_datasets import registry

        if path.name in {Path(name).name for name in registry.FILES}:
            try:
                path = registry.locate(path.name)
            except registry.DataUnavailable as error:
                raise InputError(f"{path} does not exist, and the {error}") from None
    return read_recording(path, rig, samples)


def load_dataset(
    rig_path: str | os.PathLike[str],
    train: Sequence[str | os.PathLike[str]] = (),
    holdout: Sequence[str | os.PathLike[str]] = (),
    *,
    keep_third: bool = True,
) -> Dataset:
    """Read a rig file and recordings.

    Parameters
    ----------
    rig_path : path
        TOML rig file.
    train, holdout : sequence of path
        Recordings; where `train` is empty, the rig file's own [records].
    keep_third : bool
        Keep the last third of every training recording out of the fit where there is no hold-out.

    Raises
    ------
    InputError
        For anything that cannot be used, naming file, column, row and remedy.
    """
    rig = read_rig(rig_path)
    parts = {
        "train": [RecordPart(Path(p), None) for p in train] or list(rig.records.get("train", ())),
        "holdout": [RecordPart(Path(p), None) for p in holdout]
        or ([] if train else list(rig.records.get("holdout", ()))),
    }
    if not parts["train"]:
        raise InputError(
            f"{rig_path}: there is nothing to fit. Give --train FILE, or a train list under [records] in the rig file."
        )
    found = {role: [_part(p.file, p.samples, rig) for p in listed] for role, listed in parts.items()}
    _distinguish(found)
    alone = keep_third and not found["holdout"]
    return Dataset(
        rig,
        tuple(make_experiment(r, rig, fitted_samples=2 * r.time.size // 3 if alone else None) for r in found["train"]),
        tuple(make_experiment(r, rig) for r in found["holdout"]),
    )


def _distinguish(found: dict[str, list[Recording]]) -> None:
    """Give recordings that share a name, such as parts of one file, a number each."""
    names = [r.name for listed in found.values() for r in listed]
    count: dict[str, int] = {}
    for listed in found.values():
        for i, recording in enumerate(listed):
            if names.count(recording.name) > 1:
                count[recording.name] = count.get(recording.name, 0) + 1
                listed[i] = replace(recording, name=f"{recording.name}_{count[recording.name]}")
