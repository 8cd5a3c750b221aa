"""The state from which a prediction starts, as the command line gives it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from discovery.recordings.dataset import Dataset

#: A recorded reach, or a turn, times so much is still believed of an angle that turns on.
_ANGLES = 2.0
#: A recorded reach times so much is still believed of a length: a thousand is a mistaken prefix.
_LENGTHS = 30.0


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
            f"--initial-state {text!r} is not ANGLE,RATE: give two numbers in rad and rad/s, such as 0.1,0, or where "
            "the output is a length in m and m/s."
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
