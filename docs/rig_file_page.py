"""The reference of rig files as one page of Markdown: ``python docs/rig_file_page.py OUT.md``.

Keys, types, defaults and meanings are taken from the schema that reads rig files (`discovery.rigs.rig_schema`) and from
the quantities that it knows (`discovery.rigs.quantities`).
"""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from discovery.foundation.io import atomic_write
from discovery.recordings.file_signals import ARM_OUTPUTS, ARM_STEMS
from discovery.rigs.quantities import QUANTITIES, key_of
from discovery.rigs.rig_schema import QuantityTable, RigTable
from discovery.rigs.rig_system import ready_made

_OPENING = """# The rig file

Written by `make docs` from the schema that reads rig files.

A rig file is text in [TOML](https://toml.io). It says what you know of a measured system before you look at the data:
what kind of system it is, its lengths and masses, what the columns of its recordings are, and which model you declare.
You need not write one from nothing: `discovery init` drafts it from a recording, and [Bring your own
recording](YOUR_RECORDING.md) goes through one step by step. `discovery check` shows what is understood of it. This
page has every key.

A key or a value that is not known is refused with its line and with what is known there. A table inside another is
written inline, `time = { rate_hz = 100.0 }`, or under a header of its own, `[columns.time]`. Below, a key that its
table needs is *required*, and where there is no default (–) the meaning says what happens when the key is left out.
"""
_QUANTITIES = """A quantity carries its unit as the suffix of its key: any unit of that kind, with `per` for a
division, such as `length_cm`, `tip_mass_g` or `motor_speed_limit_deg_per_s`. It is a positive number, or a table with
its standard deviation (sd), `length_m = { value = 0.80, sd = 0.005 }`; noises and limits are used without one (–).
What is beyond the largest value is refused as not plausible.
"""
_ARM = """The columns of a `flexible_arm` are not declared: the file names them, with any unit of that kind as the
suffix. An arm needs time, motor angle, and one of {outputs}. Other columns are ignored.
"""
#: The three lists of recordings hold the same.
_RECORDING = "records.train"
_ARM_MEANING = {
    "time": "Time of the reading.",
    "motor_angle": "Angle of the motor, which is the input.",
    "tip_x": "Position of the tip in the fixed frame, from the axis of the motor, along the zero of the motor's angle.",
    "tip_y": "The same, across it.",
    "tip_angle": "Angle of the line from the axis of the motor to the tip, in the fixed frame.",
    "tip_deflection": "Distance of the tip from the line that the motor points along.",
}
#: What a table's own sentence does not say; by the path of the table.
_MORE = {
    "": "[A table](YOUR_RECORDING.md#7-other-kinds-of-system) says what each kind has as input, as output and as its "
    "declared model.",
    "system": "[Your own system](YOUR_SYSTEM.md) explains the equations. Ready-made are {ready}.",
    "model": "The [catalogue](CATALOGUE.md) has all effects.",
}
EXAMPLE = """# A slider between two springs, pushed by a voice coil. What stands behind # is a comment.
name = "slider on springs"
kind = "oscillator"                              # something pulls it back to a place of rest
mass_g = { value = 412.0, sd = 0.5 }             # stiffness and friction are then told in N/m and N as well

[columns]
time = { name = "t_ms", unit = "ms", jitter = 0.02 }          # a stamp errs by 0.02 ms
input = { name = "coil_V", unit = "V", interpolation = "auto" }     # the recordings choose how it runs in between
output = { name = "laser_V", unit = "mm", zero = 2.5, scale = 4.0, noise = 0.01 }    # 4 mm/V, 2.5 V at rest
every = 2                                        # little changes from row to row: one in two is used

[model]
effects = ["viscous_damping", "linear_stiffness"]

[records]
train = [
    { file = "bench.csv", where = { run = 1 }, samples = [200, 4200], name = "slow" },  # rows 200 to 4199 of run 1
    { file = "bench.csv", where = { run = 2 }, name = "fast" },
]
holdout = [{ file = "another_day.csv" }]         # judges, and is never fitted
"""

_Schema = Mapping[str, Any]


def _words(docstring: str | None) -> str:
    """Return a docstring as Markdown."""
    return (docstring or "").replace("``", "`")


def _header(path: str) -> str:
    """Return the header under which TOML has a table."""
    return f"`[[{path}]]`" if path == _RECORDING else f"`[{path}]`"


def _link(path: str) -> str:
    """Return a link to the section of a table."""
    return f"[{_header(path)}](#{path.replace('.', '').lower()})"


def _type(given: _Schema, path: str) -> str:
    """Say what a value may be, where `path` leads to its table if it is one."""
    match given:
        case {"$ref": _}:
            return f"table {_link(path)}"
        case {"anyOf": choices}:
            return " or ".join(_type(c, path) for c in choices if c != {"type": "null"})
        case {"enum": values}:
            return ", ".join(f"`{json.dumps(v)}`" for v in values)
        case {"const": value}:
            return f"`{json.dumps(value)}`"
        case {"type": "array", "items": items}:
            return f"list{_size(given, 'Items')}: {_type(items, path)}"
        case {"type": "object", "additionalProperties": inner}:
            return f"table{_size(given, 'Properties')}: names, each with {_type(inner, path)}"
        case {"type": "boolean"}:
            return "`true` or `false`"
    word = {"number": "number", "integer": "whole number", "string": "text"}[given["type"]]
    if "exclusiveMinimum" in given:
        return f"{word} > {given['exclusiveMinimum']:g}"
    return f"{word} ≥ {given['minimum']:g}" if "minimum" in given else word


