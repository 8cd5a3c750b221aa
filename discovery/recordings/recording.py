"""Recordings: what was measured, in SI units, checked before anything is computed from it."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from discovery.declarations.units import si_factor, si_symbol
from discovery.foundation.errors import InputError
from discovery.foundation.io import read_table
from discovery.plots.recordings import RecordingViews
from discovery.recordings.arm_plausibility import check_arm
from discovery.recordings.force_view import force_samples, noise_gain, sampling_rate, zero_phase
from discovery.recordings.plausibility import check_signals
from discovery.recordings.quantisation import resolution
from discovery.recordings.reading_noise import estimate_noise, noise_note
from discovery.recordings.reading_notes import bend_notes, clean_output, gap_notes, swing_notes, time_notes
from discovery.recordings.recording_columns import (
    ARM_OUTPUTS,
    ARM_STEMS,
    arm_columns,
    declared_columns,
    declarer,
    listed,
    picked_rows,
    suggest,
    without_tip,
)
from discovery.recordings.unit_mistakes import check_units, near_hanging
from discovery.rigs.kinds import KINDS
from discovery.rigs.rig import ForceView, Rig

__all__ = ["Recording", "read_recording"]

FloatArray = npt.NDArray[np.float64]
#: Kinds that swing about a rest position where nothing drives them.
_SWINGING = ("oscillator", "pendulum")


@dataclass(frozen=True, repr=False)
class Recording(RecordingViews):
    """One measured manoeuvre, in SI units.

    Attributes
    ----------
    name : str
        Name for people: the one that the rig file gives, else the file's without its suffix.
    time : array, shape (n,)
        Sample times [s], strictly increasing, at any spacing.
    input : array, shape (n,), or None
        Motor angle of an arm [rad], input of another system, None for a free decay.
    output : array, shape (n, c)
        What the instrument read; NaN marks a gap.
    channels : tuple of str
        ``("tip_x", "tip_y")`` [m], ``("tip_angle",)`` [rad], ``("tip_deflection",)`` [m] or ``("output",)``.
    units : tuple of str
        SI unit of each channel.
    noise : array, shape (c,)
        Standard deviation of each channel, in its unit.
    sha256 : str
        Of the file's bytes.
    source : str
        The file, and the rows taken from it.
    noise_estimated : bool
        Whether `noise` was estimated from this recording because the rig does not state it.
    notes : tuple of str
        What is unusual: coarse readings, stuck or clipped ones (which are gaps of `output`), spikes, odd times.
    """

    name: str
    time: FloatArray
    input: FloatArray | None
    output: FloatArray
    channels: tuple[str, ...]
    units: tuple[str, ...]
    noise: FloatArray
    sha256: str
    source: str
    noise_estimated: bool = False
    notes: tuple[str, ...] = ()


def read_recording(
    path: str | os.PathLike[str],
    rig: Rig,
    samples: tuple[int, int] | None = None,
    with_output: bool = True,
    *,
    where: Sequence[tuple[str, str | float]] = (),
    name: str | None = None,
) -> Recording:
    """Read a recording, refuse what cannot be a measurement of this rig, and leave out what no sensor measured.

    Parameters
    ----------
    path : path
        Text, Parquet, MAT or HDF5, see `discovery.foundation.io.read_table`. The columns of an arm are ``time_s``,
        ``motor_angle_rad`` and ``tip_x_m``, ``tip_y_m`` (or ``tip_angle_rad``, or ``tip_deflection_m``), with any unit
        of the right kind as the suffix; those of other systems are declared in the rig file. Other columns are ignored.
    rig : Rig
        The system.
    samples : (int, int), optional
        Take only ``start <= i < stop`` of the rows that `where` leaves.
    with_output : bool
        False for a file that asks for a prediction: of times and inputs only. Columns of outputs are not looked at, and
        every output is NaN.
    where : sequence of (str, str or float)
        Take only the rows in which these columns have these values.
    name : str, optional
        Name of the recording; the file's by default.

    Returns
    -------
    Recording

    Raises
    ------
    InputError
        For a file that cannot be read, columns that are missing, given twice or in the wrong unit, cells that are no
        numbers, times that do not increase, gaps in the input, a dead sensor, too short a record, or values that are
        physically impossible; the message names file, column, row and remedy.
    """
    table = read_table(path, rig.columns.header)
    arm = rig.kind == "flexible_arm"
    table = table if with_output or not arm else without_tip(table)
    channels, names, units = arm_columns(table) if arm else declared_columns(table, rig)
    if with_output and not channels:
        wanted = "tip_x_m and tip_y_m, or tip_angle_rad, or tip_deflection_m" if arm else rig.columns.output.name
        remedy = f"add {wanted}"
        if not arm:
            remedy = f"{declarer(rig)} declares {wanted!r}; write its name in [columns] as the file has it"
        raise InputError(
            f"{table.path} has no output column: {remedy}.{suggest(table, wanted, names.values())} {listed(table)}"
        )
    counted = names
    if not with_output:
        channels, names = (), {stem: column for stem, column in names.items() if stem not in channels}
        # Of an output that is not looked at, its length may be the number of samples.
        counted = names or counted
    rows = picked_rows(table, counted, samples, where)[:: rig.columns.every]
    table = table.take(list(dict.fromkeys(counted.values())), rows)
    values = {stem: _in_si(table.numbers(column), rig, stem, units[stem]) for stem, column in names.items()}
    source = str(table.path) + _part(samples, where)
    time = values["time"] if "time" in values else _counted(rig, len(next(iter(table.columns.values()))))
    inputs = values.get("motor_angle" if arm else "input")
    shown = channels or (ARM_OUTPUTS[0] if arm else ("output",))
    read = {channel: values[channel] for channel in channels}
    told: list[str] = []
    if rig.kind == "pendulum" and rig.view is None and "output" in read:
        read["output"], told = near_hanging(read["output"], units["output"])
    check_signals(table, names, units=units, time=time, inputs=inputs, outputs=read, fewest=KINDS[rig.kind].fewest)
    if arm:
        check_arm(table, names, units=units, rig=rig, time=time, inputs=inputs, outputs=read)
        told = [] if inputs is None else bend_notes(inputs, read)
    elif read:
        check_units(table, rig, names, time, read["output"], inputs is not None)
    if inputs is not None and "added" in values and rig.controller is not None:
        # What is added to the command acts as a reference that is further off.
        inputs = inputs + values["added"] / (rig.controller.kv * rig.controller.kp)
    si = tuple(ARM_STEMS[channel] if arm else si_symbol(rig.columns.output.unit) for channel in shown)
    stated, noise, notes = _stated_noise(rig, shown), [], [*time_notes(time, rig.columns.time.assumed), *told]
    if inputs is None and read and rig.kind in _SWINGING:
        notes += swing_notes(names["output"], time, read["output"], _own_period(rig))
    for channel, known in zip(shown, stated, strict=True):
        if channel not in read:
            noise.append(1.0 if known is None else known)
            continue
        unit = units[channel]
        notes += gap_notes(names[channel], time, values[channel])
        # A noise of zero would give its samples infinite weight: fall back on the resolution of the readings.
        floor = resolution(read[channel])
        noise.append(max(estimate_noise(read[channel]) if known is None else known, floor))
        returns = rig.kind in (*_SWINGING, "base_excited") and rig.view is None
        read[channel], found = clean_output(names[channel], unit, time, read[channel], noise[-1], returns)
        notes += found if known is None else found + noise_note(names[channel], unit, time, read[channel], known)
    check_signals(table, names, units=units, time=time, inputs=inputs, outputs=read, fewest=KINDS[rig.kind].fewest)
    if rig.view is not None and inputs is not None:
        rate = sampling_rate(time, source)
        inputs = zero_phase(inputs, rate, rig.view.motion_cutoff)
        if read:
            read["output"] = _seen_as_force(rig.view, time, read["output"], rate, source)
            noise = [noise_gain(rate, rig.view.cutoff) * value for value in noise]
    return Recording(
        name=name or table.path.stem,
        time=time,
        input=inputs,
        output=np.column_stack([read.get(channel, np.full(time.size, np.nan)) for channel in shown]),
        channels=shown,
        units=si,
        noise=np.array(noise),
        sha256=table.sha256,
        source=source,
        noise_estimated=bool(channels) and any(known is None for known in stated),
        notes=tuple(notes),
    )


def _in_si(values: FloatArray, rig: Rig, stem: str, unit: str) -> FloatArray:
    column = {"input": rig.columns.input, "output": rig.columns.output}.get(stem)
    if column is not None and (column.zero, column.scale) != (0.0, 1.0):
        values = column.scale * (values - column.zero)
    return values * si_factor(unit)


def _own_period(rig: Rig) -> float | None:
    """Period of a small swing [s] by a pendulum's stated length; an extended body swings slower."""
    if rig.kind != "pendulum" or rig.length is None or rig.gravity is None:
        return None
    return float(2.0 * np.pi * np.sqrt(rig.length.value / rig.gravity.value))


