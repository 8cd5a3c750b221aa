"""The signals of a recording's file: the columns and rows that the rig names, in SI units."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NoReturn

import numpy as np

from discovery.declarations.unit_suffixes import split_suffix
from discovery.declarations.units import si_factor
from discovery.foundation.arguments import as_path, check_whole
from discovery.foundation.arrays import FloatArray, IntArray
from discovery.foundation.errors import InputError, suggestion
from discovery.foundation.io import Table, read_table
from discovery.rigs.rig import Rig

ARM_STEMS = {"time": "s", "motor_angle": "rad", "tip_x": "m", "tip_y": "m", "tip_angle": "rad", "tip_deflection": "m"}
ARM_OUTPUTS = (("tip_x", "tip_y"), ("tip_angle",), ("tip_deflection",))


def judged_channels(channels: Sequence[str]) -> slice:
    """Return which channels are the output, of which errors are told: the first, and both of a tip's position."""
    return slice(2 if tuple(channels) == ARM_OUTPUTS[0] else 1)


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
    added: FloatArray | None = None
    rows: IntArray | None = None  # see `Recording`

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
        scale = rig.columns.time.scale
        read = {s: table.times(c, units[s], scale) if s == "time" else table.numbers(c) for s, c in names.items()}
        values = {stem: _in_si(numbers, rig, stem, units[stem]) for stem, numbers in read.items()}
        return cls(
            table,
            names,
            units=units,
            channels=channels or (ARM_OUTPUTS[0] if arm else tuple(rig.columns.read)),
            time=_times(values.get("time"), rig, len(next(iter(table.columns.values())))),
            inputs=values.get("motor_angle" if arm else "input"),
            outputs={channel: values[channel] for channel in channels},
            source=str(table.path) + _part(samples, where),
            added=values.get("added"),
        )

    @property
    def given(self) -> str:
        """The signal that is the input."""
        return "motor_angle" if "motor_angle" in self.names else "input"

    def keep(self, rows: IntArray) -> None:
        """Leave out all rows but some, and know which of those that were taken they are."""
        taken = np.arange(self.time.size + 1) if self.rows is None else self.rows
        self.rows = np.append(taken[rows], taken[-1])
        self.table = self.table.take(list(self.table.columns), rows)
        self.time = self.time[rows]
        self.inputs = None if self.inputs is None else self.inputs[rows]
        self.added = None if self.added is None else self.added[rows]
        self.outputs = {channel: values[rows] for channel, values in self.outputs.items()}

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
    raise InputError(f"{table.path} has no output column: {remedy}.{_instead(table, wanted, names.values())}")


def _in_si(values: FloatArray, rig: Rig, stem: str, unit: str) -> FloatArray:
    column = {"input": rig.columns.input, **rig.columns.read}.get(stem)
    if column is not None and (column.zero, column.scale) != (0.0, 1.0):
        values = column.scale * (values - column.zero)
    return values * si_factor(unit)


def _times(stamps: FloatArray | None, rig: Rig, size: int) -> FloatArray:
    """Return the times of rows: their stamps, or so many at the rate of a file that has none."""
    if stamps is not None:
        return stamps - rig.columns.time.zero
    rate = rig.columns.time.rate
    assert rate is not None  # read_rig demands a rate or a column
    return np.arange(size) * rig.columns.every / rate


def _part(samples: tuple[int, int] | None, where: Sequence[tuple[str, str | float]]) -> str:
    """Name the rows that were taken, in brackets."""
    words = [f"{column}={value}" for column, value in where] + ([f"{samples[0]}:{samples[1]}"] if samples else [])
    return f"[{', '.join(words)}]" if words else ""


def arm_columns(table: Table) -> tuple[tuple[str, ...], dict[str, str], dict[str, str]]:
    """Channels, and the column and the unit of each stem, by the names of an arm recording.

    A column that is missing, given twice, or lacks its unit or has a wrong one is refused.
    """
    names: dict[str, str] = {}
    units: dict[str, str] = {}
    for name in table.columns:
        split = split_suffix(name, ARM_STEMS)
        if split is None:
            continue
        stem, unit = split
        if not unit:
            raise InputError(
                f"{table.path}: the column {name!r} lacks its unit. Write it as a suffix, '{name}_{ARM_STEMS[stem]}'."
            )
        if stem in names:
            raise InputError(f"{table.path}: {stem} is given twice, as {names[stem]!r} and {name!r}. Keep one of them.")
        try:
            si_factor(unit, ARM_STEMS[stem])
        except InputError as error:
            raise InputError(f"{table.path}, column {name!r}: {error}") from error
        names[stem], units[stem] = name, unit
    for stem in ("time", "motor_angle"):
        if stem not in names:
            wanted = f"{stem}_{ARM_STEMS[stem]}"
            raise InputError(
                f"{table.path} has no column {wanted!r}. Give that column this name, in its own unit."
                f"{_instead(table, wanted, names.values())}"
            )
    channels = next((channels for channels in ARM_OUTPUTS if all(channel in names for channel in channels)), ())
    for first, second in (("tip_x", "tip_y"), ("tip_y", "tip_x")):
        if not channels and first in names:
            wanted = f"{second}_m"
            raise InputError(
                f"{table.path} has {names[first]!r} but no column {wanted!r}: the tip needs both."
                f"{_instead(table, wanted, names.values())}"
            )
    used = ("time", "motor_angle", *channels)
    return channels, {stem: names[stem] for stem in used}, units


