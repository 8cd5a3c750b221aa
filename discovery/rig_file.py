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
from discovery.kinds import KINDS
from discovery.registry import get_effect
from discovery.rig import Quantity, RecordPart, Rig
from discovery.rig_schema import QUANTITIES, QuantityTable, RecordsTable, RigTable, explain, key_of, line_of
from discovery.rig_signals import check_tables, columns_of, controller_of, view_of
from discovery.units import si_factor, split_suffix

__all__ = ["read_rig"]

# Standard gravity and its range between places at sea level and mountains, poles and equator.
_GRAVITY = Quantity(9.80665, 0.02)


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
    check_tables(path, text, table)
    _check_effects(path, text, table)
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
        columns=columns_of(path, text, table),
        declared=tuple(table.model.effects) if table.model else KINDS[table.kind].declared,
        records=_records(path, text, table.records),
        gravity=quantities.get("gravity", _GRAVITY if table.kind in ("pendulum", "falling_body") else None),
        controller=controller_of(path, text, table),
        view=view_of(path, text, table),
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
            raise InputError(f"{where} the key {key!r} lacks its unit. Write it as a suffix, {key_of(stem)!r}.")
        if key == key_of(stem):  # a bare key has no sign for the negative power of an acceleration
            unit = expected
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


def _check_effects(path: Path, text: str, table: RigTable) -> None:
    for effect in table.model.effects if table.model else ():
        try:
            get_effect(effect)
        except InputError as error:
            line = line_of(text, ("model", "effects"))
            raise InputError(f"The rig file {path}, line {line}, key 'model.effects': {error}") from error


def _records(path: Path, text: str, table: RecordsTable) -> dict[str, tuple[RecordPart, ...]]:
    records: dict[str, tuple[RecordPart, ...]] = {}
    for name, parts in (("train", table.train), ("holdout", table.holdout), ("test", table.test)):
        for part in parts:
            if part.samples and part.samples[0] >= part.samples[1]:
                raise InputError(
                    f"The rig file {path}, line {line_of(text, ('records', name))}: samples = {part.samples} of "
                    f"{part.file!r} is empty. Give [start, stop] with start < stop, as in a Python slice."
                )
        if parts:
            records[name] = tuple(
                RecordPart(
                    _find(path, part.file),
                    (part.samples[0], part.samples[1]) if part.samples else None,
                    tuple(part.where.items()),
                    part.name,
                )
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
