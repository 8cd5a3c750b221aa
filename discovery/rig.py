"""Rig files: what the experimenter knows about the system before any recording is opened.

A rig file is TOML. The keys of physical quantities carry their unit as a suffix (``length_m``, ``tip_mass_g``); systems
other than the flexible arm declare their columns. Everything is converted to SI here, and every refusal names the file,
the line, the key and the remedy.
"""

from __future__ import annotations

import difflib
import hashlib
import os
import re
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, ValidationError

from discovery.errors import InputError
from discovery.units import si_factor, split_suffix

__all__ = ["Columns", "InputColumn", "OutputColumn", "Quantity", "RecordPart", "Rig", "TimeColumn", "read_rig"]

PAPER_MODEL = ("viscous_damping", "linear_stiffness", "cubic_stiffness", "radius_law")
LINEAR_MODEL = ("viscous_damping", "linear_stiffness")

# stem of the key: (unit, relative sd, absolute sd, largest plausible value); the sds hold where the file states none
_QUANTITIES: Mapping[str, tuple[str, float, float, float]] = {
    "length": ("m", 0.0, 1e-3, 30.0),
    "tip_mass": ("kg", 0.005, 0.0, 1000.0),
    "beam_mass": ("kg", 0.02, 0.0, 1000.0),
    "flexural_rigidity": ("N m^2", 0.05, 0.0, 1e7),
    "position_noise": ("m", 0.0, 0.0, 0.1),
    "angle_noise": ("rad", 0.0, 0.0, 0.2),
}


@dataclass(frozen=True)
class Quantity:
    """A number of the rig with its standard deviation, both in SI units."""

    value: float
    sd: float


@dataclass(frozen=True)
class TimeColumn:
    """Where the time comes from: a column of the file, or a sampling rate [Hz] where the file has none."""

    name: str | None = "time"
    unit: str = "s"
    rate: float | None = None


@dataclass(frozen=True)
class InputColumn:
    """The measured input, and how it runs between the samples.

    ``interpolation`` is ``"band_limited"``, ``"spline"``, ``"linear"``, ``"hold"``, or ``"motion"``, which only the
    encoder of a flexible arm has: smoothed.
    """

    name: str
    unit: str
    interpolation: str


@dataclass(frozen=True)
class OutputColumn:
    """The measured output; ``noise`` is its standard deviation in SI units, None if it must be estimated."""

    name: str
    unit: str
    noise: float | None = None


@dataclass(frozen=True)
class Columns:
    """The columns of a recording."""

    time: TimeColumn
    input: InputColumn | None
    output: OutputColumn


@dataclass(frozen=True)
class RecordPart:
    """A file, or the samples ``start <= i < stop`` of it, as a Python slice."""

    file: Path
    samples: tuple[int, int] | None = None


ARM_COLUMNS = Columns(TimeColumn(), InputColumn("motor_angle", "rad", "motion"), OutputColumn("tip", "m"))


@dataclass(frozen=True)
class Rig:
    """A measured system as its rig file describes it, in SI units.

    Attributes
    ----------
    name : str
    kind : str
        ``"flexible_arm"`` or ``"oscillator"``.
    length, tip_mass, beam_mass, flexural_rigidity : Quantity or None
        Of the arm: m, kg, kg, N m^2.
    position_noise : float or None
        Standard deviation of the camera per axis [m].
    angle_noise : float or None
        Half width of the encoder's uniform error [rad].
    columns : Columns
        What the recordings of this rig contain.
    declared : tuple of str
        Effect ids of the model that the experimenter declares.
    records : mapping of str to tuple of RecordPart
        Named recordings, ``"train"`` and ``"holdout"``; empty if the file names none.
    path : Path or None
        The rig file.
    sha256 : str
        Of the rig file's bytes.
    """

    name: str
    kind: str = "flexible_arm"
    length: Quantity | None = None
    tip_mass: Quantity | None = None
    beam_mass: Quantity | None = None
    flexural_rigidity: Quantity | None = None
    position_noise: float | None = None
    angle_noise: float | None = None
    columns: Columns = ARM_COLUMNS
    declared: tuple[str, ...] = PAPER_MODEL
    records: Mapping[str, tuple[RecordPart, ...]] = field(default_factory=dict)
    path: Path | None = None
    sha256: str = ""


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


_Positive = Annotated[FiniteFloat, Field(gt=0)]
_Text = Annotated[str, Field(min_length=1)]


class _Quantity(_Table):
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


class _Columns(_Table):
    time: _Time
    input: _Input | None = None
    output: _Output


class _Model(_Table):
    effects: Annotated[list[_Text], Field(min_length=1)]


class _Part(_Table):
    file: _Text
    samples: Annotated[list[Annotated[int, Field(ge=0)]], Field(min_length=2, max_length=2)] | None = None


class _Records(_Table):
    train: list[_Part] = []
    holdout: list[_Part] = []


