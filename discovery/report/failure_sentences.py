"""The sentences on a declared model that has no fit: why, and what would help."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from discovery.report.numbers import plain

Record = Mapping[str, Any]


def failure_sentence(failure: Record) -> str:
    """Return why the declared model has no fit."""
    numbers = failure["numbers"]
    at = f", at {plain(numbers['time'])} s" if "time" in numbers else ""
    words = {
        "runs_away": "the declared system runs away from rest by itself, and so does every fit of it",
        "diverges": f"wherever its fit begins, the declared model leaves the measured range a hundred times over{at}",
        "unresolved": "the declared model moves too fast, or too wildly, for any integration step",
    }[failure["code"]]
    if "grows_in" in numbers:
        words += f"; at its guesses a small motion grows e-fold in {plain(numbers['grows_in'])} s"
    if "followed" in numbers:
        words += f"; it can be fitted to the first {plain(numbers['followed'])} s"
    return words


def remedy_sentence(failure: Record) -> str:
    """Return what would help where the declared model has no fit."""
    numbers = failure["numbers"]
    short = numbers.get("followed") or 3 * numbers.get("grows_in", 0.0)
    part = f"train on parts of {plain(short, 2)} s or less (samples = [start, stop] in [records])" if short else ""
    if failure["code"] == "runs_away":
        words = "check the signs: a spring has the potential + k q^2/2, a loss the dissipation + c dot(q)^2/2"
        return f"{words}. If the system is unstable by nature, {part}" if part else words
    if failure["code"] == "diverges":
        words = "check the units of the columns, and give guesses within a factor of two of the truth"
        return f"{words}; or {part}" if part else words
    return "check the units of stiffness and inertia, and their guesses: a light part on a stiff spring rings too fast"
