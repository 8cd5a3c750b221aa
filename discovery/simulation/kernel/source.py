"""The text of a kernel: loops over the lanes of one block, all numbers of which lie in one flat array."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import sympy as sp

from discovery.equations.program import RECORDED, Program
from discovery.simulation.kernel.fused import fused_step, staged_step
from discovery.simulation.kernel.islands import NOBODY, Effects, Loop, Piece, Plan, Splitter, cost, plan
from discovery.simulation.kernel.lanes import PLACES
from discovery.simulation.kernel.reading import fused_reading, late_interpolation, misses, reading
from discovery.simulation.kernel.straight_line import received
from discovery.simulation.kernel.text import computed, filled
from discovery.simulation.runge_kutta import CLASSICAL, Method

_TEMPLATE = Path(__file__).with_name("template.txt")
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
        self.bodies: dict[str, str] = {}

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
        """Return the lines of a loop over the lanes."""
        return self.over(f"range({self.lanes})", body)

    def over(self, places: str, body: Sequence[str]) -> list[str]:
        """Return the lines of a loop; its body is translated apart, see `straight_line`."""
        text = "\n".join(body)
        name = self.bodies.setdefault(text, f"_body_{len(self.bodies)}")
        return [f"for i in {places}:", f"    {name}(w, i, ({''.join(f'{x}, ' for x in received(body))}))"]

    def written(self) -> str:
        """Return the text of the bodies of all loops."""
        return "\n".join(f'{n} = _straight_line("""\n{t}\n""", globals())\n' for t, n in self.bodies.items())

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


def _rate(state: sp.Symbol) -> sp.Symbol:
    """Return the symbol of how fast a state forgets at most."""
    return sp.Symbol(f"rate_of_{state.name}", real=True)


def _plans(
    program: Program, parameters: Sequence[sp.Symbol], switches: Mapping[str, Sequence[str]]
) -> tuple[Plan, Plan, Mapping[str, Sequence[str]]]:
    """Return the plans of readings and of slopes, and of the effects that can be absent those worth a loop."""
    n = 2 * program.n_coordinates
    readings = [(sp.Symbol(f"reading_{k}", real=True), e) for k, e in enumerate(program.reading)]
    slopes = [(sp.Symbol(f"slope_{k}", real=True), e) for k, e in enumerate(program.slopes)]
    memory = {slopes[k][0]: program.states[k] for k in range(n, len(slopes))}
    forgets = [(_rate(z), e) for z, e in program.relaxation]
    memory |= {_rate(z): z for z, _ in program.relaxation}
    while True:
        owners = {sp.Symbol(name, real=True): effect for effect, names in switches.items() for name in names}
        observed = plan(program.drive, readings, switches=owners, parameters=parameters)
        derived = plan(
            (*program.drive, *program.derivative), slopes + forgets, switches=owners, parameters=parameters,
            rates=memory, needs=observed.needs,
        )  # fmt: skip
        shares = [derived.shares(), observed.shares()]
        # A state costs more than its terms: it sleeps while its effect is absent.
        asleep = {e for z in memory.values() for e in derived.needs.get(z) or ()}
        cheap = {e for share in shares for e in share if sum(own.get(e, 0) for own in shares) < _LEAST} - asleep
        if not cheap:
            return observed, derived, switches
        switches = {effect: names for effect, names in switches.items() if effect not in cheap}


def _indented(lines: Sequence[str], depth: int) -> str:
    return "\n".join(f"{' ' * 4 * depth}{line}" for line in lines)


def kernel_source(
    program: Program, lanes: int, switches: Mapping[str, Sequence[str]], method: Method = CLASSICAL
) -> str:
    """Return the text of a kernel's module.

    `program`: what it computes. `lanes`: parameter sets in one block. `switches`: effects that can be absent, each with
    its amplitudes. `method`: steps are taken by it where a step is one short loop of smooth terms, by the classical one
    elsewhere.
    """
    n_q, states = program.n_coordinates, [y.name for y in program.states]
    rates = {z.name: _rate(z).name for z, _ in program.relaxation}
    real = [sp.Symbol(name, real=True) for name in program.parameters]
    observed, derived, switches = _plans(program, real, switches)
    # Rates and memory are interpolated where the reading needs them.
    sampled = [k for k, y in enumerate(program.states) if k >= n_q and observed.needs.get(y, NOBODY) != NOBODY]

    write = _Writer(lanes, switches)
    offset, places = {}, {}
    for label, names in (
        ("P", program.parameters),
        *((label, states) for label in "YSKFA"),
        *((label, states if rates else ()) for label in "JGUV"),
        ("Q", [*states[:n_q], *(states[k] for k in sampled)]),
        ("D", [*(r.name for r in RECORDED), "t"]),
        ("R", [f"reading_{k}" for k in range(len(program.reading))]),
        ("T", ["t"]),
        ("L", ["age"]),
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
            {
                **places["S"],
                **dict(zip((f"slope_{k}" for k in range(len(states))), places["K"].values(), strict=True)),
                **{rate: places["J"][z] for z, rate in rates.items()},
            },
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
    lagging = Splitter(owners, real).owner(program.lateness)
    late = "False" if program.lateness == 0 else write.condition(lagging)
    single = {effect: write.guards[frozenset({effect})] for effect in switches}
    amplitudes = [[known[name], single[effect]] for effect, names in switches.items() for name in names]
    members = [[single[e], k] for effects, k in write.guards.items() for e in sorted(effects or ()) if k != single[e]]
    step, read = _single(derived), _single(observed)
    work = sum(1 + cost(piece.expression) for piece in step or ())
    if step is None or set(awake) != {"True"} or work > _MOST or rates or not _smooth(step):
        method = CLASSICAL
    if set(awake) != {"True"} or (method is CLASSICAL and work > _SHORT):
        step = None
    q = list(zip(states[:n_q], states[n_q:], strict=False))
    others = [states[k] for k in sampled]
    if step is not None:
        loads, body, _ = computed(step)
        own = {n: rows[n] for n in loads if n in rows}
        advance = fused_step(method, write.over_lanes, own, states, body, places, rates=rates)
    else:
        advance = staged_step(write.over, lanes, offset, awake, [y in rates for y in states])
    if read is not None:
        loads, body, _ = computed(read)
        own = {n: rows[n] for n in loads if n in rows}
        readings = fused_reading(write.over_lanes, own, q, others, body, places)
    else:
        readings = reading(write.over_lanes, q, others, places)
    channels = range(len(program.reading))
    missed = [line for k in channels for line in misses(write.over_lanes, k, places, late)]
    between = late_interpolation(write.over_lanes, q, others, places, len(method.times) - 1)
    # The angle of the tip and its distance from the axis are made of two coordinates.
    planar = len(channels) == 2
    text = _TEMPLATE.read_text(encoding="utf-8")
    values: dict[str, object] = {
        "ADVANCE": advance,
        "READ": readings,
        "INTERPOLATE": _indented(between, 2),
        "MISSES": _indented(missed, 5),
        "BODIES": write.written(),
        "LANES": lanes,
        "N_PARAMETERS": len(real),
        "N_STATES": len(states),
        "SIZE": write.size,
        "SUMS": len(channels) + 1,
        "ORDER": method.order,
        "SCORES": read is not None,
        "DIRECT": "not channel" if late == "False" else f"not (channel or {late})",
        "READS": read is None or planar or late != "False",
        "PLANAR": planar,
        "N_GUARDS": len(write.guards) + 1,
        "LATE": late,
        "LAGS": [row for row, k in amplitudes if k in {single[e] for e in lagging or ()}],
        "AMPLITUDES": amplitudes,
        "MEMBERS": members,
        "ONCE": "\n".join(once),
        "DERIVATIVE": "\n".join(texts[0]),
        "OBSERVE": "\n".join(texts[1]),
        "AGE": "\n".join(texts[2]),
        **offset,
    }
    return filled(text, values | {"AT": [values[name] for name in PLACES]})
