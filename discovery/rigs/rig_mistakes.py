"""How a mistake in a rig file is explained: its line, its key and the remedy."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import get_args

from pydantic import BaseModel, ValidationError

from discovery.foundation.errors import suggestion
from discovery.rigs.quantities import QUANTITIES, key_of
from discovery.rigs.rig_schema import (
    ColumnsTable,
    ControllerTable,
    InputTable,
    ModelTable,
    OutputTable,
    PartTable,
    QuantityTable,
    RecordsTable,
    RigTable,
    TimeTable,
    ViewTable,
)
from discovery.rigs.system_table import ConstantTable, SystemTable

__all__ = ["explain", "line_of"]


def line_of(text: str, keys: Sequence[str]) -> int | str:
    """Line of the innermost of nested keys that can be found in the text, else ``?``."""
    lines = text.splitlines()
    position, found = 0, 0
    for key in keys:
        pattern = re.compile(rf"(?:\A\s*\[+\s*(?:\w+\.)*|\A\s*|[{{,.]\s*)[\"']?{re.escape(key)}[\"']?\s*(?:=|\]|\.)")
        for number in range(position, len(lines)):
            if pattern.search(lines[number].split("#", 1)[0]):
                position, found = number, number + 1
                break
    return found or "?"


def explain(path: Path, text: str, error: ValidationError, outer: tuple[str, ...] = (), *, bare: bool = False) -> str:
    """Return one paragraph from pydantic's first complaint, on a key that is not known before one that is missing.

    `outer` are the keys around what was validated; `bare` says that the innermost of them has the value itself.
    """
    detail = next((d for d in error.errors() if d["type"] == "extra_forbidden"), error.errors()[0])
    keys = outer if bare else (*outer, *(str(part) for part in detail["loc"] if isinstance(part, str)))
    name = ".".join(keys)
    more = f" ({error.error_count() - 1} more after this one.)" if error.error_count() > 1 else ""
    if detail["type"] == "missing":
        where = f", line {line_of(text, keys[:-1])}," if len(keys) > 1 else ""
        return f"The rig file {path}{where} lacks the key {name!r}. Add it.{more}"
    where = f"The rig file {path}, line {line_of(text, keys)}:"
    if detail["type"] == "extra_forbidden":
        return f"{where} the key {name!r} is not known.{_known_instead(keys, detail['input'])}{more}"
    value = detail["input"]
    if detail["type"] == "literal_error" and isinstance(value, str):
        known = re.findall("'([^']*)'", detail["ctx"]["expected"])
        return (
            f"{where} the key {name!r} is {value!r}, which is not known.{suggestion(value, known)} Known here: "
            f"{', '.join(known)}.{more}"
        )
    return f"{where} the key {name!r} is {value!r}, but {_lower(detail['msg'])}. Correct the value.{more}"


#: The table that holds the keys below each key.
_TABLES: dict[str, type[BaseModel]] = {
    "columns": ColumnsTable,
    "time": TimeTable,
    "input": InputTable,
    "output": OutputTable,
    "model": ModelTable,
    "controller": ControllerTable,
    "view": ViewTable,
    "records": RecordsTable,
    "system": SystemTable,
    "train": PartTable,
    "holdout": PartTable,
    "test": PartTable,
}


def _known_instead(keys: Sequence[str], value: object) -> str:
    """Return what is known where a key is not."""
    if len(keys) > 1:
        constant = keys[:2] == ("system", "constants")
        parent = ConstantTable if constant and len(keys) > 2 else _TABLES.get(keys[-2], QuantityTable)
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


def _lower(message: str) -> str:
    return message[:1].lower() + message[1:].rstrip(".")
