"""Rig files: TOML in, a `Rig` in SI units out.

The keys of physical quantities carry their unit as a suffix (``length_m``, ``tip_mass_g``); systems other than the
flexible arm declare their columns. Everything is converted to SI here, and every refusal names the file, the line, the
key and the remedy.
"""

from __future__ import annotations

import hashlib
import os
import tomllib
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from discovery.declarations.registry import get_effect
from discovery.declarations.system import SystemDeclaration
from discovery.foundation.arguments import as_path
from discovery.foundation.errors import InputError
from discovery.foundation.io import reason, shown
from discovery.mechanics import get_base
from discovery.mechanics.places import check_place
from discovery.mechanics.systems import declare
from discovery.rigs.kinds import KINDS
from discovery.rigs.quantities import QUANTITIES
from discovery.rigs.quantity_keys import check_kind, check_signals, quantities_of
from discovery.rigs.rig import Columns, Quantity, RecordPart, Rig
from discovery.rigs.rig_mistakes import explain, line_of
from discovery.rigs.rig_schema import RecordsTable, RigTable
from discovery.rigs.rig_signals import check_tables, columns_of, controller_of, view_of
from discovery.rigs.rig_system import read_columns, system_of
from discovery.rigs.unfilled import unfilled

__all__ = ["read_rig"]

# Standard gravity and its range between places at sea level and mountains, poles and equator.
_GRAVITY = Quantity(9.80665, 0.02)


def read_rig(path: str | os.PathLike[str]) -> Rig:
    """Read and check a rig file.

    Parameters
    ----------
    path : path
        TOML file. The files of its ``[records]`` are looked for beside it, then in the folders that the environment
        variable ``DISCOVERY_DATA`` names, separated as in ``PATH``: there, in the subfolder that is called like the
        folder of the rig file, and in any other.

    Returns
    -------
    Rig

    Raises
    ------
    InputError
        If the file is missing or no TOML, a key is unknown, missing or lacks its unit, a value is of the wrong kind or
        physically impossible, or several subfolders hold a file of ``[records]``.

    Examples
    --------
    >>> read_rig("datasets/spring_bench/rig.toml").declared
    ('viscous_damping', 'linear_stiffness')
    """
    path = as_path(path, "path", "Give the path of a rig file.")
    content, text, document = _parsed(path)
    rest, quantities, keys = quantities_of(path, text, document)
    table = _validated(path, text, rest)
    arm = KINDS[table.kind].has_rod
    if arm:
        _check_arm(path, quantities)
    check_tables(path, text, table)
    check_kind(path, text, table, keys)
    system = system_of(path, text, table)
    _check_effects(path, text, table, KINDS[table.kind].base if system is None else declare(system))
    values = {stem: quantity.value for stem, quantity in quantities.items()}
    return Rig(
        name=table.name,
        kind=table.kind,
        length=quantities.get("length"),
        tip_mass=quantities.get("tip_mass"),
        beam_mass=quantities.get("beam_mass"),
        flexural_rigidity=quantities.get("flexural_rigidity"),
        mass=quantities.get("mass"),
        inertia=quantities.get("inertia"),
        position_noise=values.get("position_noise"),
        angle_noise=values.get("angle_noise"),
        columns=_columns(path, text, table, system, keys),
        declared=tuple(table.model.effects) if table.model else KINDS[table.kind].declared,
        records=_records(path, text, table.records),
        gravity=quantities.get("gravity", _GRAVITY if table.kind in QUANTITIES["gravity"].kinds else None),
        controller=controller_of(path, text, table),
        view=view_of(path, text, table),
        system=system,
        motor_angle_limit=values.get("motor_angle_limit"),
        motor_speed_limit=values.get("motor_speed_limit"),
        motor_acceleration_limit=values.get("motor_acceleration_limit"),
        deflection_limit=values.get("deflection_limit"),
        path=path,
        sha256=hashlib.sha256(content).hexdigest(),
        unfilled=unfilled(text),
    )


