"""The text of a kernel: loops over the lanes of one block, all numbers of which lie in one flat array."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from itertools import groupby
from pathlib import Path

import sympy as sp

from discovery.equations.program import RECORDED, Program
from discovery.simulation.kernel.fused import fused_reading, fused_step
from discovery.simulation.kernel.islands import Loop, Plan, plan
from discovery.simulation.kernel.owned_terms import NOBODY, Effects, Piece, Splitter, cost
from discovery.simulation.kernel.straight_line import received
from discovery.simulation.kernel.text import computed
from discovery.simulation.runge_kutta import CLASSICAL, Method

__all__ = ["kernel_source"]

_TEMPLATE, _STAGES, _READING = (Path(__file__).with_name(f"{name}.txt") for name in ("template", "stages", "reading"))
#: Operations below which an effect is evaluated always: loops of its own would cost as much.
_LEAST = 20
#: Operations of a slope up to which a step is one loop: with more, its stages are too long a chain for one set alone.
_SHORT = 40
#: The same for a method of high order, whose fewer slopes are worth some waiting.
_MOST = 160


class _Writer:
    """Writes loops over the lanes; what more than one of them touches has a row in the flat array."""

    def __init__(self, lanes: int, effects: Iterable[str]) -> None:
        self.lanes = lanes
        self.size = 0
        self.guards: dict[Effects, int] = {frozenset({e}): k for k, e in enumerate(effects)}
        self.bodies: list[str] = []

    def rows(self, names: Sequence[str]) -> dict[str, int]:
        """Reserve a row for each name and return where it begins."""
        places = {name: self.size + k * self.lanes for k, name in enumerate(names)}
        self.size += len(names) * self.lanes
        return places

    def condition(self, effects: Effects) -> str:
        """Return the condition under which something runs."""
        if not effects:
            return "True" if effects is None else "False"
        return f"on[{self.guards.setdefault(effects, len(self.guards))}]"

    def over_lanes(self, body: Sequence[str]) -> list[str]:
        """Return the lines of a loop over the lanes; its body is translated apart, see `straight_line`."""
        name, given = f"_body_{len(self.bodies)}", "".join(f"{name}, " for name in received(body))
        text = "\n".join(body)
        self.bodies.append(f'{name} = _straight_line("""\n{text}\n""", globals())\n')
        return [f"for i in range({self.lanes}):", f"    {name}(w, i, ({given}))"]

    def loops(self, loops: Sequence[Loop], places: Mapping[str, int]) -> list[str]:
        """Return the text of loops; `places` holds the rows of what comes in and goes out."""
        touched: dict[str, set[int]] = {}
        for k, loop in enumerate(loops):
            for piece in loop.pieces:
                for symbol in (piece.target, *piece.expression.free_symbols):
                    touched.setdefault(symbol.name, set()).add(k)
        targets = dict.fromkeys(piece.target.name for loop in loops for piece in loop.pieces)
        places = {**places, **self.rows([n for n in targets if n not in places and len(touched[n]) > 1])}
        lines = []
        for loop in loops:
            indent = " " * 4
            if loop.effects is not None:
                lines.append(f"{indent}if {self.condition(loop.effects)}:")
                indent *= 2
            lines += [f"{indent}{line}" for line in self.over_lanes(_body(loop, places))]
            lines.append("    _barrier()")
        return lines or ["    pass"]


def _body(loop: Loop, places: Mapping[str, int]) -> list[str]:
    """Return the lines of one loop: what it loads, computes and stores."""
    loads, lines, own = computed(loop.pieces)
    first = [f"{name} = w[{places[name]} + i]" for name in loads if name in places]
    return first + lines + [f"w[{places[name]} + i] = {name}" for name in own if name in places]


def _single(found: Plan) -> Sequence[Piece] | None:
    """Return the pieces of a plan that is one loop which always runs."""
    return found.loops[0].pieces if len(found.loops) == 1 and found.loops[0].effects is None else None


def _smooth(pieces: Sequence[Piece]) -> bool:
    """Return whether a method of high order may gain: no absolute values, and no roots, which smooth friction has."""
    return not any(
        e.has(sp.Abs, sp.sign, sp.Heaviside, sp.Min, sp.Max, sp.Piecewise)
        or any(not power.exp.is_Integer for power in e.atoms(sp.Pow))
        for e in (piece.expression for piece in pieces)
    )


def _plans(
    program: Program, parameters: Sequence[sp.Symbol], switches: Mapping[str, Sequence[str]]
) -> tuple[Plan, Plan, Mapping[str, Sequence[str]]]:
    """Return the plans of readings and of slopes, and of the effects that can be absent those worth a loop."""
    n = 2 * program.n_coordinates
    readings = [(sp.Symbol(f"reading_{k}", real=True), e) for k, e in enumerate(program.reading)]
    slopes = [(sp.Symbol(f"slope_{k}", real=True), e) for k, e in enumerate(program.slopes)]
    memory = {slopes[k][0]: program.states[k] for k in range(n, len(slopes))}
    while True:
        owners = {sp.Symbol(name, real=True): effect for effect, names in switches.items() for name in names}
        observed = plan(program.drive, readings, switches=owners, parameters=parameters)
        derived = plan(
            (*program.drive, *program.derivative), slopes, switches=owners, parameters=parameters, rates=memory,
            needs=observed.needs,
        )  # fmt: skip
        shares = [derived.shares(), observed.shares()]
        cheap = {e for share in shares for e in share if sum(own.get(e, 0) for own in shares) < _LEAST}
        if not cheap:
            return observed, derived, switches
        switches = {effect: names for effect, names in switches.items() if effect not in cheap}


def kernel_source(
    program: Program, lanes: int, switches: Mapping[str, Sequence[str]], method: Method = CLASSICAL
) -> str:
    """Return the text of a kernel's module.

    Parameters
    ----------
    program : Program
        What it computes.
    lanes : int
        Parameter sets in one block.
    switches : mapping of str to sequence of str
        Effects that can be absent, each with its amplitudes.
    method : Method
        Steps are taken by it where a step is one short loop of smooth terms, by the classical one elsewhere.
    """
    n_q, states = program.n_coordinates, [y.name for y in program.states]
    real = [sp.Symbol(name, real=True) for name in program.parameters]
    observed, derived, switches = _plans(program, real, switches)
    # Rates and memory are interpolated where the reading needs them.
    sampled = [k for k, y in enumerate(program.states) if k >= n_q and observed.needs.get(y, NOBODY) != NOBODY]

    write = _Writer(lanes, switches)
    offset, places = {}, {}
    for label, names in (
        ("P", program.parameters),
        *((label, states) for label in "YSKFA"),
        ("Q", [*states[:n_q], *(states[k] for k in sampled)]),
        ("D", [*(r.name for r in RECORDED), "t"]),
        ("R", [f"reading_{k}" for k in range(len(program.reading))]),
        ("T", ["t"]),
        ("L", ["age"]),
        ("B", [f"hermite_{k}" for k in range(6)]),
        ("G", [f"cubic_{k}" for k in range(4)]),
        ("C", [f"sum_{k}" for k in range(len(program.reading))]),
        ("M", ["largest"]),
    ):
        offset[label] = write.size
        places[label] = write.rows(names)
    known = places["P"]
    owners = {sp.Symbol(name, real=True): effect for effect, names in switches.items() for name in names}
    aged = plan((), [(sp.Symbol("age", real=True), program.lateness)], switches=owners, parameters=real)
    once = []
    texts = []
    rows = dict(known)
    for found, inputs in (
        (
            derived,
            {**places["S"], **dict(zip((f"slope_{k}" for k in range(len(states))), places["K"].values(), strict=True))},
        ),
        (observed, places["Q"] | places["D"] | places["R"]),
        (aged, places["T"] | places["L"]),
    ):
        fixed = write.rows([symbol.name for symbol, _ in found.once])
        pieces = tuple(Piece(symbol, expression) for symbol, expression in found.once)
        once += write.loops([Loop(None, pieces)] if pieces else [], {**known, **fixed})
        rows = rows | fixed
        texts.append(write.loops(found.loops, {**known, **fixed, **inputs}))

    awake = ["True"] * 2 * n_q + [write.condition(derived.needs.get(y, NOBODY)) for y in program.states[2 * n_q :]]
    moving = [
        (condition, [k for k, _ in run]) for condition, run in groupby(enumerate(awake), key=lambda pair: pair[1])
    ]

    def sweep(found: re.Match[str]) -> str:
        """Repeat a loop over the states for those that always move, and for each memory that does."""
        indent, body = found.groups()
        text = ""
        for condition, own in moving:
            loop = f"for i in range({own[0] * lanes}, {(own[-1] + 1) * lanes}):\n{body}"
            text += f"{indent}if {condition}:\n" + re.sub("^(?=.)", "    ", indent + loop, flags=re.MULTILINE)
        return text

    def each(found: re.Match[str]) -> str:
        """Repeat the body of a loop over the channels: row numbers that the compiler knows."""
        body = re.sub("^    ", "", found.group(2), flags=re.MULTILINE)
        return "".join(re.sub(r"\bk\b", str(k), body) for k in range(len(program.reading)))

    lagging = Splitter(owners, real).owner(program.lateness)
    late = "False" if program.lateness == 0 else write.condition(lagging)
    single = {effect: write.guards[frozenset({effect})] for effect in switches}
    amplitudes = [[known[name], single[effect]] for effect, names in switches.items() for name in names]
    members = [[single[e], k] for effects, k in write.guards.items() for e in sorted(effects or ()) if k != single[e]]
    step, read = _single(derived), _single(observed)
    work = sum(1 + cost(piece.expression) for piece in step or ())
    if step is None or set(awake) != {"True"} or work > _MOST or not _smooth(step):
        method = CLASSICAL
    if set(awake) != {"True"} or (method is CLASSICAL and work > _SHORT):
        step = None
    advance, reading = _STAGES.read_text(encoding="utf-8"), _READING.read_text(encoding="utf-8")
    if step is not None:
        loads, body, _ = computed(step)
        advance = fused_step(method, write.over_lanes, {n: rows[n] for n in loads if n in rows}, states, body, places)
    if read is not None:
        loads, body, _ = computed(read)
        q = list(zip(states[:n_q], states[n_q:], strict=False))
        own = {n: rows[n] for n in loads if n in rows}
        reading = fused_reading(write.over_lanes, own, q, [states[k] for k in sampled], body, places)
    text = (
        _TEMPLATE.read_text(encoding="utf-8")
        .replace("@BODIES@\n", "\n".join(write.bodies))
        .replace("@ADVANCE@\n", advance)
        .replace("@READ@\n", reading)
    )
    text = re.sub(r"( +)for i in @MOVING@:\n((?:\1    .*\n)+)", sweep, text)
    text = re.sub(r"( +)for k in @CHANNELS@:\n((?:\1    .*\n)+)", each, text)
    for key, value in {
        "LANES": lanes,
        "N_PARAMETERS": len(real),
        "N_STATES": len(states),
        "N_Q": n_q,
        "N_V": len(sampled),
        "SAMPLED": sampled or [0],
        "N_READING": len(program.reading),
        "SIZE": write.size,
        "SUMS": (len(program.reading) + 1) * lanes,
        "ORDER": method.order,
        "SCORES": read is not None,
        "LAST": len(method.times) - 1,
        "N_GUARDS": len(write.guards) + 1,
        "LATE": late,
        "LAGGING": " or ".join(
            f"w[{row} + i] != 0.0" for row, k in amplitudes if k in {single[e] for e in lagging or ()}
        )
        or "True",
        "AMPLITUDES": amplitudes,
        "MEMBERS": members,
        "ONCE": "\n".join(once),
        "DERIVATIVE": "\n".join(texts[0]),
        "OBSERVE": "\n".join(texts[1]),
        "AGE": "\n".join(texts[2]),
        **offset,
    }.items():
        text = text.replace(f"@{key}@", str(value))
    return text
