"""Recordings and models that belong together are of one system."""

from __future__ import annotations

from collections.abc import Sequence

from discovery.equations.model import Model
from discovery.foundation.errors import InputError
from discovery.mechanics.systems import declaration_of
from discovery.recordings.experiment import Experiment

_REMEDY = "Give recordings of one system, as load_dataset reads them."


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
