"""A system in its own equations, from [system] of a rig file or from the ready-made ones beside this module."""

from __future__ import annotations

import keyword
import re
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from importlib import resources

from sympy import Symbol

from discovery.declarations import symbols
from discovery.declarations.formula import reserved_words
from discovery.declarations.registry import catalogue
from discovery.declarations.system import Constant, SystemDeclaration
from discovery.declarations.unit_suffixes import named_unit
from discovery.declarations.units import dimension, homogeneous, mistaken_for, si_factor, si_symbol
from discovery.foundation.errors import InputError, suggestion
from discovery.mechanics.declared_equations import Equations
from discovery.mechanics.systems import system_base
from discovery.rigs.kinds import KINDS
from discovery.rigs.rig import Columns
from discovery.rigs.rig_mistakes import RigText
from discovery.rigs.rig_schema import RigTable
from discovery.rigs.rig_signals import columns_of
from discovery.rigs.system_table import ConstantTable, SystemTable

_WORD = re.compile(r"[A-Za-z]\w*\Z", re.ASCII)
#: Names in the text of compiled programs, also with an underscore and more behind them.
_INTERNAL = (
    *("q", "qd", "qdd", *"DFGHILNQ", "r", "z", "slope", "part", "reading", "sum", "hermite", "cubic", "acceleration"),
    *("largest", "age", "drive", "parameters", "math", "np", "run"),
)
_Refuse = Callable[[str, str], InputError]
#: Names of the other signals of a recording.
_SIGNALS = ("time", "input", "output", "added")
_NEEDED = ("coordinates", "kinetic", "output", "places")


def ready_made() -> dict[str, SystemDeclaration]:
    """Return the ready-made systems by name, for Python; a rig file names one under ``like``."""
    return {n: _declaration(n, table, lambda key, why: InputError(f"{key}: {why}")) for n, table in _tables().items()}


@cache
def _tables() -> Mapping[str, SystemTable]:
    folder = resources.files("discovery.rigs").joinpath("systems")
    files = sorted((f for f in folder.iterdir() if f.name.endswith(".toml")), key=lambda f: f.name)
    return {
        f.name.removesuffix(".toml"): SystemTable.model_validate(tomllib.loads(f.read_text(encoding="utf-8"))["system"])
        for f in files
    }


def system_of(file: RigText, table: RigTable) -> SystemDeclaration | None:
    """Return the system that a rig file declares in its own equations; None where it names a kind.

    What is missing, a text that cannot be read, and units that do not fit are refused by file, line, key and remedy.
    """
    given = table.system
    if (given is not None) != KINDS[table.kind].has_own_equations:
        raise InputError(
            f"{file}: kind = 'system' and the table [system] belong together, and no other kind has one. "
            "Remove the key kind, or the table."
        )
    if given is None:
        return None
    refuse = _refusal(file)
    whole = _whole(given, refuse)
    for name in ("coordinates", "constants", "places", "input", "also"):
        for word in getattr(whole, name) or {}:
            if not _is_word(word):
                raise refuse(
                    f"{name}.{word}" if name != "input" else "input",
                    f"{word!r} cannot be a name. Use letters, digits and underscores, as in 'phi_l', and no function's "
                    "name.",
                )
    names, beginnings = taken_names()
    if taken := [w for w in whole.constants if len(w) < 2 or w in names or w.partition("_")[0] in beginnings]:
        others = f", and so {'is' if len(taken) == 2 else 'are'} {', '.join(map(repr, taken[1:]))}" if taken[1:] else ""
        raise refuse(
            f"constants.{taken[0]}",
            f"the name {taken[0]!r} is that of something else in a model{others}. Write a longer one, such as "
            f"'own_{taken[0]}'. docs/YOUR_SYSTEM.md lists the names that are taken.",
        )
    declaration = _declaration(table.name, whole, refuse)
    try:
        base = system_base(declaration)
    except InputError as error:
        where = re.match(r"key '([\w.]+)': ", str(error))
        raise refuse(where[1] if where else "", str(error)[where.end() if where else 0 :]) from error
    _check_columns(table, declaration, base.equations, refuse)
    return declaration


def read_columns(file: RigText, table: RigTable, declaration: SystemDeclaration) -> Columns:
    """Return the columns of a declared system, whose equations say what is read.

    Refused is what `discovery.rigs.rig_signals.columns_of` refuses, and an input without derivatives that are needed.
    """
    base, columns = system_base(declaration), columns_of(file, table)
    if base.input_moves and columns.input is not None and columns.input.interpolation in ("linear", "hold"):
        raise InputError(
            f"{file.at('columns', 'input')}: the equations need derivatives of this "
            'input, which it has none of between its samples. Set interpolation = "spline", or remove it.'
        )
    if base.order < 2:
        return columns
    return replace(columns, output=replace(columns.output, reads="acceleration"))


def _refusal(file: RigText) -> _Refuse:
    """Return what makes the refusal of a key of the table."""

    def refuse(key: str, why: str) -> InputError:
        where = file.at("system", *filter(None, key.split(".")))
        return InputError(f"{where}, {f'key {key!r}' if key else '[system]'}: {why}")

    return refuse


