"""Cases of mistaken rig files: every key left out, misspelt, of another type, out of range; files that are no TOML."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import partial
from pathlib import Path

from benchmarks.faults.case import Case

FILE = "rig.toml"
#: Keys of the sound file, each with the text of its value.
KEYS = {
    "name": '"a pendulum on film"',
    "kind": '"pendulum"',
    "length_m": "{ value = 0.8, sd = 0.002 }",
    "time": '{ name = "t_s", unit = "s" }',
    "output": '{ name = "angle_deg", unit = "deg", noise = 0.2 }',
    "train": '[{ file = "high.csv" }, { file = "low.csv" }]',
    "holdout": '[{ file = "middle.csv" }]',
}
#: Values of other types, and out of every range.
VALUES = ("-1.0", "0", "1e400", "nan", "inf", "true", "[]", "{}", '""', '"x"', "[1, 2]", "{ value = 1 }", "1979-05-27",
          "99999999999999999999999", '"' + "x" * 5000 + '"', '"\\u0000"', "[[[]]]")  # fmt: skip
#: What is written in place of a part of the file.
PARTS = {
    "unit of no angle": ('unit = "deg"', 'unit = "kg"'),
    "unknown unit": ('unit = "deg"', 'unit = "dgr"'),
    "unit of no time": ('unit = "s"', 'unit = "m"'),
    "negative noise": ("noise = 0.2", "noise = -0.2"),
    "noise of nothing": ("noise = 0.2", "noise = 0"),
    "noise without end": ("noise = 0.2", "noise = inf"),
    "noise in words": ("noise = 0.2", 'noise = "small"'),
    "spread larger than the length": ("sd = 0.002", "sd = 8.0"),
    "negative spread": ("sd = 0.002", "sd = -0.002"),
    "another file": ("high.csv", "hihg.csv"),
    "a folder as a file": ('"high.csv"', '"."'),
    "a file above": ('"high.csv"', '"../../../../etc/hostname"'),
    "the rig file as a recording": ('"high.csv"', '"rig.toml"'),
    "the same file twice": ("low.csv", "high.csv"),
    "samples backwards": ('"high.csv" ', '"high.csv", samples = [300, 100] '),
    "samples beyond the end": ('"high.csv" ', '"high.csv", samples = [0, 100000] '),
    "samples that are none": ('"high.csv" ', '"high.csv", samples = "all" '),
    "too few samples": ('"high.csv" ', '"high.csv", samples = [0, 10] '),
    "overlapping parts": ('[{ file = "high.csv" }', '[{ file = "high.csv", samples = [0, 400] }, { file = "high.csv", '
                          "samples = [200, 600] }"),
    "a column twice": ('name = "angle_deg"', 'name = "t_s"'),
    "no such column": ('name = "angle_deg"', 'name = "alpha"'),
    "another kind": ('"pendulum"', '"pendulm"'),
    "a kind that asks for more": ('"pendulum"', '"arm"'),
    "a section twice": ("[records]", "[columns]\n[records]"),
    "a key twice": ('kind = "pendulum"', 'kind = "pendulum"\nkind = "pendulum"'),
    "an unknown section": ("[records]", "[recordings]"),
    "an unknown key": ('kind = "pendulum"', 'kind = "pendulum"\ncolour = "red"'),
}  # fmt: skip
WHOLE = {
    "empty": b"",
    "noise": bytes(range(128, 256)) * 4,
    "a zero byte": b'name = "a"\0\n',
    "deep values": b"a = " + b"[" * 3000 + b"]" * 3000,
    "deep tables": b"a = " + b"{a=" * 3000 + b"1" + b"}" * 3000,
    "a number of 5001 digits": b"length_m = 1" + b"0" * 5000,
    "YAML": b"name: a pendulum\nkind: pendulum\n",
    "JSON": b'{"name": "a pendulum"}',
    "a million comments": b"# nothing\n" * 100_000,
    "Python": b"__import__('os').system('touch pwned')\n",
}


def _changed(old: str, new: str, folder: Path) -> None:
    text = (folder / FILE).read_text(encoding="utf-8")
    if old not in text:
        raise ValueError(f"{old!r} is not in the sound rig file")
    (folder / FILE).write_text(text.replace(old, new, 1), encoding="utf-8")


def _without(key: str, folder: Path) -> None:
    text = (folder / FILE).read_text(encoding="utf-8")
    (folder / FILE).write_text(re.sub(rf"^{key} = .*\n", "", text, flags=re.MULTILINE), encoding="utf-8")


def _whole(content: bytes, folder: Path) -> None:
    (folder / FILE).write_bytes(content)


def _mark(folder: Path) -> None:
    (folder / FILE).write_bytes(b"\xef\xbb\xbf" + (folder / FILE).read_bytes())


def rig_files() -> Iterator[Case]:
    """Return every case of this kind."""
    for key, value in KEYS.items():
        yield Case("rig file without a key", key, partial(_without, key))
        yield Case("rig file, misspelt key", key, partial(_changed, f"{key} = ", f"{key}x = "), (FILE,))
        for other in VALUES:
            case = partial(_changed, f"{key} = {value}", f"{key} = {other}")
            yield Case("rig file, odd value", f"{key} = {other[:24]}", case)
    for name, (old, new) in PARTS.items():
        yield Case("rig file, part", name, partial(_changed, old, new))
    for name, content in WHOLE.items():
        yield Case("rig file, whole", name, partial(_whole, content), (FILE,))
    yield Case("rig file, way of writing", "byte order mark", _mark)
