"""What a rig file may hold: its tables and quantities, and how a mistake in them is explained."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Literal, get_args

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, FiniteFloat, ValidationError

from discovery.foundation.errors import suggestion
from discovery.rigs.system_table import ConstantTable, SystemTable

__all__ = [
    "MEANT_FOR",
    "QUANTITIES",
    "ColumnsTable",
    "ControllerTable",
    "QuantityTable",
    "RecordsTable",
    "RigTable",
    "ViewTable",
    "explain",
    "key_of",
    "line_of",
]

QUANTITIES: Mapping[str, tuple[str, float, float, float]] = {
    "gravity": ("m s^-2", 0.0, 0.02, 30.0),
    "length": ("m", 0.0, 1e-3, 30.0),
    "tip_mass": ("kg", 0.005, 0.0, 1000.0),
    "beam_mass": ("kg", 0.02, 0.0, 1000.0),
    "flexural_rigidity": ("N m^2", 0.05, 0.0, 1e7),
    "mass": ("kg", 0.005, 0.0, 1e6),
    "inertia": ("kg m^2", 0.02, 0.0, 1e6),
    "position_noise": ("m", 0.0, 0.0, 0.1),
    "angle_noise": ("rad", 0.0, 0.0, 0.2),
    "motor_angle_limit": ("rad", 0.0, 0.0, 15.0),
    "motor_speed_limit": ("rad / s", 0.0, 0.0, 100.0),
    "motor_acceleration_limit": ("rad / s^2", 0.0, 0.0, 1e4),
    "deflection_limit": ("rad", 0.0, 0.0, 3.0),
}
"""By stem of the key: unit, relative and absolute sd where the file states none, largest plausible value."""

MEANT_FOR: Mapping[str, tuple[str, ...]] = {
    "gravity": ("pendulum", "falling_body"),
    "length": ("flexible_arm", "pendulum"),
    "tip_mass": ("flexible_arm",),
    "beam_mass": ("flexible_arm",),
    "flexural_rigidity": ("flexible_arm",),
    "mass": ("oscillator", "base_excited", "drive", "falling_body"),
    "inertia": ("oscillator", "pendulum", "base_excited", "drive"),
    "position_noise": ("flexible_arm",),
    "angle_noise": ("flexible_arm",),
    "motor_angle_limit": ("flexible_arm",),
    "motor_speed_limit": ("flexible_arm",),
    "motor_acceleration_limit": ("flexible_arm",),
    "deflection_limit": ("flexible_arm",),
}
"""By stem of the key: the kinds of system in which it means something."""


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


_Positive = Annotated[FiniteFloat, Field(gt=0)]
_Text = Annotated[str, Field(min_length=1)]


def _no_control(value: str) -> str:
    # They break the files and pages that the name is written to.
    if any(unicodedata.category(letter) in ("Cc", "Cs") for letter in value):
        raise ValueError("must not hold control characters")
    return value


_Name = Annotated[_Text, AfterValidator(_no_control)]


def _not_zero(value: float) -> float:
    if value == 0.0:
        raise ValueError("must not be zero")
    return value


_Scale = Annotated[FiniteFloat, AfterValidator(_not_zero)]


class QuantityTable(_Table):
    """A positive number, with or without its standard deviation."""

    value: _Positive
    sd: Annotated[FiniteFloat, Field(ge=0)] | None = None


class _Time(_Table):
    rate_hz: _Positive | None = None
    name: _Text | None = None
    unit: _Text = "s"
    assumed: bool = False
    jitter: Annotated[FiniteFloat, Field(ge=0)] | None = None


class _Input(_Table):
    name: _Text
    unit: _Text
    interpolation: Literal["band_limited", "spline", "linear", "hold", "motion", "auto"] | None = None
    zero: FiniteFloat = 0.0
    scale: _Scale = 1.0


class _Output(_Table):
    name: _Text
    unit: _Text
    noise: _Positive | Literal["estimate"] | None = None
    reads: Literal["position", "acceleration"] = "position"
    zero: FiniteFloat = 0.0
    scale: _Scale = 1.0


class ColumnsTable(_Table):
    """The table ``[columns]`` of a system other than an arm."""

    header: Annotated[list[_Text], Field(min_length=1)] | None = None
    time: _Time
    input: _Input | None = None
    output: _Output
    every: Annotated[int, Field(ge=1)] = 1


class ControllerTable(_Table):
    """The table ``[controller]`` of a drive that was recorded in closed loop."""

    kp: _Positive
    kv: _Positive
    limit: _Positive | None = None
    unit: _Text = "1"
    added: _Text | None = None


class ViewTable(_Table):
    """The table ``[view]``."""

    output: Literal["force"]
    motion_cutoff_hz: _Positive
    cutoff_hz: _Positive
    decimation: Annotated[int, Field(ge=1)] | None = None


class _Model(_Table):
    effects: list[_Text]


class _Part(_Table):
    file: _Text
    samples: Annotated[list[Annotated[int, Field(ge=0)]], Field(min_length=2, max_length=2)] | None = None
    where: dict[str, str | FiniteFloat] = {}
    name: Annotated[str, Field(pattern=r"^[\w.+-]+$")] | None = None


class RecordsTable(_Table):
    """The table ``[records]``."""

    train: list[_Part] = []
    holdout: list[_Part] = []
    test: list[_Part] = []


class RigTable(_Table):
    """The whole file, without the keys that carry a unit."""

    name: _Name
    kind: Literal["flexible_arm", "oscillator", "pendulum", "base_excited", "drive", "falling_body", "system"] = (
        "flexible_arm"
    )
    system: SystemTable | None = None
    columns: ColumnsTable | None = None
    controller: ControllerTable | None = None
    view: ViewTable | None = None
    model: _Model | None = None
    records: RecordsTable = RecordsTable()


def key_of(stem: str) -> str:
    """Return the key of a quantity in its SI unit: ``"length"`` gives ``"length_m"``."""
    unit = QUANTITIES[stem][0].replace(" ", "_").replace("/", "per").replace("^", "").replace("-", "")
    return f"{stem}_{unit}"


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
    "time": _Time,
    "input": _Input,
    "output": _Output,
    "model": _Model,
    "controller": ControllerTable,
    "view": ViewTable,
    "records": RecordsTable,
    "system": SystemTable,
    "train": _Part,
    "holdout": _Part,
    "test": _Part,
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
