"""Refuse recordings that no sensor of this rig can have produced, and say what to do about it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from discovery.declarations.units import quoted
from discovery.foundation.errors import InputError
from discovery.foundation.io import Table
from discovery.recordings.angles import within_half_a_turn
from discovery.rigs.rig import Rig

__all__ = ["check_arm", "check_signals"]

FloatArray = npt.NDArray[np.float64]

# Room for errors of scale and origin that are effects to be found, not mistakes of the file.
LENGTH_MARGIN = 0.10
NEAREST = 0.2
LARGEST_TURN = 4.0 * np.pi
LARGEST_DEFLECTION = np.pi
#: Sizes of numbers whose fifth powers can be computed.
_SMALLEST_NUMBER, _LARGEST_NUMBER = 1e-60, 1e60
#: So small a share of readings may be wild ones.
_WILD = 0.01
# Steps by which times go back where another trial begins.
_FAR = 10.0
# Where the rig does not tell the period [s]; the arms of the literature swing faster.
SLOWEST_SWING = 20.0


def check_signals(
    table: Table,
    names: Mapping[str, str],
    units: Mapping[str, str],
    time: FloatArray,
    inputs: FloatArray | None,
    outputs: Mapping[str, FloatArray],
    fewest: int,
) -> None:
    """Check what holds for a recording of any system.

    Parameters
    ----------
    table : Table
        The rows that the arrays hold, for the messages.
    names : mapping of str to str
        Signal (``"time"``, ``"motor_angle"``, ...) to the name of its column.
    units : mapping of str to str
        Signal to the unit of its column, for the messages.
    time, inputs : array, shape (n,)
        In SI units; there may be no input.
    outputs : mapping of str to array, shape (n,)
        The channels; empty where only times and inputs are given.
    fewest : int
        Samples that are needed at least.

    Raises
    ------
    InputError
        If times are missing, do not increase or leave most out, the input has a gap, a sensor is dead or the record is
        too short.
    """
    label = names.get("time", "")
    for signal, values in {"time": time, "input": inputs, **outputs}.items():
        if values is not None:
            _check_range(table, names.get(signal) or names.get("motor_angle", signal), values)
    if np.isnan(time).any():
        row = int(np.argmax(np.isnan(time)))
        raise InputError(
            f"{table.path}, column {label!r}, {table.where(row)}: the time is missing. "
            "Remove the row; only outputs may have gaps."
        )
    steps = np.diff(time)
    if (steps <= 0).any():
        row = int(np.argmax(steps <= 0)) + 1
        fault = "the same time as the row before" if steps[row - 1] == 0 else "earlier than the row before"
        remedy = (
            "Times must strictly increase: sort the rows, remove repeated ones, and export times with enough digits."
        )
        if _several(steps):
            fault += ", and times increase again from there"
            remedy = (
                "If the file holds several trials, name each in [records] of the rig file, with "
                "where = { column = value } or samples = [start, stop]; else sort the rows."
            )
        now = quoted(float(time[row]), units["time"], 9)
        raise InputError(f"{table.path}, column {label!r}, {table.where(row)}: {now} is {fault}. {remedy}")
    if outputs and time.size >= fewest and 2.0 * (longest := float(steps.max())) > time[-1] - time[0]:
        row = int(np.argmax(steps)) + 1
        raise InputError(
            f"{table.path}, column {label!r}, {table.where(row)}: {quoted(longest, units['time'], 4)} pass before it, "
            "more than the rest of the recording lasts, and nothing was read meanwhile. Correct the times if the clock "
            "jumped; else name the parts in [records] of the rig file, each with samples = [start, stop]."
        )
    if inputs is not None and np.isnan(inputs).any():
        row = int(np.argmax(np.isnan(inputs)))
        column = names.get("motor_angle", names.get("input", "input"))
        raise InputError(
            f"{table.path}, column {column!r}, {table.where(row)}: the input is missing. The motion cannot be "
            "computed across a gap in the input: fill it, or cut the recording there."
        )
    if not outputs:
        if time.size < 2:
            raise InputError(f"{table.path} is too short: {_rows(time.size)}. A prediction needs at least 2.")
        return
    if time.size < fewest:
        raise InputError(
            f"{table.path} is too short: {_rows(time.size)}, and at least {fewest} are needed. Record longer or faster."
        )
    for channel, values in outputs.items():
        finite = values[np.isfinite(values)]
        if finite.size > 0 and np.ptp(finite) == 0:
            raise InputError(
                f"{table.path}, column {names[channel]!r}: every reading, from {table.where(0)} on, is "
                f"{table.numbers(names[channel])[np.isfinite(values)][0]:.6g}. "
                "The sensor is dead or not connected: check it and record again."
            )
        if finite.size < fewest:
            raise InputError(
                f"{table.path}, column {names[channel]!r} is too short: {finite.size} readings in {time.size} rows, "
                f"and at "
                f"least {fewest} are needed. Close the gaps or record longer."
            )


def _check_range(table: Table, column: str, values: FloatArray) -> None:
    """Refuse numbers whose powers leave the range of floating-point numbers."""
    sizes = np.where(np.isnan(values), 0.0, np.abs(values))
    largest = float(np.max(sizes, initial=0.0))
    if largest > _LARGEST_NUMBER or 0.0 < largest < _SMALLEST_NUMBER:
        raise InputError(
            f"{table.path}, column {column!r}, {table.where(int(np.argmax(sizes)))}: the largest number is "
            f"{largest:.3g} in SI units; what can be computed with lies between {_SMALLEST_NUMBER:g} and "
            f"{_LARGEST_NUMBER:g}. Correct the unit or the scale in the rig file, or export the recording again."
        )


def _several(steps: FloatArray) -> bool:
    """Whether times run on as before wherever they go back, as where one trial follows another."""
    back = np.flatnonzero(steps < 0)
    far = _FAR * float(np.median(steps))
    return bool(
        back.size > 0
        and back[-1] + 1 < steps.size
        and (steps[back] < -far).all()
        and (steps[back + 1] < far).all()
        and (steps != 0).all()
    )


def check_arm(
    table: Table,
    names: Mapping[str, str],
    units: Mapping[str, str],
    rig: Rig,
    time: FloatArray,
    inputs: FloatArray | None,
    outputs: Mapping[str, FloatArray],
) -> None:
    """Check that a flexible arm of this length can have moved like this; arguments as in `check_signals`.

    Raises
    ------
    InputError
        If lengths look like millimetres, angles like degrees or times like milliseconds given in SI units, if the tip
        leaves the reach of the arm, or if the record is shorter than one swing.
    """
    assert rig.length is not None  # read_rig demands it of an arm
    length = rig.length.value
    assert inputs is not None  # the column is required
    _check_motor(table, names["motor_angle"], units["motor_angle"], inputs)
    if not outputs:
        return
    _check_duration(table, names["time"], units["time"], rig, time)
    if "tip_x" in outputs:
        columns = names["tip_x"], names["tip_y"]
        radius = np.hypot(outputs["tip_x"], outputs["tip_y"])
        _check_within(table, columns, units["tip_x"], length, radius)
        _check_not_nearer(table, columns, units["tip_x"], length, radius)
        direction = np.arctan2(outputs["tip_y"], outputs["tip_x"])
        # The camera does not count turns.
        deflection = within_half_a_turn(direction - inputs)
        _check_follows(table, names["motor_angle"], units["motor_angle"], inputs, direction, deflection)
    elif "tip_angle" in outputs:
        deflection = outputs["tip_angle"] - inputs
        worst = int(np.nanargmax(np.abs(deflection)))
        if abs(deflection[worst]) > LARGEST_DEFLECTION:
            raise InputError(
                f"{table.path}, column {names['tip_angle']!r}, {table.where(worst)}: the tip would be "
                f"deflected by {quoted(float(deflection[worst]), units['tip_angle'], 4)} from the motor's direction, "
                "more than half a turn. If one of the angles is in degrees, rename its column to end in _deg; the "
                "angle of the tip must not jump by full turns."
            )
    else:
        _check_within(
            table, [names["tip_deflection"]], units["tip_deflection"], length, np.abs(outputs["tip_deflection"])
        )


def _degrees(unit: str) -> str:
    """Return what to do about an angle that turns too far."""
    if unit == "deg":
        return "Correct the unit in the column's name."
    return "If the angle is in degrees, rename the column to 'motor_angle_deg'."


def _check_motor(table: Table, column: str, unit: str, inputs: FloatArray) -> None:
    turn = float(np.ptp(inputs))
    if turn > LARGEST_TURN:
        row = int(np.argmax(np.abs(inputs - inputs[0])))
        raise InputError(
            f"{table.path}, column {column!r}, {table.where(row)}: the motor would turn by "
            f"{quoted(turn, unit, 4)}, more than two full turns. {_degrees(unit)}"
        )


def _check_duration(table: Table, column: str, unit: str, rig: Rig, time: FloatArray) -> None:
    """Refuse records shorter than a swing, and sampling too slow to see one."""
    duration, step = float(time[-1] - time[0]), float(np.median(np.diff(time)))
    period, source = SLOWEST_SWING, ""
    if rig.length and rig.tip_mass and rig.flexural_rigidity:
        # Linear arm (eq. 12 of the paper) with the whole rod's mass at the tip: longer than the true period.
        mass = rig.tip_mass.value + (rig.beam_mass.value if rig.beam_mass else 0.0)
        period = 2.0 * np.pi * np.sqrt(mass * rig.length.value**3 / (3.0 * rig.flexural_rigidity.value))
        source = " by the rig file's masses, length and rigidity"
        if duration < period:
            raise InputError(
                f"{table.path}, column {column!r}: the record is too short: it lasts "
                f"{quoted(duration, unit, 4)}, less than one swing of this arm ({quoted(period, unit)}{source}). "
                "Record longer, or correct these, or the unit in the column's name."
            )
    if step > 0.25 * period:
        remedy = "If the times are in milliseconds, rename the column to 'time_ms'; else sample faster"
        if unit != "s":
            remedy = "Correct the unit in the column's name, or sample faster"
        if source:
            remedy += ", or correct these quantities and their units"
        raise InputError(
            f"{table.path}, column {column!r}: the samples are {quoted(step, unit, 4)} apart, too far for an arm that "
            f"swings in {quoted(period, unit)}{source}. {remedy}."
        )


def _rows(count: int) -> str:
    return f"{count} row" if count == 1 else f"{count} rows"


def _check_within(table: Table, columns: Sequence[str], unit: str, length: float, distance: FloatArray) -> None:
    """Refuse a tip beyond the reach of the arm, at its first row."""
    beyond = distance > (1.0 + LENGTH_MARGIN) * length
    if not beyond.any():
        return
    row = int(np.argmax(beyond))
    if unit == "m" and np.nanmedian(distance[beyond]) > 30.0 * length:
        names = " and ".join(repr(f"{column.rsplit('_', 1)[0]}_mm") for column in columns)
        cure = f"If it is in millimetres, rename to {names}."
    else:
        cure = "Correct length_m in the rig file, the unit in the column's name, or the camera's origin: it is the hub."
        if beyond.sum() <= _WILD * np.isfinite(distance).sum():
            cure = f"Few readings are that far ({beyond.sum()}): empty the cells of a wild one. Else: {cure}"
    raise InputError(
        f"{table.path}, {_columns(columns)}, {table.where(row)}: the tip would be "
        f"{quoted(float(distance[row]), unit, 4)} away on an arm that is {quoted(length, unit, 4)} long. {cure}"
    )


def _check_not_nearer(table: Table, columns: Sequence[str], unit: str, length: float, radius: FloatArray) -> None:
    farthest = int(np.nanargmax(radius))
    if radius[farthest] < NEAREST * length:
        raise InputError(
            f"{table.path}, {_columns(columns)}, {table.where(farthest)}: the tip is never farther from the "
            f"hub than {quoted(float(radius[farthest]), unit, 4)}, but the arm is {quoted(length, unit, 4)} long. "
            "Correct length_m in the rig file or the unit in the columns' names, and measure from the hub."
        )


def _columns(columns: Sequence[str]) -> str:
    return ("column " if len(columns) == 1 else "columns ") + " and ".join(map(repr, columns))


def _check_follows(
    table: Table, column: str, unit: str, inputs: FloatArray, direction: FloatArray, deflection: FloatArray
) -> None:
    """Refuse a motor angle in degrees: it runs away from the tip, by 57 radians for each."""
    finite = np.isfinite(direction)
    turn = float(np.ptp(inputs[finite]))
    follows = float(np.ptp(np.unwrap(direction[finite])))
    far = float(np.nanmax(np.abs(deflection)))
    if turn > 1.0 and (turn > 20.0 * follows or (turn > 2.0 * np.pi and far > 0.9 * LARGEST_DEFLECTION)):
        row = int(np.argmax(np.abs(inputs - inputs[0])))
        raise InputError(
            f"{table.path}, column {column!r}, {table.where(row)}: the motor would turn by "
            f"{quoted(turn, unit, 4)} while the tip's direction changes by {quoted(follows, unit)}. {_degrees(unit)}"
        )
