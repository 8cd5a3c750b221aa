"""Refuse recordings that no sensor of this rig can have produced, and say what to do about it."""

from __future__ import annotations

import numpy as np

from discovery.declarations.units import quoted
from discovery.foundation.arrays import FloatArray
from discovery.foundation.errors import InputError
from discovery.recordings.file_signals import Signals

#: Sizes of numbers whose fifth powers can be computed.
_SMALLEST_NUMBER, _LARGEST_NUMBER = 1e-60, 1e60
# Steps by which times go back where another trial begins.
_FAR = 10.0


def check_signals(found: Signals, fewest: int) -> None:
    """Refuse what holds for no recording of any system; one has at least so many samples.

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
        _check_channel(found, channel, fewest)


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
            "digits; of a steady clock, state rate_hz in the place of the column."
        )
        if _several(steps):
            fault += ", and times increase again from there"
            remedy = (
                "If the file holds several trials, name each in [records] of the rig file, with "
                "where = { column = value } or samples = [start, stop]; else sort the rows."
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


def _check_channel(found: Signals, channel: str, fewest: int) -> None:
    """Refuse a dead sensor and one with too few readings."""
    values = found.outputs[channel]
    finite = values[np.isfinite(values)]
    if finite.size > 0 and np.ptp(finite) == 0:
        level = found.table.numbers(found.names[channel])[np.isfinite(values)][0]
        raise InputError(
            f"{found.at(channel)}: every reading, from {found.table.where(0)} on, is {level:.6g}. The sensor is dead "
            "or not connected: check it and record again."
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


def _rows(count: int) -> str:
    return f"{count} row" if count == 1 else f"{count} rows"
