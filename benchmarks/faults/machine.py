"""Cases of the command line and of the machine: arguments, folders in the place of files, variables."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

from benchmarks.faults.case import Case

#: Arguments that are refused, with what the refusal names.
ARGUMENTS: dict[str, tuple[list[str], tuple[str, ...]]] = {
    "no rig file": (["loop"], ("RIG",)),
    "no such rig file": (["loop", "rgi.toml", "--out", "out"], ("rgi.toml",)),
    "a folder as a rig file": (["loop", ".", "--out", "out"], ()),
    "no such command": (["lopo", "rig.toml"], ("lopo",)),
    "no such option": (["loop", "rig.toml", "--outt", "out"], ("--outt",)),
    "nowhere": (["loop", "rig.toml", "--out", ""], ("--out",)),
    "a long name": (["loop", "rig.toml", "--out", "x" * 300], ("--out",)),
    "a name with a zero": (["loop", "rig.toml", "--out", "a\0b"], ("--out",)),
    "a file as a folder": (["loop", "rig.toml", "--out", "high.csv"], ("high.csv",)),
    "below a file": (["loop", "rig.toml", "--out", "high.csv/out"], ("high.csv",)),
    "a seed that is no number": (["loop", "rig.toml", "--seed", "x", "--out", "out"], ("--seed",)),
    "a negative seed": (["loop", "rig.toml", "--seed", "-1", "--out", "out"], ("--seed",)),
    "no such recording": (["loop", "rig.toml", "--train", "none.csv", "--out", "out"], ("none.csv",)),
    "a recording with a zero": (["loop", "rig.toml", "--train", "a\0b.csv", "--out", "out"], ()),
    "a recording of a long name": (["loop", "rig.toml", "--train", "x" * 3000, "--out", "out"], ()),
    "the same recording twice": (["loop", "rig.toml", "--train", "high.csv", "--train", "high.csv", "--out", "out"],
                                 ("high",)),
    "training held out": (["loop", "rig.toml", "--train", "high.csv", "--holdout", "high.csv", "--out", "out"],
                          ("high",)),
    "no such prediction": (["loop", "rig.toml", "--predict", "none.csv", "--out", "out"], ("none.csv",)),
    "an odd initial state": (["loop", "rig.toml", "--predict", "low.csv", "--initial-state", "x", "--out", "out"],
                             ("--initial-state",)),
    "no time": (["run", "rig.toml", "--max-time", "soon", "--out", "out"], ("--max-time",)),
    "negative time": (["run", "rig.toml", "--max-time", "-5", "--out", "out"], ("--max-time",)),
    "nothing to report": (["report", "nothing"], ("nothing",)),
    "nothing to export": (["export", "nothing", "--out", "model"], ("nothing",)),
    "no campaign": (["campaign", "nothing", "--out", "out"], ("nothing",)),
    "no such effect": (["effects", "coulomb_frction"], ("coulomb_friction",)),
}  # fmt: skip
#: Content of a folder of results that no command wrote.
RESULTS = {
    "empty": "",
    "cut off": '{"models": {"after"',
    "a number": "7",
    "a list": "[]",
    "deep": "[" * 100_000,
    "other keys": '{"a": 1}',
    "other types": '{"models": 7, "rig": [], "recordings": 0, "loop": ""}',
    "a zero byte": "\0",
}


def _given(arguments: Sequence[str], folder: Path) -> list[str]:
    return list(arguments)


def _results(command: str, file: str, content: str, folder: Path) -> list[str]:
    (folder / "done").mkdir()
    (folder / "done" / file).write_text(content, encoding="utf-8")
    return [command, "done", *(["--out", "model"] if command == "export" else [])]


def _folder_for(file: str, folder: Path) -> list[str]:
    (folder / "out" / file).mkdir(parents=True)
    return ["loop", "rig.toml", "--out", "out"]


def _plain(folder: Path) -> list[str]:
    return ["fit", "rig.toml", "--out", "out"]


def machine() -> Iterator[Case]:
    """Return every case of this kind."""
    for name, (arguments, place) in ARGUMENTS.items():
        yield Case("arguments", name, partial(_given, arguments), place)
    for command in ("report", "export"):
        for file in ("results.json", "loop.json"):
            for name, content in RESULTS.items():
                yield Case("results", f"{command} {file} {name}", partial(_results, command, file, content))
    for file in ("loop.json", "prediction.csv", "report.html"):
        yield Case("folder in the place of a file", file, partial(_folder_for, file), (file,))
    for name, value in {"a file": "rig.toml", "below a file": "rig.toml/a", "a zero": "x" * 4000}.items():
        yield Case("cache", name, _plain, environment={"DISCOVERY_CACHE": value})
    for variable in ("DISCOVERY_DATA", "DISCOVERY_SCHEDULER"):
        yield Case("environment", variable, _plain, environment={variable: "/nowhere/at/all"})
    for locale in ("C", "de_DE.UTF-8"):
        yield Case("environment", f"LC_ALL={locale}", _plain, environment={"LC_ALL": locale})