def own_constants(
    file: RigText, table: RigTable, role: str, given: Mapping[str, float]
) -> tuple[tuple[str, float], ...]:
    """Return the constants that a recording of one list of [records] has of its own, in SI units."""
    if not given:
        return ()
    declared = {} if table.system is None else _whole(table.system, _refusal(file)).constants
    stated = [n for n, c in declared.items() if c.value is not None and c.sd is None]
    if unknown := [name for name in given if name not in stated]:
        those = f"those are {', '.join(stated)}" if stated else "there is none"
        raise InputError(
            f"{file.at('records', role)}: the constant {unknown[0]!r} of one recording must have a `value` and no `sd` "
            f"in [system.constants], for the others: {those}. State it there, or remove it here."
        )
    own = {n: declared[n].model_copy(update={"value": value}) for n, value in given.items()}
    return tuple((n, _constant(c, f"constants.{n}", _refusal(file)).value) for n, c in own.items())


def _declaration(name: str, whole: SystemTable, refuse: _Refuse) -> SystemDeclaration:
    """Return what a complete table declares, in SI units."""
    return SystemDeclaration(
        name=name,
        coordinates={n: _unit(u, f"coordinates.{n}", refuse) for n, u in (whole.coordinates or {}).items()},
        constants={n: _constant(c, f"constants.{n}", refuse) for n, c in whole.constants.items()},
        kinetic=whole.kinetic or "0",
        potential=whole.potential or "0",
        dissipation=whole.dissipation or "0",
        forces=whole.forces or {},
        input=next(((n, _unit(u, "input", refuse)) for n, u in (whole.input or {}).items()), None),
        output=whole.output or "",
        places=whole.places or {},
        also=whole.also or {},
    )


def _whole(given: SystemTable, refuse: _Refuse) -> SystemTable:
    """Return a table with what it takes from a ready-made system; refuse one that lacks something."""
    if given.like is not None:
        known = _tables()
        if given.like not in known:
            hint = suggestion(given.like, known)
            raise refuse("like", f"there is no ready-made system {given.like!r}.{hint} There are {', '.join(known)}.")
        stated = given.model_dump(exclude_none=True, exclude={"like", "constants"})
        base = known[given.like]
        given = base.model_copy(update={**stated, "constants": {**base.constants, **given.constants}})
    for name in _NEEDED:
        if getattr(given, name) is None:
            made = ", ".join(_tables())
            raise refuse("", f"it lacks the key {name!r}. Add it, or take a ready-made system: like = one of {made}.")
    return given


def taken_names() -> tuple[frozenset[str], tuple[str, ...]]:
    """Return the names that no constant can have, and the beginnings of others, before an underscore."""
    laws = {p.name for effect in catalogue().values() for p in effect.parameters()}
    return frozenset(laws | {s.name for s in vars(symbols).values() if isinstance(s, Symbol)}), _INTERNAL


def _is_word(word: str) -> bool:
    """Return whether a word can be the name of something in a system."""
    return bool(_WORD.match(word)) and not (keyword.iskeyword(word) or word in reserved_words() or "_at_" in word)


def _unit(unit: str, key: str, refuse: _Refuse) -> str:
    """Return a unit of a coordinate or of the input, which must be an SI unit: the equations are in these."""
    try:
        if si_factor(unit) == 1.0:
            return si_symbol(unit)
    except InputError as error:
        raise refuse(key, str(error)) from error
    raise refuse(key, f"{unit!r} is no SI unit. Write {si_symbol(unit)!r}; the columns may be in any unit.")


def _constant(given: ConstantTable, key: str, refuse: _Refuse) -> Constant:
    try:
        factor, unit = si_factor(given.unit), named_unit(dimension(si_symbol(given.unit)))
    except InputError as error:
        raise refuse(key, str(error)) from error
    value = given.guess if given.value is None else given.value
    assert value is not None  # the table demands one of them
    return Constant(unit, value * factor, None if given.sd is None else given.sd * factor, given.guess is not None)


def _check_columns(table: RigTable, declaration: SystemDeclaration, equations: Equations, refuse: _Refuse) -> None:
    """Refuse columns that hold something else than input and output of the system, and what is read beside it."""
    columns = table.columns
    if columns is None:
        raise refuse("", "there is no table [columns]. Declare time, output, and the input if there is one.")
    if (columns.input is None) != (declaration.input is None):
        word = "lacks" if columns.input is None else "has"
        raise refuse("input", f"[columns] {word} an input, unlike the system. Declare it in both, or in neither.")
    read = columns.also
    if odd := next(iter({*read} ^ {*declaration.also}), None):
        word = "lacks" if odd in declaration.also else "has"
        raise refuse(f"also.{odd}", f"[columns.also] {word} it, unlike the system. Declare it in both, or in neither.")
    others = (*_SIGNALS, *declaration.constants, *(n for n in declaration.coordinates if declaration.also.get(n) != n))
    if taken := next((name for name in read if name in others), None):
        raise refuse(f"also.{taken}", f"{taken!r} is the name of something else that it does not read. Choose another.")
    pairs = [("output", columns.output.unit, equations.output_unit)]
    pairs += [(f"also.{name}", column.unit, equations.also[name][1]) for name, column in read.items()]
    if columns.input is not None and declaration.input is not None:
        pairs.append(("input", columns.input.unit, declaration.input[1]))
    for name, unit, wanted in pairs:
        if not homogeneous(si_symbol(unit), wanted):
            remedy = mistaken_for(unit) or " Correct the equation or the column."
            raise refuse(name, f"it is in {wanted}, and its column in {unit!r}.{remedy}")