def _size(given: _Schema, what: str) -> str:
    """Say how many a list or a table may hold."""
    least, most = given.get(f"min{what}"), given.get(f"max{what}")
    if least == most:
        return "" if least is None else f" of {least}"
    return f" of {least} to {most}" if most is not None else f" of at least {least}"


def _default(key: str, given: _Schema, required: Sequence[str]) -> str:
    """Return what a key is where it is left out."""
    if key in required:
        return "*required*"
    value = given.get("default")
    return "–" if value is None or isinstance(value, dict | list) else f"`{json.dumps(value)}`"


def _target(given: _Schema) -> str | None:
    """Return the definition of the table that a key holds, or that its list or its names hold."""
    for inner in (given, given.get("items"), given.get("additionalProperties"), *given.get("anyOf", ())):
        if isinstance(inner, Mapping) and "$ref" in inner:
            return str(inner["$ref"]).rpartition("/")[2]
    return None


def _keys(table: _Schema, path: str) -> list[str]:
    """Return the rows of a table of keys."""
    rows = ["| key | type or choices | default | meaning |", "|---|---|---|---|"]
    for key, given in table["properties"].items():
        kind = _type(given, _path(path, key))
        rows.append(
            f"| `{key}` | {kind} | {_default(key, given, table.get('required', ()))} | {given['description']} |"
        )
    return [*rows, ""]


def _path(path: str, key: str) -> str:
    """Return the name of an inner table."""
    if path == "records":
        return _RECORDING
    return f"{path}.{key}{'.NAME' if key in ('constants', 'also') else ''}" if path else key


def _sections(schema: _Schema, table: _Schema, path: str = "") -> list[str]:
    """Return the sections of the tables below one, each once."""
    lines: list[str] = []
    for inner, name in {_path(path, k): _target(g) for k, g in table["properties"].items()}.items():
        if name is not None:
            found = schema["$defs"][name]
            words = [_words(found.get("description")), _MORE.get(inner, "").format(ready=_ready_made())]
            lines += [
                f"{'###' if path else '##'} {_header(inner)}",
                "",
                " ".join(filter(None, words)),
                "",
                *_keys(found, inner),
            ]
            lines += _sections(schema, found, inner)
    return lines


def _power(number: float) -> str:
    """Return a number with as short a power as may be."""
    return f"{number:g}".replace("e+0", "e")


def _ready_made() -> str:
    return ", ".join(f"`{name}`" for name in ready_made())


def _quantities() -> list[str]:
    """Return the section of quantities."""
    lines = ["## Quantities", "", _QUANTITIES]
    lines += ["| key | unit | sd if not stated | largest | kinds | meaning |", "|---|---|---|---|---|---|"]
    for stem, known in QUANTITIES.items():
        sd = f"{100 * known.relative_sd:g} %" if known.relative_sd else f"{known.absolute_sd:g}"
        kinds = ", ".join(f"`{kind}`" for kind in known.kinds)
        usual = "–" if known.usual_sd(1.0) == 0.0 else sd
        lines.append(
            f"| `{key_of(stem)}` | {known.unit} | {usual} | {_power(known.largest)} | {kinds} | {known.meaning} |"
        )
    table = QuantityTable.model_json_schema()
    return [*lines, "", "The table of a quantity:", "", *_keys(table, "")]


def _arm() -> list[str]:
    """Return the section of an arm's columns."""
    outputs = ", or ".join(" and ".join(f"`{stem}`" for stem in channels) for channels in ARM_OUTPUTS)
    lines = ["## Columns of a flexible arm", "", _ARM.format(outputs=outputs)]
    lines += ["| column | unit | meaning |", "|---|---|---|"]
    return [*lines, *(f"| `{stem}_{unit}` | {unit} | {_ARM_MEANING[stem]} |" for stem, unit in ARM_STEMS.items()), ""]


def rig_file_page() -> str:
    """Return the page."""
    schema = RigTable.model_json_schema()
    lines = [_OPENING, "## An example", "", "```toml", EXAMPLE + "```", ""]
    lines += ["## Keys of the file", "", _MORE[""], "", *_keys(schema, "")]
    lines += [*_quantities(), *_arm(), *_sections(schema, schema)]
    return "\n".join(lines).rstrip() + "\n"


def main(arguments: Sequence[str] | None = None) -> None:
    """Write the page to the file named on the command line."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    if len(given) != 1:
        sys.exit("usage: python docs/rig_file_page.py OUT.md")
    with atomic_write(Path(given[0])) as temporary:
        Path(temporary).write_text(rig_file_page(), encoding="utf-8")


if __name__ == "__main__":
    main()
