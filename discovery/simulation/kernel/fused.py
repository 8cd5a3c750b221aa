"""Text of a step as one loop over the lanes that keeps its numbers in registers.

It serves where everything always runs; the general text goes through memory between the stages of a step.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from itertools import groupby
from pathlib import Path

from discovery.simulation.kernel.forgetting import in_rows, renamed
from discovery.simulation.kernel.text import filled
from discovery.simulation.runge_kutta import Method

_HEAD = "@_inner\n"

_STAGED = Path(__file__).with_name("stages.txt")


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
    see `discovery.simulation.kernel.forgetting`.
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
