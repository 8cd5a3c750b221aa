"""The signals of a recording's file: the columns that the rig names, in SI units."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NoReturn

import numpy as np

from discovery.declarations.units import si_factor
from discovery.foundation.arguments import as_path
from discovery.foundation.arrays import FloatArray
from discovery.foundation.errors import InputError
from discovery.foundation.io import Table, read_table
from discovery.recordings.recording_columns import (
    ARM_OUTPUTS,
    arm_columns,
    check_part,
    declared_columns,
    declarer,
    listed,
    picked_rows,
    suggest,
    without_tip,
)
from discovery.rigs.rig import Rig


@dataclass
class Signals:
    """The signals of one file in SI units, as far as they are made ready; `channels` also where nothing was read."""

    table: Table
    names: dict[str, str]
    units: dict[str, str]
    channels: tuple[str, ...]
    time: FloatArray
    inputs: FloatArray | None
    outputs: dict[str, FloatArray]
    source: str
    as_read: dict[str, FloatArray]
    added: FloatArray | None = None

    @classmethod
    def read(
        cls,
        path: str | os.PathLike[str],
        rig: Rig,
        samples: tuple[int, int] | None,
        with_output: bool,
        where: Sequence[tuple[str, str | float]],
    ) -> Signals:
        """Read the columns that the rig names, of the rows that are asked for."""
        check_part(samples, where)
        table = read_table(as_path(path, "path", "Give the path of a recording."), rig.columns.header)
        arm = rig.traits.has_rod
        table = table if with_output or not arm else without_tip(table)
        channels, names, units = arm_columns(table) if arm else declared_columns(table, rig)
        if with_output and not channels:
            _refuse_no_output(table, rig, names)
        counted = names
        if not with_output:
            channels, names = (), {stem: column for stem, column in names.items() if stem not in channels}
            # Of an output that is not looked at, its length may be the number of samples.
            counted = names or counted
        rows = picked_rows(table, counted, samples, where)[:: rig.columns.every]
        table = table.take(list(dict.fromkeys(counted.values())), rows)
        values = {stem: _in_si(table.numbers(column), rig, stem, units[stem]) for stem, column in names.items()}
        return cls(
            table,
            names,
            units=units,
            channels=channels or (ARM_OUTPUTS[0] if arm else ("output",)),
            time=values["time"] if "time" in values else _counted(rig, len(next(iter(table.columns.values())))),
            inputs=values.get("motor_angle" if arm else "input"),
            outputs={channel: values[channel] for channel in channels},
            source=str(table.path) + _part(samples, where),
            as_read={channel: values[channel] for channel in channels},
            added=values.get("added"),
        )

    @property
    def given(self) -> str:
        """The signal that is the input."""
        return "motor_angle" if "motor_angle" in self.names else "input"

    def at(self, *signals: str, row: int | None = None) -> str:
        """Name the file, the columns of some signals, and a row of them, for the beginning of a message."""
        columns = [repr(self.names.get(signal, signal)) for signal in signals]
        where = "" if row is None else f", {self.table.where(row)}"
        return f"{self.table.path}, column{'s' if len(columns) > 1 else ''} {' and '.join(columns)}{where}"


def _refuse_no_output(table: Table, rig: Rig, names: Mapping[str, str]) -> NoReturn:
    wanted, remedy = "tip_x_m and tip_y_m, or tip_angle_rad, or tip_deflection_m", ""
    if rig.traits.has_rod:
        remedy = f"add {wanted}"
    else:
        wanted = rig.columns.output.name
        remedy = f"{declarer(rig)} declares {wanted!r}; write its name in [columns] as the file has it"
    raise InputError(
        f"{table.path} has no output column: {remedy}.{suggest(table, wanted, names.values())} {listed(table)}"
    )


def _in_si(values: FloatArray, rig: Rig, stem: str, unit: str) -> FloatArray:
    column = {"input": rig.columns.input, "output": rig.columns.output}.get(stem)
    if column is not None and (column.zero, column.scale) != (0.0, 1.0):
        values = column.scale * (values - column.zero)
    return values * si_factor(unit)


def _counted(rig: Rig, size: int) -> FloatArray:
    rate = rig.columns.time.rate
    assert rate is not None  # read_rig demands a rate or a column
    return np.arange(size) * rig.columns.every / rate


def _part(samples: tuple[int, int] | None, where: Sequence[tuple[str, str | float]]) -> str:
    """Name the rows that were taken, in brackets."""
    words = [f"{column}={value}" for column, value in where] + ([f"{samples[0]}:{samples[1]}"] if samples else [])
    return f"[{', '.join(words)}]" if words else ""
