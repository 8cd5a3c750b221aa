"""The kind of system that a recording is of, as far as its signals tell."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from discovery.declarations.unit_suffixes import split_suffix
from discovery.declarations.units import si_symbol
from discovery.drafting.law_of_motion import FloatArray, own_period, runs_on
from discovery.drafting.signals import Signals
from discovery.foundation.errors import InputError
from discovery.foundation.io import Table
from discovery.recordings.file_signals import ARM_OUTPUTS, ARM_STEMS
from discovery.rigs.kinds import Kind


class Guess(NamedTuple):
    """A kind of system, and one clause that says why."""

    kind: str
    why: str


def has_columns_of_an_arm(names: Iterable[str]) -> bool:
    """Whether columns are those of a flexible arm: time, motor angle and tip."""
    found = {split[0] for name in names if (split := split_suffix(name, ARM_STEMS)) is not None}
    return {"time", "motor_angle"} <= found and any(found.issuperset(outputs) for outputs in ARM_OUTPUTS)


def fits(kind: Kind, found: Signals) -> bool:
    """Whether a built-in kind could have been recorded like this: with such an input, and an output in such a unit."""
    if kind.has_rod or kind.has_own_equations or kind.needs_input not in (None, found.input is not None):
        return False
    unit = si_symbol(found.output.unit)
    moved = None if found.input is None else si_symbol(found.input.unit)
    if kind.shaken and moved != unit and (moved, unit) != ("m", "rad"):
        return False
    return kind.unit in (None, unit)


def guess_kind(path: Path, found: Signals, time: FloatArray) -> Guess:
    """Guess the kind of system from its signals, their times [s] (n,), and the name of their file."""
    unit = si_symbol(found.output.unit)
    if found.reads == "speed":
        return Guess("system", "a speed is read by a system in its own equations: docs/YOUR_SYSTEM.md")
    if found.reads == "height" and found.input is None and unit == "m":
        return Guess("falling_body", "the output is a height, and nothing drives it")
    if found.moved and found.input is not None and {unit, si_symbol(found.input.unit)} <= {"m", "rad", "1"}:
        return Guess("base_excited", f"{found.input.name!r} is the motion of a base")
    hanging = "pend" in f"{path.stem} {found.output.name}".lower()
    if unit == "rad" and not hanging and runs_on(found.output.si):
        if found.input is not None:
            return Guess("drive", "an input turns it on and on, and nothing pulls it back")
        return Guess("system", "an angle that turns on and on, and no input: in its own equations, docs/YOUR_SYSTEM.md")
    if found.input is None:
        if unit == "rad":
            again = f"discovery init {path.name} --kind oscillator"
            return Guess("pendulum", f"an angle that nothing drives; on a torsion spring: `{again}`")
        return Guess("oscillator", "nothing drives it")
    if found.reads == "acceleration":
        return Guess("oscillator", "an acceleration does not tell whether anything pulls it back")
    period = own_period(time, found.output.si, found.input.si)
    if period is None:
        return Guess("drive", "an input moves it, and nothing pulls it back to a place of rest")
    back = f"it swings about its rest, once in about {period:.3g} s"
    return Guess("pendulum" if unit == "rad" and hanging else "oscillator", back)


def trials(table: Table, time: npt.NDArray[np.float64], names: Sequence[str]) -> tuple[str, list[str | float]]:
    """Return the column that tells the trials of a file apart, and its values in their order; none of them otherwise.

    Its times [s] (n,) begin again with every trial. Of the columns `names`, one may hold for each a value of its own.
    """
    begins = np.flatnonzero(np.diff(time) <= 0.0) + 1
    if not begins.size:
        return "", []
    for name in names:
        try:
            cells: list[str | float] = table.numbers(name).tolist()
        except InputError:
            cells = [str(cell).strip() for cell in table.columns[name]]
        parts = [set(cells[part[0] : part[-1] + 1]) for part in np.split(np.arange(len(cells)), begins)]
        values = [value for part in parts for value in part]
        if all(len(part) == 1 for part in parts) and len(set(values)) == len(values):
            return name, values
    return "", []
