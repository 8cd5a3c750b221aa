"""Rig files: TOML in, a `Rig` in SI units out.

The keys of physical quantities carry their unit as a suffix (``length_m``, ``tip_mass_g``); systems other than the
flexible arm declare their columns. Everything is converted to SI here, and every refusal names the file, the line, the
key and the remedy.
"""

from __future__ import annotations

import hashlib
import os
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from discovery.errors import InputError
from discovery.rig import (
    ARM_COLUMNS,
    LINEAR_MODEL,
    PAPER_MODEL,
    Columns,
    InputColumn,
    OutputColumn,
    Quantity,
    RecordPart,
    Rig,
    TimeColumn,
)
from discovery.rig_schema import QUANTITIES, ColumnsTable, QuantityTable, RecordsTable, RigTable, explain, line_of
from discovery.units import si_factor, split_suffix

__all__ = ["read_rig"]


def read_rig(path: str | os.PathLike[str]) -> Rig:
    """Read and check a rig file.

    Parameters
    ----------
    path : path
        TOML file. The files of its ``[records]`` are looked for beside it, then in the folder that the environment
        variable ``DISCOVERY_DATA`` names and in that folder's subfolders.

    Returns
    -------
    Rig

    Raises
    ------
    InputError
        If the file is missing or no TOML, a key is unknown, missing or lacks its unit, or a value is of the wrong kind
        or physically impossible.
    """
    path = Path(path)
    try:
        content = path.read_bytes()
    except OSError as error:
        raise InputError(
            f"The rig file {path} cannot be read: {error.strerror}. Give the path of a TOML file."
        ) from error
    try:
        text = content.decode("utf-8")
        document = tomllib.loads(text)
    except (UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise InputError(f"The rig file {path} is not valid TOML: {error}. Correct that line.") from error
    rest, quantities = _quantities(path, text, document)
    try:
        table = RigTable.model_validate(rest)
    except ValidationError as error:
        raise InputError(explain(path, text, error)) from error
    arm = table.kind == "flexible_arm"
    if arm and "length" not in quantities:
        raise InputError(f"The rig file {path} lacks the key 'length_m', the length of the arm. Add it.")
    if arm and table.columns is not None:
        raise InputError(
            f"The rig file {path}, line {line_of(text, ('columns',))}, declares [columns], but those of an arm are "
            'fixed (time_s, motor_angle_rad, tip_x_m, tip_y_m). Remove the table, or set kind = "oscillator".'
        )
    if not arm and table.columns is None:
        raise InputError(
            f"The rig file {path} describes an oscillator but has no table [columns]. Declare time and output."
        )
    values = {stem: quantity.value for stem, quantity in quantities.items()}
    if arm and values.get("position_noise", 0.0) > 0.1 * values["length"]:
        raise InputError(
            f"The rig file {path} states a position noise of {values['position_noise']:g} m on an arm of "
            f"{values['length']:g} m. If it is in millimetres, name the key 'position_noise_mm'."
        )
    return Rig(
        name=table.name,
        kind=table.kind,
        length=quantities.get("length"),
        tip_mass=quantities.get("tip_mass"),
        beam_mass=quantities.get("beam_mass"),
        flexural_rigidity=quantities.get("flexural_rigidity"),
        position_noise=values.get("position_noise"),
        angle_noise=values.get("angle_noise"),
        columns=ARM_COLUMNS if table.columns is None else _columns(path, text, table.columns),
        declared=tuple(table.model.effects) if table.model else (PAPER_MODEL if arm else LINEAR_MODEL),
        records=_records(path, text, table.records),
        path=path,
        sha256=hashlib.sha256(content).hexdigest(),
    )


def _quantities(path: Path, text: str, document: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Quantity]]:
    """Take the keys with a unit out of the document, in SI units."""
    rest: dict[str, Any] = {}
    quantities: dict[str, Quantity] = {}
    for key, value in document.items():
        split = split_suffix(key, QUANTITIES)
        if split is None:
            rest[key] = value
            continue
        stem, unit = split
        expected, relative, absolute, largest = QUANTITIES[stem]
        where = f"The rig file {path}, line {line_of(text, (key,))}:"
        if not unit:
            suffix = expected.replace(" ", "_").replace("^", "")
            raise InputError(f"{where} the key {key!r} lacks its unit. Write it as a suffix, '{stem}_{suffix}'.")
        if stem in quantities:
            raise InputError(f"{where} the key {key!r} gives {stem} a second time. Keep one of them.")
        try:
            factor = si_factor(unit, expected)
            given = QuantityTable.model_validate(value if isinstance(value, dict) else {"value": value})
        except InputError as error:
            raise InputError(f"{where} key {key!r}: {error}") from error
        except ValidationError as error:
            raise InputError(explain(path, text, error, (key,))) from error
        si = given.value * factor
        if si > largest:
            raise InputError(
                f"{where} {key!r} is {si:g} {expected}, which is not plausible. Give it in {expected}, or change the "
                "suffix of the key to the unit that the number is in."
            )
        quantities[stem] = Quantity(si, relative * si + absolute if given.sd is None else given.sd * factor)
    return rest, quantities


def _columns(path: Path, text: str, table: ColumnsTable) -> Columns:
    def factor(column: str, unit: str, expected: str | None = None) -> float:
        try:
            return si_factor(unit, expected)
        except InputError as error:
            line = line_of(text, ("columns", column, "unit"))
            raise InputError(f"The rig file {path}, line {line}, column {column!r}: {error}") from error

    if (table.time.rate_hz is None) == (table.time.name is None):
        raise InputError(
            f"The rig file {path}, line {line_of(text, ('columns', 'time'))}: the time needs either a rate, "
            'time = { rate_hz = 100.0 }, or a column, time = { name = "t", unit = "ms" }.'
        )
    factor("time", table.time.unit, "s")
    noise = table.output.noise
    scale = factor("output", table.output.unit)
    if table.input is not None:
        factor("input", table.input.unit)
    return Columns(
        time=TimeColumn(table.time.name, table.time.unit, table.time.rate_hz),
        input=InputColumn(**table.input.model_dump()) if table.input else None,
        output=OutputColumn(table.output.name, table.output.unit, None if noise is None else noise * scale),
    )


def _records(path: Path, text: str, table: RecordsTable) -> dict[str, tuple[RecordPart, ...]]:
    records: dict[str, tuple[RecordPart, ...]] = {}
    for name, parts in (("train", table.train), ("holdout", table.holdout)):
        for part in parts:
            if part.samples and part.samples[0] >= part.samples[1]:
                raise InputError(
                    f"The rig file {path}, line {line_of(text, ('records', name))}: samples = {part.samples} of "
                    f"{part.file!r} is empty. Give [start, stop] with start < stop, as in a Python slice."
                )
        if parts:
            records[name] = tuple(
                RecordPart(_find(path, part.file), (part.samples[0], part.samples[1]) if part.samples else None)
                for part in parts
            )
    return records


def _find(path: Path, file: str) -> Path:
    beside = path.parent / file
    if beside.exists() or not (folder := os.environ.get("DISCOVERY_DATA")):
        return beside
    data = Path(folder)
    found = [data / file, *sorted(data.glob(f"*/{file}"))] if not Path(file).is_absolute() else []
    return next((candidate for candidate in found if candidate.exists()), beside)
