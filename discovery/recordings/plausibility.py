"""Refuse recordings that no sensor of this rig can have produced, an arm the least, and say what to do about it."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from discovery.declarations.units import quoted
from discovery.foundation.arrays import FloatArray, within_half_a_turn
from discovery.foundation.errors import InputError
from discovery.foundation.sampling import median_step
from discovery.recordings.file_signals import Signals, judged_channels
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
#: Sizes of numbers whose fifth powers can be computed.
_SMALLEST_NUMBER, _LARGEST_NUMBER = 1e-60, 1e60
# Steps by which times go back where another trial begins.
_FAR = 10.0


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
                "than half a turn. If one of the angles is in degrees, rename its column to end in _deg; count "
                "both angles from the same turn."
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


def check_signals(found: Signals, fewest: int, may_rest: Collection[str] = ()) -> None:
    """Refuse what holds for no recording of any system; one has at least so many samples.

    Of channels that `may_rest` all readings may be alike: others tell whether anything moves, and their noise is known.

    Refused are times that are missing, do not increase or leave most out, a gap in the input, a dead sensor, and too
    short a record.
    """
    time, table = found.time, found.table
    for signal, values in {"time": time, found.given: found.inputs, **found.outputs}.items():
        if values is not None:
            _check_range(found, signal, values)
    _check_increase(found)
    if found.outputs and time.size >= fewest:
        _check_pause(found)
    if found.inputs is not None and np.isnan(found.inputs).any():
        raise InputError(
            f"{found.at(found.given, row=int(np.argmax(np.isnan(found.inputs))))}: the input is missing. The motion "
            "cannot be computed across a gap in the input: fill it, or cut the recording there."
        )
    if not found.outputs:
        if time.size < 2:
            raise InputError(f"{table.path} is too short: {_rows(time.size)}. A prediction needs at least 2.")
        return
    if time.size < fewest:
        few, remedy = f"is too short: {_rows(time.size)}", "Record longer or faster"
        if table.whole > time.size:
            few = f"is used in too small a part: {time.size} of its {_rows(table.whole)}"
            remedy = "Take more rows, by samples, where and every of the rig file, or record longer or faster"
        raise InputError(f"{table.path} {few}, and at least {fewest} are needed. {remedy}.")
    for channel in found.outputs:
        _check_channel(found, channel, fewest, rests=channel in may_rest)


def _check_increase(found: Signals) -> None:
    """Refuse times that are missing or do not increase."""
    time = found.time
    if np.isnan(time).any():
        raise InputError(
            f"{found.at('time', row=int(np.argmax(np.isnan(time))))}: the time is missing. Remove the row; only "
            "outputs may have gaps."
        )
    steps = np.diff(time)
    if (steps <= 0).any():
        row = int(np.argmax(steps <= 0)) + 1
        fault = "the same time as the row before" if steps[row - 1] == 0 else "earlier than the row before"
        remedy = (
            "Times must strictly increase: sort the rows, remove those that stand twice, and export times with enough "
            "digits; of a steady clock, state its rate in the place of the column, time = { rate_hz = 100.0 } say."
        )
        if _several(steps):
            fault += ", and times increase again from there"
            remedy = (
                "If the file holds several trials, or its clock was set back, name each part in [records] of the rig "
                "file, with where = { column = value } or samples = [start, stop]; else sort the rows."
            )
        now = quoted(float(time[row]), found.units.get("time", "s"), 9)
        raise InputError(f"{found.at('time', row=row)}: {now} is {fault}. {remedy}")


def _check_pause(found: Signals) -> None:
    """Refuse a recording most of which is one pause."""
    steps = np.diff(found.time)
    if 2.0 * (longest := float(steps.max())) > found.time[-1] - found.time[0]:
        pause = quoted(longest, found.units.get("time", "s"), 4)
        raise InputError(
            f"{found.at('time', row=int(np.argmax(steps)) + 1)}: {pause} pass before it, more than the rest of the "
            "recording lasts, and nothing was read meanwhile. Correct the times if the clock jumped; else name the "
            "parts in [records] of the rig file, each with samples = [start, stop]."
        )


def _check_channel(found: Signals, channel: str, fewest: int, *, rests: bool) -> None:
    """Refuse a dead sensor and one with too few readings."""
    values = found.outputs[channel]
    finite = values[np.isfinite(values)]
    if finite.size > 0 and np.ptp(finite) == 0 and not rests:
        level = found.table.numbers(found.names[channel])[np.isfinite(values)][0]
        raise InputError(
            f"{found.at(channel)}: every reading, from {found.table.where(0)} on, is {level:.6g}. "
            + (
                "If it rests while the output moves, state its noise in [columns.also] of the rig file."
                if channel not in found.channels[judged_channels(found.channels)]
                else "The sensor is dead or not connected: check it and record again."
            )
        )
    if finite.size < fewest:
        raise InputError(
            f"{found.at(channel)} is too short: {finite.size} readings in {found.time.size} rows, and at least "
            f"{fewest} are needed. Close the gaps or record longer."
        )


def _check_range(found: Signals, signal: str, values: FloatArray) -> None:
    """Refuse numbers whose powers leave the range of floating-point numbers."""
    sizes = np.where(np.isnan(values), 0.0, np.abs(values))
    largest = float(np.max(sizes, initial=0.0))
    if largest > _LARGEST_NUMBER or 0.0 < largest < _SMALLEST_NUMBER:
        raise InputError(
            f"{found.at(signal, row=int(np.argmax(sizes)))}: the largest number is {largest:.3g} in SI units; what can "
            f"be computed with lies between {_SMALLEST_NUMBER:g} and {_LARGEST_NUMBER:g}. Correct the unit or the "
            "scale in the rig file, or export the recording again."
        )


def _several(steps: FloatArray) -> bool:
    """Whether times run on as before wherever they go back: another trial follows, or once the clock was set back."""
    back, typical = np.flatnonzero(steps < 0), float(np.median(steps))
    if not back.size or back[-1] + 1 == steps.size or (steps == 0).any():
        return False
    follows = (steps[back] < -_FAR * typical).all() and (steps[back + 1] < _FAR * typical).all()
    return bool(follows or (back.size == 1 and steps[back[0] + 1] < 2.0 * typical))


def _rows(count: int) -> str:
    return f"{count} row" if count == 1 else f"{count} rows"
