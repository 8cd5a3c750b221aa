"""Recordings as a user gives them: a data set, several recordings, or one."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypeAlias

from discovery.foundation.errors import InputError
from discovery.recordings.dataset import Dataset
from discovery.recordings.experiment import Experiment
from discovery.recordings.one_system import check_one_system

Recordings: TypeAlias = "Dataset | Experiment | Iterable[Experiment]"
"""A data set, or recordings made ready for simulation."""


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
