"""What ``--predict`` asks for: the recording, the state it begins in, and the file that is written for it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from discovery.cli.options import note

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from discovery.foundation.errors import ComputationError
    from discovery.foundation.progress import Tell
    from discovery.recordings.dataset import Dataset
    from discovery.recordings.experiment import Experiment
    from discovery.runs.loop_result import LoopResult

#: A recorded reach, or a turn, times so much is still believed of an angle that turns on.
_ANGLES = 2.0
#: A recorded reach times so much is still believed of a length: a thousand is a mistaken prefix.
_LENGTHS = 30.0
#: The largest input of training times so much is no farther than that.
_BEYOND = 1.05


def read_state(text: str | None) -> tuple[float, float] | None:
    """Return the two numbers of ``--initial-state``; refuse what are not two finite numbers."""
    if text is None:
        return None
    from discovery.foundation.errors import InputError

    try:
        angle, rate = (float(part) for part in text.split(","))
        if not (math.isfinite(angle) and math.isfinite(rate)):
            raise ValueError
    except ValueError:
        raise InputError(
            f"--initial-state {text!r} is not POSITION,RATE: give two numbers in rad and rad/s, such as 0.1,0, or "
            "where the output is a length in m and m/s."
        ) from None
    return angle, rate


def check_state(state: tuple[float, float] | None, dataset: Dataset) -> None:
    """Refuse a state in degrees, or in a column's unit that is not an SI unit, with the same state in SI units."""
    first = dataset.train[0]
    if state is None or first.rig.view is not None or first.reads_acceleration:
        return
    import numpy as np

    from discovery.declarations.units import si_factor
    from discovery.foundation.errors import InputError

    value, rate = state
    unit, column = first.coordinate_unit, first.rig.columns.output.unit
    # A hub or a pendulum may turn on: what was recorded is believed, and as much again.
    reach = max(float(np.nanmax(np.abs(e.deflection))) for _, e in dataset.everything)
    if unit == "rad":
        factor, other = math.radians(1.0), "degrees"
        mistaken = abs(value) > max(2.0 * math.pi, _ANGLES * reach)
    else:
        factor, other = si_factor(column), column
        mistaken = abs(value) > _LENGTHS * reach >= factor * abs(value)
    if mistaken:
        raise InputError(
            f"--initial-state {value:g},{rate:g} is in {unit} and {unit}/s, but the recordings reach no farther than "
            f"{reach:.3g} {unit}. If you mean {value:g} {other}, give --initial-state "
            f"{factor * value:.4g},{factor * rate:.4g}."
        )


def read_wanted(target: Path, dataset: Dataset, initial: tuple[float, float] | None) -> Experiment:
    """Read what is to be predicted."""
    from discovery.declarations.units import in_coordinate
    from discovery.recordings.dataset import read_to_predict
    from discovery.recordings.experiment import make_experiment

    wanted = make_experiment(read_to_predict(target, dataset.rig), dataset.rig)
    if initial is None and wanted.drive is None:
        unit = dataset.train[0].reading_unit
        note(
            f"{target}: without --initial-state the prediction starts at rest, and no input drives this system: it "
            "stays there, unless it falls or a force in time is found. Give what is read at the first time, and its "
            f"rate, with --initial-state POSITION,RATE [{unit}, {in_coordinate('q s^-1', unit)}]."
        )
    if beyond := _beyond(wanted, dataset.train):
        note(f"{target}: {beyond}")
    return wanted


def _beyond(wanted: Experiment, train: Sequence[Experiment]) -> str | None:
    """Return how far the input that pushes goes beyond that of training; None where it does not."""
    import numpy as np

    from discovery.declarations.units import quoted
    from discovery.mechanics import get_base

    def reach(*experiments: Experiment) -> float:
        inputs = [e.recording.input for e in experiments if e.recording.input is not None]
        return max((float(np.nanmax(np.abs(u))) for u in inputs), default=0.0)

    unit, most, known = wanted.input_unit, reach(wanted), reach(*train)
    if not get_base(wanted.rig.base).is_pushed or most <= _BEYOND * known:
        return None
    return (
        f"its input reaches {quoted(most, unit, 3)}, and that of the training recordings {quoted(known, unit, 3)}. "
        "Beyond it laws that explain training alike may part: the standard deviations are those of the law that is "
        "named."
    )


def write_prediction(
    folder: Path, wanted: Experiment, result: LoopResult, initial: tuple[float, float] | None, tell: Tell,
    target: Path | None,
) -> ComputationError | None:  # fmt: skip
    """Write prediction.csv, and return why there is none."""
    from discovery.foundation.errors import ComputationError
    from discovery.runs.loop_files import save_prediction

    tell("predicting")
    try:
        models, errors = (result.before, result.foresight()), result.model_error.expected
        why = save_prediction(folder / "prediction.csv", wanted, *models, initial, errors)
    except ComputationError as failure:
        return failure
    if why:
        note(f"{target}: the declared model does not predict it, its columns are left empty. {why}")
    column = wanted.rig.columns.output
    if not wanted.system.has_rod and (column.zero or column.scale != 1.0):
        note(
            f"prediction.csv has the output in {wanted.recording.units[0]}, {column.scale:g} times what "
            f"{column.name!r} reads beyond {column.zero:g} {column.unit}, as the rig file states."
        )
    return None
