"""Text of a step for states that forget fast: the exponential method of order four, one state at a time.

A state z of a memory forgets at most at a rate g, which a step must not have to resolve. Of z' = k(z, ...), the method
takes -g z, with g as it is where the step begins, by its own solution, and what is left, k + g z, as the classical
method takes all; without g it is the classical method. The solution exp(-x), x = h g, and the functions phi_1, phi_2
and phi_3 that weigh what is left are written with 1 + x + x^2/2 + x^3/6 + x^4/24 for exp(x): right to the order of the
method, without cancellation, and like them for large x.

S. M. Cox, P. C. Matthews, Exponential time differencing for stiff systems, Journal of Computational Physics 176 (2002)
430, equations 26 to 29.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from discovery.simulation.kernel.straight_line import received

#: Where each number of a state lies between the stages of a step: the label of its row.
_KEPT = {"y": "Y", "z": "S", "f": "F", "k": "K", "between": "A", "rate": "J", "g": "G", "u": "U", "v": "V"}

_FIRST = "first = 1.0 + x * (0.5 + x * (1 / 6 + x / 24))"
#: What comes before each call of the slopes, from state z, slope k and rate at the start of the step to z at its end.
_STAGES = {
    1: f"""
        y = z
        f = k
        g = rate
        between = 0.0
        x = half * g
        {_FIRST}
        u = 1.0 / (1.0 + x * first)
        v = half * first * u
        z = u * y + v * (f + g * y)
    """,
    2: """
        left = k + g * z
        between = between + left
        z = u * y + v * left
    """,
    3: """
        left = k + g * z
        between = between + left
        began = f + g * y
        z = u * (u * y + v * began) + v * (2.0 * left - began)
    """,
    4: f"""
        left = k + g * z
        began = f + g * y
        x = h * g
        {_FIRST}
        second = 0.5 + x * (1 / 3 + x * (0.125 + x / 24))
        third = 1 / 6 + x * (0.125 + x * (1 / 24 + x / 48))
        weighed = (first - 3.0 * second + 4.0 * third) * began + (4.0 * third - second) * left
        weighed = weighed + 2.0 * (second - 2.0 * third) * between
        z = (y + h * weighed) / (1.0 + x * first)
    """,
}


def _lines(stage: int) -> list[str]:
    return [line.strip() for line in _STAGES[stage].strip().splitlines()]


def renamed(stage: int, names: Mapping[str, str], own: str) -> list[str]:
    """Return the lines of a stage, 1 to 4, with other names for its numbers; those not named end in `own`."""

    def other(found: re.Match[str]) -> str:
        name = found[0]
        return name if name in ("h", "half") else names.get(name, f"_{name}{own}")

    return [re.sub(r"[a-z]\w*", other, line) for line in _lines(stage)]


def in_rows(stage: int, rows: Mapping[str, int]) -> list[str]:
    """Return the lines of a stage, 1 to 4, with loads before and stores after them; `rows` are by label."""
    lines = _lines(stage)
    loads = [f"{name} = w[{rows[_KEPT[name]]} + i]" for name in received(lines) if name in _KEPT]
    assigned: Sequence[str] = list(dict.fromkeys(line.split(" = ")[0] for line in lines))
    return loads + lines + [f"w[{rows[_KEPT[name]]} + i] = {name}" for name in assigned if name in _KEPT]
