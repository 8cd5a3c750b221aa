"""What is unusual about a recording, as records: a code, the column, numbers; and the one place that words them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from string import Formatter
from typing import Any

from discovery.declarations.units import quoted
from discovery.recordings.flag_words import CODES, IMPOSSIBLE, MISREAD, NOISE, OVERSTATED, REPEATED, UNDERSTATED

__all__ = [
    "IMPOSSIBLE",
    "MISREAD",
    "OVERSTATED",
    "REPEATED",
    "UNDERSTATED",
    "Flag",
    "doubted",
    "impossible",
    "misstated",
]

_FAR = 2.0  # ratio of a stated noise to a smaller one that hides what is sought


@dataclass(frozen=True)
class Flag:
    """One thing that is unusual about a recording."""

    code: str  # which
    column: str = ""  # where in the file; empty where it is the whole recording
    unit: str = "1"  # of the column
    numbers: Mapping[str, Any] = field(default_factory=dict)  # sizes, counts and names [SI], by code

    @property
    def severity(self) -> str:
        """How much depends on it.

        ``note``: good to know; ``left_out``: readings became gaps; ``doubt``: the results may be wrong; ``impossible``:
        the declared system cannot move as the readings do.
        """
        return CODES[self.code][0]

    @property
    def sentence(self) -> str:
        """The flag in words, for people."""
        words = CODES[self.code][1]
        return _worded(words if isinstance(words, str) else words(self.numbers), self)

    def __str__(self) -> str:
        return self.sentence

    def summary(self) -> dict[str, Any]:
        """Return a JSON-ready description."""
        return {"code": self.code, "severity": self.severity, "column": self.column, "numbers": dict(self.numbers)}


_FAR_CLOCK = 1e3  # s, of later moments four digits are whole seconds


class _Words(Formatter):
    """Python's formats, counts with their words, values in the unit of a column, and moments of any clock."""

    def __init__(self, unit: str) -> None:
        self._unit = unit

    def format_field(self, value: Any, format_spec: str) -> str:
        if format_spec.startswith("unit"):
            return quoted(value, self._unit, int(format_spec[4:] or 3))
        if format_spec == "time":
            return f"{value:.4g}" if abs(value) < _FAR_CLOCK else f"{value:.3f}".rstrip("0").rstrip(".")
        if "|" in format_spec:
            one, several = format_spec.split("|")
            return f"{value} {one if value == 1 else several}"
        return format(value, format_spec)


def _worded(template: str, flag: Flag) -> str:
    return _Words(flag.unit).format(template, column=flag.column, **flag.numbers)


def impossible(flags: Iterable[Flag]) -> bool:
    """Return whether a flag refutes what the rig file declares: the file is in doubt before any model is."""
    return any(flag.severity == IMPOSSIBLE for flag in flags)


def doubted(flags: Mapping[str, Iterable[Flag]], *, complete: bool = False) -> list[str]:
    """Return a sentence for each doubt that flags, by recording, tell of, with the numbers of the first recording.

    A stated noise is none of them: `misstated` has it. Nor is a mean that creeps where a `complete` model does.
    """

    def fault(flag: Flag) -> object | None:
        explained = flag.code in NOISE or (complete and flag.code == "mean_creeps")
        if flag.severity not in ("doubt", IMPOSSIBLE) or explained:
            return None
        return flag.code, flag.column, flag.numbers.get("likely"), flag.numbers.get("right")

    found = _alike(flags, fault)
    return [
        f"{first}: {flag.sentence}" + (f" So in {', '.join(name for name, _ in others)}." if others else "")
        for (first, flag), *others in found
    ]


def misstated(flags: Mapping[str, Iterable[Flag]]) -> list[str]:
    """Return a sentence for each stated noise that flags, by recording, contradict, with all their columns."""

    def fault(flag: Flag) -> tuple[str, str, float] | None:
        if flag.code not in NOISE or flag.numbers["scatter"] <= flag.numbers["stated"] < _FAR * flag.numbers["scatter"]:
            return None
        return flag.code, flag.unit, flag.numbers["stated"]

    sentences = []
    for entries in _alike(flags, fault):
        first = entries[0][1]
        names = ", ".join(dict.fromkeys(name for name, _ in entries))
        labels = ", ".join(dict.fromkeys(repr(flag.column) for _, flag in entries))
        sizes = sorted(flag.numbers["scatter"] for _, flag in entries)
        least, most = quoted(sizes[0], first.unit), quoted(sizes[-1], first.unit)
        span = most if least == most else f"{least.split(' ')[0]} to {most}"
        verb = "scatters" if len(entries) == 1 else "scatter"
        sentences.append(f"{names}: {labels} {verb} by {span}{_worded(NOISE[first.code], first)}")
    return sentences


def _alike(flags: Mapping[str, Iterable[Flag]], fault: Callable[[Flag], object | None]) -> list[list[tuple[str, Flag]]]:
    """Return recordings with their flags, together where the fault is the same; None is no fault."""
    found: dict[object, list[tuple[str, Flag]]] = {}
    for name, its in flags.items():
        for flag in its:
            if (key := fault(flag)) is not None:
                found.setdefault(key, []).append((name, flag))
    return list(found.values())
