"""What a rig file may hold: its tables and quantities, and how a mistake in them is explained."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, ValidationError

from discovery.errors import suggestion

__all__ = [
    "QUANTITIES",
    "ColumnsTable",
    "QuantityTable",
    "RecordsTable",
    "RigTable",
    "explain",
    "line_of",
]

QUANTITIES: Mapping[str, tuple[str, float, float, float]] = {
    "length": ("m", 0.0, 1e-3, 30.0),
    "tip_mass": ("kg", 0.005, 0.0, 1000.0),
    "beam_mass": ("kg", 0.02, 0.0, 1000.0),
    "flexural_rigidity": ("N m^2", 0.05, 0.0, 1e7),
    "position_noise": ("m", 0.0, 0.0, 0.1),
    "angle_noise": ("rad", 0.0, 0.0, 0.2),
}
"""By stem of the key: unit, relative and absolute sd where the file states none, largest plausible value."""


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


_Positive = Annotated[FiniteFloat, Field(gt=0)]
_Text = Annotated[str, Field(min_length=1)]


class QuantityTable(_Table):
    """A positive number, with or without its standard deviation."""

    value: _Positive
    sd: Annotated[FiniteFloat, Field(ge=0)] | None = None


class _Time(_Table):
    rate_hz: _Positive | None = None
    name: _Text | None = None
    unit: _Text = "s"


class _Input(_Table):
    name: _Text
    unit: _Text
    interpolation: Literal["band_limited", "spline", "linear", "hold"] = "spline"


class _Output(_Table):
    name: _Text
    unit: _Text
    noise: _Positive | None = None


class ColumnsTable(_Table):
    """The table ``[columns]`` of an oscillator."""

    time: _Time
    input: _Input | None = None
    output: _Output


class _Model(_Table):
    effects: Annotated[list[_Text], Field(min_length=1)]


class _Part(_Table):
    file: _Text
    samples: Annotated[list[Annotated[int, Field(ge=0)]], Field(min_length=2, max_length=2)] | None = None


class RecordsTable(_Table):
    """The table ``[records]``."""

    train: list[_Part] = []
    holdout: list[_Part] = []


class RigTable(_Table):
    """The whole file, without the keys that carry a unit."""

    name: _Text
    kind: Literal["flexible_arm", "oscillator"] = "flexible_arm"
    columns: ColumnsTable | None = None
    model: _Model | None = None
    records: RecordsTable = RecordsTable()


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


def explain(path: Path, text: str, error: ValidationError, outer: tuple[str, ...] = ()) -> str:
    """Return one paragraph from pydantic's first complaint; `outer` are the keys around what was validated."""
    detail = error.errors()[0]
    keys = (*outer, *(str(part) for part in detail["loc"] if isinstance(part, str)))
    name = ".".join(keys)
    more = f" ({error.error_count() - 1} more after this one.)" if error.error_count() > 1 else ""
    if detail["type"] == "missing":
        where = f", line {line_of(text, keys[:-1])}," if len(keys) > 1 else ""
        return f"The rig file {path}{where} lacks the key {name!r}. Add it.{more}"
    where = f"The rig file {path}, line {line_of(text, keys)}:"
    if detail["type"] == "extra_forbidden":
        tables: dict[str, type[_Table]] = {"columns": ColumnsTable, "time": _Time, "input": _Input, "output": _Output}
        tables |= {"model": _Model, "records": RecordsTable, "train": _Part, "holdout": _Part}
        parent = tables.get(keys[-2], QuantityTable) if len(keys) > 1 else RigTable
        known = list(parent.model_fields)
        if parent is RigTable:
            units = {stem: unit[0].replace(" ", "_").replace("^", "") for stem, unit in QUANTITIES.items()}
            known += [f"{stem}_{unit}" for stem, unit in units.items()]
        return (
            f"{where} the key {name!r} is not known.{suggestion(keys[-1], known)} Known here: {', '.join(known)}.{more}"
        )
    value = detail["input"]
    return f"{where} the key {name!r} is {value!r}, but {_lower(detail['msg'])}. Correct the value.{more}"


def _lower(message: str) -> str:
    return message[:1].lower() + message[1:].rstrip(".")
