"""The text of a kernel: loops over the lanes of one block, all numbers of which lie in one flat array."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from itertools import groupby
from pathlib import Path

import sympy as sp
from sympy.printing.pycode import PythonCodePrinter

from discovery.islands import Loop, Plan, plan
from discovery.owned_terms import NOBODY, Effects, Piece, Splitter
from discovery.program import RECORDED, Program

__all__ = ["assignments", "kernel_source", "printed"]

_TEMPLATE = Path(__file__).with_name("kernel_template.txt")
#: Operations below which an effect is evaluated always: loops of its own would cost as much.
_LEAST = 40


class _Printer(PythonCodePrinter):
    """Prints sympy as Python that both numpy and the compiler read; powers become products."""

    def _print_Pow(self, expr, rational=False):
        base, exponent = expr.as_base_exp()
        if exponent.is_Rational and exponent.q in (1, 2, 4) and 0 < abs(exponent.p) <= 12:
            factor = f"({self._print(base)})"
            for _ in range(exponent.q // 2):
                factor = f"_sqrt({factor})"
            product = "*".join([factor] * abs(exponent.p))
            return f"({product})" if exponent > 0 else f"(1.0/({product}))"
        return f"({self._print(base)})**({self._print(exponent)})"

    def _print_sin(self, expr):
        return f"_sin({self._print(expr.args[0])})"

    def _print_cos(self, expr):
        return f"_cos({self._print(expr.args[0])})"

    def _print_atan2(self, expr):
        return f"_atan2({self._print(expr.args[0])}, {self._print(expr.args[1])})"

    def _print_atan(self, expr):
        return f"_atan2({self._print(expr.args[0])}, 1.0)"

    def _print_exp(self, expr):
        return f"_exp({self._print(expr.args[0])})"

    def _print_Rational(self, expr):
        return repr(float(expr))

    def _print_Integer(self, expr):
        return f"{int(expr)}.0"

    def _print_Pi(self, expr):
        return repr(float(sp.pi))


printed = _Printer({"fully_qualified_modules": True}).doprint


def assignments(pairs: Iterable[tuple[sp.Symbol, sp.Expr]], indent: str) -> list[str]:
    """Return one line of text for each assignment."""
    return [f"{indent}{symbol.name} = {printed(expression)}" for symbol, expression in pairs]


class _Writer:
    """Writes loops over the lanes; what more than one of them touches has a row in the flat array."""

    def __init__(self, lanes: int, effects: Iterable[str]) -> None:
        self.lanes = lanes
        self.size = 0
        self.guards: dict[Effects, int] = {frozenset({e}): k for k, e in enumerate(effects)}

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
            lines.append(f"{indent}for i in range({self.lanes}):")
            lines += [f"{indent}    {line}" for line in _body(loop, places)]
            lines.append("    _barrier()")
        return lines or ["    pass"]


def _body(loop: Loop, places: Mapping[str, int]) -> list[str]:
    """Return the lines of one loop: what it loads, computes and stores."""
    own: dict[str, None] = {}
    loads: dict[str, None] = {}
    lines = []
    for piece in loop.pieces:
        name, text = piece.target.name, printed(piece.expression)
        read = sorted(symbol.name for symbol in piece.expression.free_symbols)
        loads.update(dict.fromkeys(x for x in [*read, *([name] if piece.adds else [])] if x not in own))
        own[name] = None
        lines.append(f"{name} = {name} + {text}" if piece.adds else f"{name} = {text}")
    first = [f"{name} = w[{places[name]} + i]" for name in loads if name in places]
    return first + lines + [f"w[{places[name]} + i] = {name}" for name in own if name in places]


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


def kernel_source(program: Program, lanes: int, switches: Mapping[str, Sequence[str]]) -> str:
    """Return the text of a kernel's module.

    Parameters
    ----------
    program : Program
        What it computes.
    lanes : int
        Parameter sets in one block.
    switches : mapping of str to sequence of str
        Effects that can be absent, each with its amplitudes.
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
    ):
        offset[label] = write.size
        places[label] = write.rows(names)
    known = places["P"]
    owners = {sp.Symbol(name, real=True): effect for effect, names in switches.items() for name in names}
    aged = plan((), [(sp.Symbol("age", real=True), program.lateness)], switches=owners, parameters=real)
    once = []
    texts = []
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

    lagging = Splitter(owners, real).owner(program.lateness)
    late = "False" if program.lateness == 0 else write.condition(lagging)
    single = {effect: write.guards[frozenset({effect})] for effect in switches}
    amplitudes = [[known[name], single[effect]] for effect, names in switches.items() for name in names]
    members = [[single[e], k] for effects, k in write.guards.items() for e in sorted(effects or ()) if k != single[e]]
    text = re.sub(r"( +)for i in @MOVING@:\n((?:\1    .*\n)+)", sweep, _TEMPLATE.read_text(encoding="utf-8"))
    for key, value in {
        "LANES": lanes,
        "N_PARAMETERS": len(real),
        "N_STATES": len(states),
        "N_Q": n_q,
        "N_V": len(sampled),
        "SAMPLED": sampled or [0],
        "N_READING": len(program.reading),
        "SIZE": write.size,
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