def _counted(rig: Rig, size: int) -> FloatArray:
    rate = rig.columns.time.rate
    assert rate is not None  # read_rig demands a rate or a column
    return np.arange(size) * rig.columns.every / rate


def _part(samples: tuple[int, int] | None, where: Sequence[tuple[str, str | float]]) -> str:
    """Name the rows that were taken, in brackets."""
    words = [f"{column}={value}" for column, value in where] + ([f"{samples[0]}:{samples[1]}"] if samples else [])
    return f"[{', '.join(words)}]" if words else ""


def _seen_as_force(view: ForceView, time: FloatArray, force: FloatArray, rate: float, source: str) -> FloatArray:
    """Return the smoothed force with gaps between the samples to use."""
    if np.isnan(force).any():
        raise InputError(
            f"{source}: the force has gaps, so it cannot be low-passed as [view] asks. Take a part without gaps with "
            "samples = [start, stop]."
        )
    return np.where(force_samples(view, time, rate), zero_phase(force, rate, view.cutoff), np.nan)


def _stated_noise(rig: Rig, channels: Sequence[str]) -> list[float | None]:
    """Noise of each channel from the rig; the camera sees the tip's angle from about one arm's length."""
    if rig.kind != "flexible_arm":
        return [rig.columns.output.noise]
    if rig.position_noise is None:
        return [None] * len(channels)
    assert rig.length is not None  # read_rig demands it of an arm
    return [
        rig.position_noise / rig.length.value if channel == "tip_angle" else rig.position_noise for channel in channels
    ]
