"""How a mistake in a rig file is explained: its line, its key and the remedy."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

from pydantic import BaseModel, ValidationError

from discovery.foundation.errors import suggestion
from discovery.rigs.quantities import QUANTITIES, key_of
from discovery.rigs.rig_schema import AlsoTable, QuantityTable, RecordsTable, RigTable
from discovery.rigs.system_table import ConstantTable

if TYPE_CHECKING:
    from pydantic_core import ErrorDetails

_MARKED = re.compile(r"(?:\s*(?P<key>[\w.]+)\s*=[^#]*#.*?|\s*#\s*)\bFILL IN:?\s*(?P<what>[^;]*)")


def explain(file: RigText, error: ValidationError, outer: tuple[str, ...] = (), *, bare: bool = False) -> str:
    """Return one paragraph from pydantic's first complaint, on a key that is not known before one that is missing.

    `outer` are the keys around what was validated; `bare` says that the innermost of them has the value itself.
    """
    found = [(outer if bare else (*outer, *_keys(d, file.text, outer)), d) for d in error.errors()]
    keys, detail = next(((k, d) for k, d in found if d["type"] == "extra_forbidden"), found[0])
    name = ".".join(keys)
    # A key that may hold either of two types complains of both.
    others = len({(k, d["loc"][: len(k) + sum(isinstance(p, int) for p in d["loc"])]) for k, d in found}) - 1
    more = f" ({others} more after this one.)" if others else ""
    if detail["type"] == "missing":
        where = f"{file.at(*keys[:-1])}," if len(keys) > 1 else file
        return f"{where} lacks the key {name!r}. Add it.{more}"
    where = f"{file.at(*keys)}:"
    if detail["type"] == "extra_forbidden":
        return f"{where} the key {name!r} is not known.{_known_instead(keys, detail['input'])}{more}"
    value = detail["input"]
    if detail["type"] == "literal_error" and isinstance(value, str):
        known = re.findall("'([^']*)'", detail["ctx"]["expected"])
        return (
            f"{where} the key {name!r} is {value!r}, which is not known.{suggestion(value, known)} Known here: "
            f"{', '.join(known)}.{more}"
        )
    return f"{where} the key {name!r} is {value!r}, but {_demand(detail, keys)}. Correct the value.{more}"


def _keys(detail: ErrorDetails, text: str, outer: tuple[str, ...]) -> tuple[str, ...]:
    """Return the keys of a complaint, without the type of a value that may be of several."""
    keys = tuple(part for part in detail["loc"] if isinstance(part, str))
    if detail["type"] == "missing":
        return keys
    place: Any = tomllib.loads(text)
    for key in outer:
        place = place.get(key)
    known = []
    for part in detail["loc"]:
        try:
            place = place[part]
        except (KeyError, IndexError, TypeError):
            break
        if isinstance(part, str):
            known.append(part)
    return tuple(known) or keys


#: What is demanded of a value, by pydantic's name of the complaint.
_DEMANDS = {
    "model_type": "it must be a table, { key = value }",
    "dict_type": "it must be a table, { key = value }",
    "list_type": "it must be a list, [ ... ]",
    "string_type": "it must be a text in quotes",
    "string_too_short": "it must not be empty",
    "float_type": "it must be a number",
    "int_type": "it must be a whole number",
    "bool_type": "it must be true or false",
    "string_pattern_mismatch": "it may hold letters, digits and _ . + - alone",
    "finite_number": "it must be a finite number",
}


def _demand(detail: ErrorDetails, keys: Sequence[str]) -> str:
    """Return what is demanded of a value."""
    if detail["type"] == "model_type" and keys[-1] in RecordsTable.model_fields:
        return 'each recording must be a table, { file = "a.csv" }'
    if detail["type"] in ("too_short", "too_long"):
        few, many = (detail["ctx"].get(key) for key in ("min_length", "max_length"))
        return f"it must have at {f'least {few}' if many is None else f'most {many}'} entries"
    message = _DEMANDS.get(detail["type"]) or detail["msg"].removeprefix("Value error, ").rstrip(".")
    message = message.replace("Input should", "it must").replace("String should", "it must")
    return f"it {message}" if message.startswith(("must", "needs")) else message


def _tables(table: type[BaseModel]) -> dict[str, type[BaseModel]]:
    """Return the table that holds the keys below each key of a table, and below those."""
    found = {name: held for name, field in table.model_fields.items() for held in _held(field.annotation)}
    return {**found, **{name: held for inner in found.values() for name, held in _tables(inner).items()}}


def _held(annotation: Any) -> list[type[BaseModel]]:
    """Return the tables of which a value may be one."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [held for part in get_args(annotation) for held in _held(part)]


def _known_instead(keys: Sequence[str], value: object) -> str:
    """Return what is known where a key is not."""
    if len(keys) > 1:
        # Tables of the user's own names.
        named: dict[tuple[str, str], type[BaseModel]] = {
            ("system", "constants"): ConstantTable,
            ("columns", "also"): AlsoTable,
        }
        own = named.get((keys[0], keys[1])) if len(keys) > 2 else None
        parent = own or _tables(RigTable).get(keys[-2], QuantityTable)
        known = list(parent.model_fields)
        return f"{suggestion(keys[-1], known)} Known here: {', '.join(known)}."
    stem = next((stem for stem in QUANTITIES if keys[0].startswith(stem)), None)
    if stem is not None:
        right = key_of(stem)
        return (
            f" Write {right} = 1.0, or with its standard deviation {right} = {{ value = 1.0, sd = 0.01 }}; any unit of "
            "that kind may be the suffix."
        )
    known = [*RigTable.model_fields, *(key_of(stem) for stem in QUANTITIES)]
    hint = suggestion(keys[0], known)
    if value in get_args(RigTable.model_fields["kind"].annotation):
        hint = f' Did you mean kind = "{value}"?'
    return f"{hint} Known here: {', '.join(known)}."


@dataclass(frozen=True)
class RigText:
    """Path and text of a rig file; as a string it is the beginning of a message.

    Examples
    --------
    >>> file = RigText(Path("rig.toml"), "mass = 1.0   # FILL IN what you weigh; a guess")
    >>> file.at("mass"), file.unfilled
    ('The rig file rig.toml, line 1', ('line 1, mass: what you weigh',))
    """

    path: Path
    text: str

    def __str__(self) -> str:
        return f"The rig file {self.path}"

    def at(self, *keys: str) -> str:
        """Name the file and the line of the innermost of nested keys that can be found, else the line ``?``."""
        lines = self.text.splitlines()
        position, found = 0, 0
        for key in keys:
            pattern = re.compile(
                rf"(?:\A\s*\[+\s*(?:\w+\.)*|\A\s*|[{{,.]\s*)[\"']?{re.escape(key)}[\"']?\s*(?:=|\]|\.)"
            )
            for number in range(position, len(lines)):
                if pattern.search(lines[number].split("#", 1)[0]):
                    position, found = number, number + 1
                    break
        return f"{self}, line {found or '?'}"

    @property
    def unfilled(self) -> tuple[str, ...]:
        """What is marked with FILL IN: its line, key, and what is to be written there."""
        lines = ((number, _MARKED.match(line)) for number, line in enumerate(self.text.splitlines(), 1))
        return tuple(f"line {number}{_words(marked)}" for number, marked in lines if marked)


def _words(marked: re.Match[str]) -> str:
    what = marked["what"].strip()
    return (f", {marked['key']}" if marked["key"] else "") + (f": {what}" if what else "")
