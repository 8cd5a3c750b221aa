"""What no recording of an arm can show: angles, lengths and durations beyond those of its rig."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from discovery.declarations.units import quoted
from discovery.foundation.arrays import FloatArray
from discovery.foundation.errors import InputError
from discovery.foundation.sampling import median_step
from discovery.recordings.angles import within_half_a_turn
from discovery.recordings.file_signals import Signals
from discovery.rigs.rig import Rig

#: So small a share of readings may be wild ones.
_WILD = 0.01
# Room for errors of scale and origin that are effects to be found, not mistakes of the file.
LENGTH_MARGIN = 0.10
NEAREST = 0.2
LARGEST_TURN = 4.0 * np.pi
LARGEST_DEFLECTION = np.pi
# Where the rig does not tell the period [s]; the arms of the literature swing faster.
SLOWEST_SWING = 20.0


def check_arm(found: Signals, rig: Rig) -> None:
    """Refuse what a flexible arm of this length cannot have done.

    Refused are lengths that look like millimetres, angles like degrees or times like milliseconds given in SI units, a
    tip that leaves the reach of the arm, and a record shorter than one swing.
    """
    assert rig.length is not None  # read_rig demands it of an arm
    length, inputs, outputs = rig.length.value, found.inputs, found.outputs
    assert inputs is not None  # the column is required
    _check_motor(found, inputs)
    if not outputs:
        return
    _check_duration(found, rig)
    if "tip_x" in outputs:
        radius = np.hypot(outputs["tip_x"], outputs["tip_y"])
        _check_within(found, ("tip_x", "tip_y"), length, radius)
        _check_not_nearer(found, length, radius)
        direction = np.arctan2(outputs["tip_y"], outputs["tip_x"])
        # The camera does not count turns.
        _check_follows(found, inputs, direction, within_half_a_turn(direction - inputs))
    elif "tip_angle" in outputs:
        deflection = outputs["tip_angle"] - inputs
        worst = int(np.nanargmax(np.abs(deflection)))
        if abs(deflection[worst]) > LARGEST_DEFLECTION:
            raise InputError(
                f"{found.at('tip_angle', row=worst)}: the tip would be deflected by "
                f"{quoted(float(deflection[worst]), found.units['tip_angle'], 4)} from the motor's direction, more "
                "than half a turn. If one of the angles is in degrees, rename its column to end in _deg; the angle of "
                "the tip must not jump by full turns."
            )
    else:
        _check_within(found, ("tip_deflection",), length, np.abs(outputs["tip_deflection"]))


def _degrees(unit: str) -> str:
    """Return what to do about an angle that turns too far."""
    if unit == "deg":
        return "Correct the unit in the column's name."
    return "If the angle is in degrees, rename the column to 'motor_angle_deg'."


def _check_motor(found: Signals, inputs: FloatArray) -> None:
    turn, unit = float(np.ptp(inputs)), found.units["motor_angle"]
    if turn > LARGEST_TURN:
        row = int(np.argmax(np.abs(inputs - inputs[0])))
        raise InputError(
            f"{found.at('motor_angle', row=row)}: the motor would turn by {quoted(turn, unit, 4)}, more than two full "
            f"turns. {_degrees(unit)}"
        )


def _check_duration(found: Signals, rig: Rig) -> None:
    """Refuse records shorter than a swing, and sampling too slow to see one."""
    unit = found.units["time"]
    duration, step = float(found.time[-1] - found.time[0]), median_step(found.time)
    period, source = SLOWEST_SWING, ""
    if rig.length and rig.tip_mass and rig.flexural_rigidity:
        # Linear arm (eq. 12 of the paper) with the whole rod's mass at the tip: longer than the true period.
        mass = rig.tip_mass.value + (rig.beam_mass.value if rig.beam_mass else 0.0)
        period = 2.0 * np.pi * np.sqrt(mass * rig.length.value**3 / (3.0 * rig.flexural_rigidity.value))
        source = " by the rig file's masses, length and rigidity"
        if duration < period:
            raise InputError(
                f"{found.at('time')}: the record is too short: it lasts {quoted(duration, unit, 4)}, less than one "
                f"swing of this arm ({quoted(period, unit)}{source}). Record longer, or correct these, or the unit in "
                "the column's name."
            )
    if step > 0.25 * period:
        remedy = "If the times are in milliseconds, rename the column to 'time_ms'; else sample faster"
        if unit != "s":
            remedy = "Correct the unit in the column's name, or sample faster"
        if source:
            remedy += ", or correct these quantities and their units"
        raise InputError(
            f"{found.at('time')}: the samples are {quoted(step, unit, 4)} apart, too far for an arm that swings in "
            f"{quoted(period, unit)}{source}. {remedy}."
        )


def _check_within(found: Signals, signals: Sequence[str], length: float, distance: FloatArray) -> None:
    """Refuse a tip beyond the reach of the arm, at its first row."""
    beyond, unit = distance > (1.0 + LENGTH_MARGIN) * length, found.units[signals[0]]
    if not beyond.any():
        return
    row = int(np.argmax(beyond))
    if unit == "m" and np.nanmedian(distance[beyond]) > 30.0 * length:
        names = " and ".join(repr(f"{found.names[signal].rsplit('_', 1)[0]}_mm") for signal in signals)
        cure = f"If it is in millimetres, rename to {names}."
    else:
        cure = "Correct length_m in the rig file, the unit in the column's name, or the camera's origin: it is the hub."
        if beyond.sum() <= _WILD * np.isfinite(distance).sum():
            cure = f"Few readings are that far ({beyond.sum()}): empty the cells of a wild one. Else: {cure}"
    raise InputError(
        f"{found.at(*signals, row=row)}: the tip would be {quoted(float(distance[row]), unit, 4)} away on an arm that "
        f"is {quoted(length, unit, 4)} long. {cure}"
    )


def _check_not_nearer(found: Signals, length: float, radius: FloatArray) -> None:
    farthest, unit = int(np.nanargmax(radius)), found.units["tip_x"]
    if radius[farthest] < NEAREST * length:
        raise InputError(
            f"{found.at('tip_x', 'tip_y', row=farthest)}: the tip is never farther from the hub than "
            f"{quoted(float(radius[farthest]), unit, 4)}, but the arm is {quoted(length, unit, 4)} long. Correct "
            "length_m in the rig file or the unit in the columns' names, and measure from the hub."
        )


def _check_follows(found: Signals, inputs: FloatArray, direction: FloatArray, deflection: FloatArray) -> None:
    """Refuse a motor angle in degrees: it runs away from the tip, by 57 radians for each."""
    finite, unit = np.isfinite(direction), found.units["motor_angle"]
    turn = float(np.ptp(inputs[finite]))
    follows = float(np.ptp(np.unwrap(direction[finite])))
    far = float(np.nanmax(np.abs(deflection)))
    if turn > 1.0 and (turn > 20.0 * follows or (turn > 2.0 * np.pi and far > 0.9 * LARGEST_DEFLECTION)):
        row = int(np.argmax(np.abs(inputs - inputs[0])))
        raise InputError(
            f"{found.at('motor_angle', row=row)}: the motor would turn by {quoted(turn, unit, 4)} while the tip's "
            f"direction changes by {quoted(follows, unit)}. {_degrees(unit)}"
        )