class _Rig(_Table):
    name: _Text
    kind: Literal["flexible_arm", "oscillator"] = "flexible_arm"
    columns: _Columns | None = None
    model: _Model | None = None
    records: _Records = _Records()


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
        table = _Rig.model_validate(rest)
    except ValidationError as error:
        raise InputError(_explain(path, text, error)) from error
    arm = table.kind == "flexible_arm"
    if arm and "length" not in quantities:
        raise InputError(f"The rig file {path} lacks the key 'length_m', the length of the arm. Add it.")
    if arm and table.columns is not None:
        raise InputError(
            f"The rig file {path}, line {_line(text, ('columns',))}, declares [columns], but those of an arm are "
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
        split = split_suffix(key, _QUANTITIES)
        if split is None:
            rest[key] = value
            continue
        stem, unit = split
        expected, relative, absolute, largest = _QUANTITIES[stem]
        where = f"The rig file {path}, line {_line(text, (key,))}:"
        if not unit:
            suffix = expected.replace(" ", "_").replace("^", "")
            raise InputError(f"{where} the key {key!r} lacks its unit. Write it as a suffix, '{stem}_{suffix}'.")
        if stem in quantities:
            raise InputError(f"{where} the key {key!r} gives {stem} a second time. Keep one of them.")
        try:
            factor = si_factor(unit, expected)
            given = _Quantity.model_validate(value if isinstance(value, dict) else {"value": value})
        except InputError as error:
            raise InputError(f"{where} key {key!r}: {error}") from error
        except ValidationError as error:
            raise InputError(_explain(path, text, error, (key,))) from error
        si = given.value * factor
        if si > largest:
            raise InputError(
                f"{where} {key!r} is {si:g} {expected}, which is not plausible. Give it in {expected}, or change the "
                "suffix of the key to the unit that the number is in."
            )
        quantities[stem] = Quantity(si, relative * si + absolute if given.sd is None else given.sd * factor)
    return rest, quantities


def _columns(path: Path, text: str, table: _Columns) -> Columns:
    def factor(column: str, unit: str, expected: str | None = None) -> float:
        try:
            return si_factor(unit, expected)
        except InputError as error:
            line = _line(text, ("columns", column, "unit"))
            raise InputError(f"The rig file {path}, line {line}, column {column!r}: {error}") from error

    if (table.time.rate_hz is None) == (table.time.name is None):
        raise InputError(
            f"The rig file {path}, line {_line(text, ('columns', 'time'))}: the time needs either a rate, "
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


def _records(path: Path, text: str, table: _Records) -> dict[str, tuple[RecordPart, ...]]:
    records: dict[str, tuple[RecordPart, ...]] = {}
    for name, parts in (("train", table.train), ("holdout", table.holdout)):
        for part in parts:
            if part.samples and part.samples[0] >= part.samples[1]:
                raise InputError(
                    f"The rig file {path}, line {_line(text, ('records', name))}: samples = {part.samples} of "
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


def _line(text: str, keys: Sequence[str]) -> int | str:
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


def suggestion(word: str, known: Iterable[str]) -> str:
    """Say "Did you mean ...?" where a known word is close to the one that was given, else nothing."""
    close = difflib.get_close_matches(word, list(known), n=1, cutoff=0.6)
    return f" Did you mean {close[0]!r}?" if close else ""


def _explain(path: Path, text: str, error: ValidationError, outer: tuple[str, ...] = ()) -> str:
    """One paragraph from pydantic's first complaint."""
    detail = error.errors()[0]
    keys = (*outer, *(str(part) for part in detail["loc"] if isinstance(part, str)))
    name = ".".join(keys)
    more = f" ({error.error_count() - 1} more after this one.)" if error.error_count() > 1 else ""
    if detail["type"] == "missing":
        where = f", line {_line(text, keys[:-1])}," if len(keys) > 1 else ""
        return f"The rig file {path}{where} lacks the key {name!r}. Add it.{more}"
    where = f"The rig file {path}, line {_line(text, keys)}:"
    if detail["type"] == "extra_forbidden":
        tables: dict[str, type[_Table]] = {"columns": _Columns, "time": _Time, "input": _Input, "output": _Output}
        tables |= {"model": _Model, "records": _Records, "train": _Part, "holdout": _Part}
        parent = tables.get(keys[-2], _Quantity) if len(keys) > 1 else _Rig
        known = list(parent.model_fields)
        if parent is _Rig:
            units = {stem: unit[0].replace(" ", "_").replace("^", "") for stem, unit in _QUANTITIES.items()}
            known += [f"{stem}_{unit}" for stem, unit in units.items()]
        return (
            f"{where} the key {name!r} is not known.{suggestion(keys[-1], known)} Known here: {', '.join(known)}.{more}"
        )
    value = detail["input"]
    return f"{where} the key {name!r} is {value!r}, but {_lower(detail['msg'])}. Correct the value.{more}"


def _lower(message: str) -> str:
    return message[:1].lower() + message[1:].rstrip(".")
