"""The columns of a recording that a draft leaves out, and which of them may drive the system or be its motion."""

from __future__ import annotations

from collections.abc import Collection, Iterator

import numpy as np

from discovery.drafting.names import meaning_of
from discovery.drafting.record_lines import trial_column
from discovery.drafting.signals import Signals, open_table
from discovery.foundation.errors import InputError

#: What is said of a column, or of several, with one number in each recording.
DIFFERS = "is held, and differs between recordings", "are held, and differ between recordings"
#: Of a step, by which the steps of a counter may differ.
_EVEN = 0.05


def unused_words(found: Signals, named: Collection[str] = ()) -> str:
    """Name the columns that are left, and of which ones nothing but the user can tell whether they have a role.

    Of the roles ``"input"`` and ``"output"``, the user `named` the columns of some: those are no longer asked for.
    """
    loose = [] if {"input", "output"} <= {*named} else _varying(found)
    said = [", ".join(name for name in found.unused if name not in found.still and name not in loose)[:300]]
    if loose:
        said.append(f"{', '.join(loose)[:300]} ({_roles(len(loose) == 1, named)})")
    return ", ".join(filter(None, [*said, *_held(found)]))


def _roles(alone: bool, named: Collection[str]) -> str:
    """Say with which options columns that vary are given a role."""
    options = {"input": "with --input if it drives", "output": "with --output if it is the motion"}
    asked = ", or ".join(text for role, text in options.items() if role not in named)
    return f"{'varies: name it' if alone else 'vary: name one'} {asked}"


def _held(found: Signals) -> Iterator[str]:
    """Yield what is said of the columns that never change in a recording."""
    for differs, one, several in ((False, "never changes", "never change"), (True, *DIFFERS)):
        names = [name for name in found.still if (name in found.differ) is differs]
        if names:
            say = f"{one}: name it" if len(names) == 1 else f"{several}: name one"
            yield f"{', '.join(names)[:300]} ({say} with --input if it drives)"


def _varying(found: Signals) -> list[str]:
    """Return the columns left that may be an input or an output: numbers that change, no times, counters or trials."""
    table = open_table(found.path)[0]
    trial = trial_column(found)
    names = []
    for name in found.unused:
        role = meaning_of(name).role
        if role in ("time", "other") or name in found.still or name == trial:
            continue
        try:
            values = table.numbers(name)
        except InputError:
            continue
        steps = np.diff(values)
        counts = role == "" and steps.size > 0 and bool((np.abs(steps - steps[0]) <= _EVEN * abs(steps[0])).all())
        if np.isfinite(values).any() and not counts:
            names.append(name)
    return names
