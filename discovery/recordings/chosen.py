"""Recordings as a user gives them: a data set, several recordings, or one; all of one system."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TypeAlias

from discovery.equations.model import Model
from discovery.foundation.errors import InputError
from discovery.mechanics.systems import declaration_of
from discovery.recordings.dataset import Dataset
from discovery.recordings.experiment import Experiment

Recordings: TypeAlias = "Dataset | Experiment | Iterable[Experiment]"
"""A data set, or recordings made ready for simulation."""

_REMEDY = "Give recordings of one system, as load_dataset reads them."


def training_of(given: Recordings) -> tuple[Experiment, ...]:
    """Return the recordings to fit: the training recordings of a data set, or those that are given.

    Anything else, nothing, and recordings of different systems are refused.
    """
    found = given.train if isinstance(given, Dataset) else _experiments(given)
    if not found:
        raise InputError(f"{given!r} has no training recording. Read some with load_dataset(rig, train, holdout).")
    check_one_system(found)
    return found


def held_out_of(given: Recordings, holdout: Recordings | None = None) -> tuple[Experiment, ...]:
    """Return the recordings that judge: those that are given, else the hold-outs of the data set that is fitted.

    Anything else, and recordings of another system than those that are fitted, are refused.
    """
    if holdout is None:
        found = given.holdout if isinstance(given, Dataset) else ()
    else:
        found = holdout.holdout if isinstance(holdout, Dataset) else _experiments(holdout, empty=True)
    check_one_system(found, like=training_of(given)[0])
    return found


def _experiments(given: object, *, empty: bool = False) -> tuple[Experiment, ...]:
    found = (given,) if isinstance(given, Experiment) else tuple(given) if isinstance(given, Iterable) else (given,)
    strangers = [item for item in found if not isinstance(item, Experiment)]
    if strangers:
        raise InputError(
            f"Recordings are a Dataset, as load_dataset returns it, or its train and holdout; {strangers[0]!r:.60} is "
            f"{type(strangers[0]).__name__}. Read files with load_dataset(rig, train, holdout)."
        )
    if not found and not empty:
        raise InputError("No recording is given. Read some with load_dataset(rig, train, holdout).")
    return found


def _system(experiment: Experiment) -> tuple[str, str, str, str]:
    """Return what recordings of one system share: kind, mechanics, and the units of coordinate and input."""
    rig = experiment.rig
    return rig.kind, rig.base, experiment.coordinate_unit, experiment.input_unit


def _told(experiment: Experiment) -> str:
    """Say of what a recording is."""
    kind, base, unit, given = _system(experiment)
    words = (
        kind.replace("_", " ") if base in (kind, experiment.rig.traits.base) else f"{kind} ({base})".replace("_", " ")
    )
    return f"{words} in {unit}" + (f" with an input in {given}" if given else "")


def check_one_system(experiments: Sequence[Experiment], like: Experiment | None = None) -> None:
    """Refuse recordings of different systems: of another one than that of `like`, or of the first of them."""
    if not experiments:
        return
    first = experiments[0] if like is None else like
    for other in experiments:
        if other.rig is not first.rig and _system(other) != _system(first):
            raise InputError(
                f"Recording {other.recording.name!r} is of another system than {first.recording.name!r}: "
                f"{_told(other)}, not {_told(first)}. {_REMEDY}"
            )


def check_model(model: Model, experiments: Sequence[Experiment]) -> None:
    """Refuse recordings of another system than the model's."""
    for experiment in experiments:
        declared = experiment.rig.system is not None or declaration_of(model.base) is not None
        alike = model.base == experiment.rig.base if declared else model.mechanics.system == experiment.system
        if not alike:
            raise InputError(
                f"Recording {experiment.recording.name!r} is of another system than the model: {_told(experiment)}, "
                f"not of the base {model.base!r}. Give recordings of the model's system, or take the model that "
                "their rig file declares with declared_model(dataset)."
            )
