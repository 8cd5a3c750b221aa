"""Quantities read from a rig file, and refused where nothing would come of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import ValidationError

from discovery.declarations.unit_suffixes import split_suffix
from discovery.declarations.units import known_dimension, si_factor, si_symbol
from discovery.foundation.errors import InputError
from discovery.rigs.kinds import KINDS
from discovery.rigs.quantities import QUANTITIES, key_of
from discovery.rigs.rig import Columns, Quantity
from discovery.rigs.rig_mistakes import RigText, explain
from discovery.rigs.rig_schema import QuantityTable, RigTable


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


def check_signals(file: RigText, table: RigTable, columns: Columns, keys: Mapping[str, str]) -> None:
    """Refuse quantities that do not go with what the columns read."""
    _check_inertia(file, columns.output.unit, keys)
    moved = None if KINDS[table.kind].has_rod or columns.input is None else columns.input.unit
    if moved is not None and "angle_noise" in keys and known_dimension(si_symbol(moved)) != {}:
        raise InputError(
            f"{file.at(keys['angle_noise'])}: the key {keys['angle_noise']!r} is "
            f"the error of an angle, and the input is in {moved!r}. Remove it: the error of the input is estimated."
        )


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
