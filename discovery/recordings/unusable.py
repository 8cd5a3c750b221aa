"""Recordings that are read and from which nothing can be learned, refused with what to do."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from discovery.declarations.units import quoted
from discovery.foundation.errors import InputError
from discovery.recordings.copies import scaled_copy
from discovery.recordings.experiment import Experiment

__all__ = ["refuse_unusable"]

#: Finite samples that a fitted and a held-out part need at least, where the kind of system does not need fewer.
_FEWEST = 30
#: A rod bends where its deflections scatter by more than noise would, over the scatter of their steps.
_BENDS = 1.1


def refuse_unusable(recordings: Sequence[tuple[str, Experiment]]) -> None:
    """Refuse recordings, each with its role, from which nothing can be learned.

    Raises
    ------
    InputError
        If a part holds no measurement, an input is dead or copied, or an arm bends in none that is fitted.
    """
    for role, experiment in recordings:
        _refuse_one(role, experiment)
    _refuse_unbent([e for role, e in recordings if role == "train"])


def _refuse_one(role: str, experiment: Experiment) -> None:
    """Refuse a recording whose fitted or held-out part holds no measurement, or whose input is dead."""
    r = experiment.recording
    finite = np.asarray(np.isfinite(r.output).all(axis=1))
    fitted = np.zeros(r.time.size, bool)
    fitted[experiment.fitted] = True
    parts = {"fitted": finite[fitted]} if role == "train" else {"held-out": finite}
    if role == "train" and not fitted.all():
        parts["held-out"] = finite[~fitted]
    fewest = min(_FEWEST, experiment.rig.traits.fewest)
    for name, part in parts.items():
        if part.sum() < fewest:
            raise InputError(
                f"{r.source}: its {name} part has {int(part.sum())} samples with an output, and at least {fewest} are "
                "needed. Give a recording without so long a gap, or other recordings with --train and --holdout."
            )
    given = experiment.rig.columns.input
    if r.input is not None and given is not None and any(scaled_copy(r.input, c) for c in r.output.T):
        raise InputError(
            f"{r.source}: the output is a copy of the input, column {given.name!r}, noise and all: no system does "
            "that. Write the column of each in [columns] of the rig file, or export the recording again."
        )
    if not experiment.system.has_rod and r.input is not None and np.ptp(r.input) == 0:
        value = f"{r.input[0]:g}" if given is None else quoted(float(r.input[0]), given.unit, 6)
        raise InputError(
            f"{r.source}: the input is {value} throughout, so it drives nothing and its gain cannot be found. "
            "For a free decay, remove the input from [columns] in the rig file."
        )


def _refuse_unbent(experiments: Sequence[Experiment]) -> None:
    """Refuse recordings of an arm that nowhere bends: nothing of how it does can be learned."""

    def bends(e: Experiment) -> bool:
        deflection = e.deflection[e.fitted]
        # What is noise alone scatters as its steps do.
        return bool(np.nanstd(deflection) > _BENDS * np.nanstd(np.diff(deflection)) / np.sqrt(2.0))

    if not experiments[0].system.has_rod or any(map(bends, experiments)):
        return
    names = ", ".join(e.recording.source for e in experiments)
    raise InputError(
        f"{names}: the tip never leaves the motor's line by more than its noise, so nothing of how the arm bends can "
        "be learned. Record faster moves, or check the columns of motor and tip."
    )
