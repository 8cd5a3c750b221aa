"""A reference model of a drive, scored on the recordings of the inverse view and through its filter."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from benchmarks.measured.known import Reference
from discovery.estimation.residual import errors
from discovery.foundation.errors import InputError
from discovery.recordings.dataset import load_dataset


def score_reference(rig: Path, reference: Reference) -> dict[str, dict[str, float]]:
    """Return the errors [N] of a reference model's force by "train" and "holdout".

    Parameters
    ----------
    rig : Path
        Rig file with a [view] of the force.
    reference : Reference
        Its parameters are used as published, nothing is fitted.

    Raises
    ------
    InputError
        If the rig has no view of the force, or its recordings are not here.
    """
    dataset = load_dataset(rig)
    if dataset.rig.view is None:
        raise InputError(f"{rig}: a reference model is scored through the filter of [view], which is missing.")
    found = {}
    for role, listed in (("train", dataset.train), ("holdout", dataset.holdout)):
        predicted, measured = [], []
        for e in listed:
            assert e.drive is not None
            _, rate, acceleration = e.drive.evaluate(e.recording.time)
            force = reference.mass * acceleration + reference.viscous * rate + reference.offset
            force += reference.coulomb * np.sign(rate)
            predicted.append(e.channels(force[:, None, None])[:, :, 0])
            measured.append(e.recording.output)
        found[role] = errors(np.concatenate(predicted), np.concatenate(measured))
    return found
