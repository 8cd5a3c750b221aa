"""Text of a step: one loop over the lanes that keeps its numbers in registers, or stages that go through memory.

The first serves where everything always runs, the second where things may be absent. Either has states that forget
fast, by the exponential method of order four, one state at a time. A state z of a memory forgets at most at a rate g,
which a step must not have to resolve. Of z' = k(z, ...), the method takes -g z, with g as it is where the step begins,
by its own solution, and what is left, k + g z, as the classical method takes all; without g it is the classical method.
The solution exp(-x), x = h g, and the functions phi_1, phi_2 and phi_3 that weigh what is left are written with
1 + x + x^2/2 + x^3/6 + x^4/24 for exp(x): right to the order of the method, without cancellation, and like them for
large x.

S. M. Cox, P. C. Matthews, Exponential time differencing for stiff systems, Journal of Computational Physics 176 (2002)
430, equations 26 to 29.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from itertools import groupby
from pathlib import Path

from discovery.simulation.kernel.straight_line import received
from discovery.simulation.kernel.text import filled
from discovery.simulation.runge_kutta import Method

_HEAD = "@_inner\n"

_STAGED = Path(__file__).with_name("stages.txt")
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


def _sum(coefficients: Sequence[float], names: Sequence[str]) -> str:
    """Return the text of a sum of products, without those that vanish."""
    return " + ".join(f"{c!r} * {name}" for c, name in zip(coefficients, names, strict=True) if c != 0.0)


def _begun(states: Sequence[str], rows: Mapping[str, Mapping[str, int]], rates: Mapping[str, str]) -> list[str]:
    """Return the lines that load states and slopes, and keep them."""
    inner = []
    for k, state in enumerate(states):
        y, slope = (rows[label][state] for label in "SK")
        inner += [f"_y_{k} = w[{y} + i]", f"_k_0_{k} = w[{slope} + i]"]
        inner += [f"w[{rows['Y'][state]} + i] = _y_{k}", f"w[{rows['F'][state]} + i] = _k_0_{k}"]
        if state in rates:
            inner += [f"{state} = _y_{k}", f"slope_{k} = _k_0_{k}", f"{rates[state]} = w[{rows['J'][state]} + i]"]
    return inner


def fused_step(
    method: Method,
    over_lanes: Callable[[Sequence[str]], Sequence[str]],
    loads: Mapping[str, int],
    states: Sequence[str],
    body: Sequence[str],
    rows: Mapping[str, Mapping[str, int]],
    *,
    rates: Mapping[str, str],
) -> str:
    """Return a function that takes one step from states S with slopes K, kept as Y and F, to the next.

    Parameters
    ----------
    method : Method
        Stages and weights.
    over_lanes : callable
        Returns the lines of a loop over the lanes, of its body.
    loads : mapping of str to int
        Row of every number that does not change during a step.
    states : sequence of str
        Names of the states in `body`.
    body : sequence of str
        Lines that compute ``slope_0``, ... from them, from the recorded input ``r_0``, ``r_1``, ``r_2`` and from ``t``.
    rows : mapping
        Rows of the states Y, S, F, K, and of how fast they forget J.
    rates : mapping of str to str
        States that forget fast, of which the method must be the classical one, and what `body` calls their rates.
    """
    at = [method.times.index(c) for c in (*method.nodes, 1.0)]
    lines = [f"_r_{k}_{m} = drive[n, {m}, {k}]" for m in sorted({*at[1:]}) for k in range(3)]
    lines += [f"_t_{m} = t + {method.times[m]!r} * h" for m in sorted({*at[1:]})]
    inner = [f"{name} = w[{row} + i]" for name, row in loads.items()]
    inner += _begun(states, rows, rates)
    for j, coefficients in enumerate((*method.stages[1:], method.weights), start=1):
        for k, state in enumerate(states):
            if state in rates:
                inner += renamed(j, {"z": state, "k": f"slope_{k}", "rate": rates[state]}, f"_{k}")
            else:
                inner.append(f"{state} = _y_{k} + h * ({_sum(coefficients, [f'_k_{m}_{k}' for m in range(j)])})")
        inner += [f"r_{k} = _r_{k}_{at[j]}" for k in range(3)]
        inner += [f"t = _t_{at[j]}", *body, *(f"_k_{j}_{k} = slope_{k}" for k in range(len(states)))]
    for k, state in enumerate(states):
        inner += [f"w[{rows['S'][state]} + i] = {state}", f"w[{rows['K'][state]} + i] = slope_{k}"]
    inner += [f"w[{rows['J'][state]} + i] = {rate}" for state, rate in rates.items()]
    lines += over_lanes(inner)
    return (
        f"{_HEAD}def _advance(w, on, t, h, n, restart, drive):\n"
        f'    """Take one step of order {method.order}, from states S with slopes K, kept as Y and F, to the next."""\n'
        "    _rolled()\n"
        "    half = 0.5 * h\n"
        # A loop, for after a branch here the compiler keeps the lanes of the step apart.
        "    for _ in range(1 if restart[n] else 0):\n"
        "        _derivative(w, on, t, drive[n, 0, 0], drive[n, 0, 1], drive[n, 0, 2])\n"
        + "".join(f"    {line}\n" for line in lines)
        + "    _barrier()\n"
    )


def staged_step(
    over: Callable[[str, Sequence[str]], list[str]],
    lanes: int,
    rows: Mapping[str, int],
    awake: Sequence[str],
    forgetting: Sequence[bool],
) -> str:
    """Return a function that takes one step from states S with slopes K, kept as Y and F, to the next.

    `over`: returns the lines of a loop over some places, of its body. `lanes`: parameter sets in one block. `rows`:
    first row of each label. `awake`: the condition under which each state moves. `forgetting`: whether it forgets fast,
    see `discovery.simulation.kernel.fused`.
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

    text = filled(_STAGED.read_text(encoding="utf-8"), rows)
    text = re.sub(
        r"( +)for i in @MOVING@:\n((?:\1    .*\n)+)",
        lambda found: swept(found[1], [line.strip() for line in found[2].splitlines()], False),
        text,
    )
    return re.sub(r"( +)@FORGETTING (\d)@\n", lambda found: swept(found[1], in_rows(int(found[2]), rows), True), text)


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
