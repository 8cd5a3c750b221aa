"""Text of a step whose stages go through memory, with loops over the lanes for each thing that may be absent."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from itertools import groupby
from pathlib import Path

from discovery.simulation.kernel.forgetting import in_rows
from discovery.simulation.kernel.text import filled

_TEXT = Path(__file__).with_name("stages.txt")


def staged_step(
    over: Callable[[str, Sequence[str]], list[str]],
    lanes: int,
    rows: Mapping[str, int],
    awake: Sequence[str],
    forgetting: Sequence[bool],
) -> str:
    """Return a function that takes one step from states S with slopes K, kept as Y and F, to the next.

    Parameters
    ----------
    over : callable
        Returns the lines of a loop over some places, of its body.
    lanes : int
        Parameter sets in one block.
    rows : mapping of str to int
        First row of each label.
    awake : sequence of str
        The condition under which each state moves.
    forgetting : sequence of bool
        Whether it forgets fast, see `discovery.simulation.kernel.forgetting`.
    """
    runs = [(key, [*run]) for key, run in groupby(range(len(awake)), key=lambda k: (awake[k], forgetting[k]))]

    def swept(indent: str, body: Sequence[str], forgets: bool) -> str:
        """Repeat a loop over the states that always move, and over each memory that does."""
        text = ""
        for (condition, fast), own in runs:
            if fast == forgets:
                loop = over(f"range({own[0] * lanes}, {(own[-1] + 1) * lanes})", body)
                text += f"{indent}if {condition}:\n" + "".join(f"{indent}    {line}\n" for line in loop)
        return text or f"{indent}pass\n"

    text = filled(_TEXT.read_text(encoding="utf-8"), rows)
    text = re.sub(
        r"( +)for i in @MOVING@:\n((?:\1    .*\n)+)",
        lambda found: swept(found[1], [line.strip() for line in found[2].splitlines()], False),
        text,
    )
    return re.sub(r"( +)@FORGETTING (\d)@\n", lambda found: swept(found[1], in_rows(int(found[2]), rows), True), text)