def _check_arm(path: Path, quantities: Mapping[str, Quantity]) -> None:
    if "length" not in quantities:
        raise InputError(f"The rig file {path} lacks the key 'length_m', the length of the arm. Add it.")
    length, noise = quantities["length"].value, quantities.get("position_noise")
    if noise is not None and noise.value > 0.1 * length:
        raise InputError(
            f"The rig file {path} states a position noise of {noise.value:g} m on an arm of {length:g} m. "
            "If it is in millimetres, name the key 'position_noise_mm'."
        )


def _parsed(path: Path) -> tuple[bytes, str, dict[str, Any]]:
    """Return a rig file's bytes, its text and its document."""
    try:
        content = path.read_bytes()
    except (OSError, ValueError) as error:  # a name may hold what no file's name can
        raise InputError(
            f"The rig file {shown(path)} cannot be read: {reason(error)}. Give the path of a TOML file."
        ) from error
    try:
        text = content.decode("utf-8-sig")
        document = tomllib.loads(text)
    except RecursionError as error:
        raise InputError(f"The rig file {path} nests its values too deeply. Write them as the examples do.") from error
    except ValueError as error:  # no TOML, no text, or a number of thousands of digits
        raise InputError(f"The rig file {path} is not valid TOML: {error}. Correct that line.") from error
    return content, text, document


def _validated(path: Path, text: str, rest: dict[str, Any]) -> RigTable:
    if isinstance(rest.get("system"), dict):
        rest.setdefault("kind", "system")
    try:
        return RigTable.model_validate(rest)
    except ValidationError as error:
        raise InputError(explain(path, text, error)) from error


def _columns(
    path: Path, text: str, table: RigTable, system: SystemDeclaration | None, keys: Mapping[str, str]
) -> Columns:
    columns = columns_of(path, text, table) if system is None else read_columns(path, text, table, system)
    check_signals(path, text, table, columns, keys)
    return columns


def _check_effects(path: Path, text: str, table: RigTable, base: str) -> None:
    named = table.model.effects if table.model else []
    where = f"The rig file {path}, line {line_of(text, ('model', 'effects'))}, key 'model.effects':"
    system = get_base(base).system
    for effect in named:
        try:
            systems = get_effect(effect).systems
        except InputError as error:
            raise InputError(f"{where} {error}") from error
        if system not in systems:
            raise InputError(
                f"{where} {effect!r} acts on {' and '.join(sorted(systems))}, not on kind {table.kind!r}. Remove it; "
                f"`discovery effects {effect}` shows what it is."
            )
        try:
            check_place(get_base(base), get_effect(effect))
        except InputError as error:
            raise InputError(f"{where} {error}") from error
        if named.count(effect) > 1:
            raise InputError(f"{where} {effect!r} is named twice. Name each effect once.")


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
    from discovery_datasets.registry import data_folders, registered

    beside = path.parent / file
    folders = data_folders()
    if not folders or Path(file).is_absolute() or os.path.exists(beside):
        return beside
    own = path.resolve().parent.name
    near = [place / file for folder in folders for place in (folder, folder / own)]
    found = [place for place in near if os.path.exists(place)][:1]
    if not found and registered(beside) is None:  # another set may have a file of that name
        found = _in_subfolders(folders, file)
    if len({place.parent.name for place in found}) > 1:
        raise InputError(
            f"The rig file {path} names {file!r}, which is in {' and in '.join(str(p.parent) for p in found)}. Name it "
            "with its folder."
        )
    # The name may be no file's at all; then it is refused where the recording is read.
    return found[0] if found else beside


def _in_subfolders(folders: Sequence[Path], file: str) -> list[Path]:
    """Return the files of that name in the subfolders."""
    found = []
    for folder in folders:
        with suppress(OSError):
            places = sorted(place for place in folder.iterdir() if place.is_dir())
            found += [place / file for place in places if os.path.exists(place / file)]
    return found