def declared_columns(table: Table, rig: Rig) -> tuple[tuple[str, ...], dict[str, str], dict[str, str]]:
    """Channels, and column and unit of each signal, as the rig file declares them; time and input are needed."""
    columns = rig.columns
    wanted = [("time", columns.time.name, columns.time.unit)] if columns.time.name and columns.time.rate is None else []
    if columns.input is not None:
        wanted.append(("input", columns.input.name, columns.input.unit))
    present = columns.output.name in table.columns
    if present:
        wanted += [(channel, column.name, column.unit) for channel, column in columns.read.items()]
    for _, name, _ in wanted:
        if name not in table.columns:
            others = [columns.output.name, *(str(other) for _, other, _ in wanted)]
            raise InputError(
                f"{table.path} has no column {name!r}, which {declarer(rig)} declares. Write its name in [columns] as "
                f"the file has it.{_instead(table, str(name), others)}"
            )
    controller = rig.controller
    if controller is not None and controller.added is not None and controller.added in table.columns:
        wanted.append(("added", controller.added, controller.unit))
    channels = tuple(columns.read) if present else ()
    names = {stem: str(name) for stem, name, _ in wanted}
    stems: dict[str, str] = {}
    for stem, name in names.items():
        if name in stems:
            raise InputError(
                f"{table.path}: {stems[name]} and {stem} are both read from the column {name!r}. Write the column of "
                "each in [columns] of the rig file."
            )
        stems[name] = stem
    return channels, names, {stem: unit for stem, _, unit in wanted}


def without_tip(table: Table) -> Table:
    """Return a table without an arm's columns of outputs: what asks for a prediction may be a whole recording."""

    def is_output(name: str) -> bool:
        split = split_suffix(name, ARM_STEMS)
        return split is not None and any(split[0] in channels for channels in ARM_OUTPUTS)

    return replace(table, columns={name: cells for name, cells in table.columns.items() if not is_output(name)})


def check_part(samples: Any, where: Any) -> None:
    """Refuse what names no rows: `samples` is the first row and the one after the last, `where` columns with values."""
    if samples is not None:
        if not isinstance(samples, Sequence) or isinstance(samples, str) or len(samples) != 2:
            raise InputError(f"`samples` is a pair, the first sample and the one after the last, not {samples!r:.60}.")
        for number in samples:
            check_whole(number, "samples")
    pairs = where if isinstance(where, Sequence) and not isinstance(where, str) else [where]
    if any(isinstance(pair, str) or not isinstance(pair, Sequence) or len(pair) != 2 for pair in pairs):
        raise InputError(f'`where` is a list of columns and values, as in [("trial", 2)], but it is {where!r:.60}.')


def picked_rows(
    table: Table, names: dict[str, str], samples: tuple[int, int] | None, where: Sequence[tuple[str, str | float]]
) -> IntArray:
    """Rows in which columns, of one length, have given values, and of these a part; there must be some."""
    sizes = {name: table.columns[name].size for name in (*names.values(), *(n for n, _ in where if n in table.columns))}
    if not names:
        raise InputError(f"{table.path} has neither a time nor an input column, so the number of samples is not known.")
    if len(set(sizes.values())) > 1:
        listed = ", ".join(f"{name!r} {size}" for name, size in sizes.items())
        raise InputError(f"{table.path}: the columns differ in length ({listed}). Export them with the same samples.")
    rows = table.matching(where) if where else np.arange(next(iter(sizes.values())))
    if samples is None:
        return rows
    if not 0 <= samples[0] < samples[1] <= rows.size:
        raise InputError(
            f"{table.path} has {rows.size} samples{' of this kind' if where else ''}, so "
            f"[{samples[0]}, {samples[1]}] is not a part of it. Give the first sample, counted from 0, "
            f"and the one after the last, at most {rows.size}."
        )
    return rows[slice(*samples)]


def _instead(table: Table, wanted: str, used: Iterable[str]) -> str:
    """Suggest a column for one that is missing, but none that is used as another signal, and list those of the file."""
    listed = ", ".join(str(name) for name in table.columns)[:300]
    return f"{suggestion(wanted, [name for name in table.columns if name not in set(used)])} Columns found: {listed}."


def declarer(rig: Rig) -> str:
    """Name the rig file, by its path where there is one."""
    return "the rig file" if rig.path is None else f"the rig file {rig.path}"
