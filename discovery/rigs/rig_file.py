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
from discovery.declarations.unit_suffixes import split_suffix
from discovery.declarations.units import known_dimension, si_factor, si_symbol
from discovery.foundation.arguments import as_path
from discovery.foundation.errors import InputError
from discovery.foundation.io import reason, shown
from discovery.mechanics import get_base
from discovery.mechanics.systems import check_place, declare
from discovery.rigs.kinds import KINDS
from discovery.rigs.quantities import QUANTITIES, key_of
from discovery.rigs.rig import Columns, Quantity, RecordPart, Rig
from discovery.rigs.rig_mistakes import RigText, explain
from discovery.rigs.rig_schema import QuantityTable, RigTable
from discovery.rigs.rig_signals import check_tables, columns_of, controller_of, view_of
from discovery.rigs.rig_system import own_constants, read_columns, system_of

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
    file, sha256, document = _parsed(path)
    rest, quantities, keys = quantities_of(file, document)
    table = _validated(file, rest)
    if KINDS[table.kind].has_rod:
        _check_arm(file, quantities)
    check_tables(file, table)
    check_kind(file, table, keys)
    system = system_of(file, table)
    _check_effects(file, table, KINDS[table.kind].base if system is None else declare(system))
    if table.kind in QUANTITIES["gravity"].kinds:
        quantities.setdefault("gravity", _GRAVITY)
    stated: dict[str, Any] = {n: q if QUANTITIES[n].has_sd else q.value for n, q in quantities.items()}
    return Rig(
        name=table.name,
        kind=table.kind,
        columns=_columns(file, table, system, keys),
        declared=tuple(table.model.effects) if table.model else KINDS[table.kind].declared,
        records=_records(file, table),
        controller=controller_of(file, table),
        view=view_of(file, table),
        system=system,
        path=path,
        sha256=sha256,
        unfilled=file.unfilled,
        **stated,
    )


def _check_arm(file: RigText, quantities: Mapping[str, Quantity]) -> None:
    if "length" not in quantities:
        raise InputError(f"{file} lacks the key 'length_m', the length of the arm. Add it.")
    length, noise = quantities["length"].value, quantities.get("position_noise")
    if noise is not None and noise.value > 0.1 * length:
        raise InputError(
            f"{file} states a position noise of {noise.value:g} m on an arm of {length:g} m. "
            "If it is in millimetres, name the key 'position_noise_mm'."
        )


def _parsed(path: Path) -> tuple[RigText, str, dict[str, Any]]:
    """Return a rig file's text, the hash of its bytes and its document."""
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
    return RigText(path, text), hashlib.sha256(content).hexdigest(), document


def _validated(file: RigText, rest: dict[str, Any]) -> RigTable:
    if isinstance(rest.get("system"), dict):
        rest.setdefault("kind", "system")
    try:
        return RigTable.model_validate(rest)
    except ValidationError as error:
        raise InputError(explain(file, error)) from error


def _check_effects(file: RigText, table: RigTable, base: str) -> None:
    named = table.model.effects if table.model else []
    where = f"{file.at('model', 'effects')}, key 'model.effects':"
    system = get_base(base).system
    for effect in named:
        try:
            systems = get_effect(effect).systems
            if system in systems:
                check_place(get_base(base), get_effect(effect))
        except InputError as error:
            raise InputError(f"{where} {error}") from error
        if system not in systems:
            raise InputError(
                f"{where} {effect!r} acts on {' and '.join(sorted(systems))}, not on kind {table.kind!r}. Remove it; "
                f"`discovery effects {effect}` shows what it is."
            )
        if named.count(effect) > 1:
            raise InputError(f"{where} {effect!r} is named twice. Name each effect once.")


def _records(file: RigText, whole: RigTable) -> dict[str, tuple[RecordPart, ...]]:
    table = whole.records
    records: dict[str, tuple[RecordPart, ...]] = {}
    for name, parts in (("train", table.train), ("holdout", table.holdout), ("test", table.test)):
        for part in parts:
            if part.samples and part.samples[0] >= part.samples[1]:
                raise InputError(
                    f"{file.at('records', name)}: samples = {part.samples} of "
                    f"{part.file!r} is empty. Give [start, stop] with start < stop, as in a Python slice."
                )
        if parts:
            records[name] = tuple(
                RecordPart(
                    _find(file.path, part.file),
                    (part.samples[0], part.samples[1]) if part.samples else None,
                    tuple(part.where.items()),
                    part.name,
                    part.at_rest,
                    own_constants(file, whole, name, part.constants),
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


def quantities_of(
    file: RigText, document: Mapping[str, Any]
) -> tuple[dict[str, Any], dict[str, Quantity], dict[str, str]]:
    """Take the keys with a unit out of the document: return the rest, and quantities in SI units and keys by stem."""
    rest: dict[str, Any] = {}
    quantities: dict[str, Quantity] = {}
    keys: dict[str, str] = {}
    for key, value in document.items():
        split = split_suffix(key, QUANTITIES)
        if split is None:
            rest[key] = value
            continue
        stem, unit = split
        where = f"{file.at(key)}:"
        if not unit:
            raise InputError(f"{where} the key {key!r} lacks its unit. Write it as a suffix, {key_of(stem)!r}.")
        if key == key_of(stem):  # a bare key has no sign for the negative power of an acceleration
            unit = QUANTITIES[stem].unit
        if stem in quantities:
            raise InputError(f"{where} the key {key!r} gives {stem} a second time. Keep one of them.")
        quantities[stem] = _quantity(file, key, stem, unit, value)
        keys[stem] = key
    return rest, quantities, keys


def _quantity(file: RigText, key: str, stem: str, unit: str, value: Any) -> Quantity:
    """Return the number of a key in SI units, with its standard deviation."""
    known = QUANTITIES[stem]
    where = f"{file.at(key)}:"
    try:
        factor = si_factor(unit, known.unit)
        given = QuantityTable.model_validate(value if isinstance(value, dict) else {"value": value})
    except InputError as error:
        raise InputError(f"{where} key {key!r}: {error} In SI units the key is {key_of(stem)!r}.") from error
    except ValidationError as error:
        raise InputError(explain(file, error, (key,), bare=not isinstance(value, dict))) from error
    si = given.value * factor
    if si > known.largest:
        same = "" if factor == 1.0 else f"{given.value:g} {unit}, that is "
        raise InputError(
            f"{where} {key!r} is {same}{si:g} {known.unit}, which is not plausible. Give it in {known.unit}, or "
            "change the suffix of the key to the unit that the number is in."
        )
    if given.sd is not None and not known.has_sd:
        raise InputError(f"{where} {key!r} has an sd, which nothing uses. Write {key} = {given.value:g}.")
    return Quantity(si, known.usual_sd(si) if given.sd is None else given.sd * factor)


def check_kind(file: RigText, table: RigTable, keys: Mapping[str, str]) -> None:
    """Refuse quantities of another kind of system: nothing would come of them."""
    given = table.columns.input if table.columns else None
    # The error of an encoder says how much its motion is smoothed, on whatever kind of system.
    smoothed = given is not None and (given.interpolation or KINDS[table.kind].interpolation) == "motion"
    for stem, key in keys.items():
        if table.kind in QUANTITIES[stem].kinds or (stem == "angle_noise" and smoothed):
            continue
        noise = "State the noise of a reading as noise = ... of the output in [columns]: remove"
        raise InputError(
            f"{file.at(key)}: the key {key!r} belongs to "
            f"{' or '.join(QUANTITIES[stem].kinds)}; kind {table.kind!r} has no use for it. "
            f"{noise if stem.endswith('_noise') else 'Remove'} it, make it a comment, or correct the kind."
        )


def _columns(file: RigText, table: RigTable, system: SystemDeclaration | None, keys: Mapping[str, str]) -> Columns:
    """Return the columns; refuse quantities that do not go with what they read."""
    columns = columns_of(file, table) if system is None else read_columns(file, table, system)
    _check_inertia(file, columns.output.unit, keys)
    moved = None if KINDS[table.kind].has_rod or columns.input is None else columns.input.unit
    if moved is not None and "angle_noise" in keys and known_dimension(si_symbol(moved)) != {}:
        raise InputError(
            f"{file.at(keys['angle_noise'])}: the key {keys['angle_noise']!r} is "
            f"the error of an angle, and the input is in {moved!r}. Remove it: the error of the input is estimated."
        )
    return columns


def _check_inertia(file: RigText, output: str, keys: Mapping[str, str]) -> None:
    """Refuse a mass of what turns, and a moment of inertia of what does not."""
    turns = known_dimension(si_symbol(output)) == {}
    for stem, other in (("mass", "inertia"), ("inertia", "mass")):
        if stem in keys and turns == (stem == "mass"):
            moves = "turns: its output is an angle" if turns else "does not turn: its output is no angle"
            raise InputError(
                f"{file.at(keys[stem])}: the key {keys[stem]!r} gives no force "
                f"on what {moves}. State {key_of(other)!r} instead, or remove it."
            )
