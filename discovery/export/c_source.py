"""A model as C that allocates nothing: slopes, reading, initial state, a step of fixed length, and a simulator."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import sympy as sp
from sympy.printing.c import C99CodePrinter

from discovery.equations.model import Model
from discovery.export.fitted import FittedModel, fitted_model
from discovery.export.source import integration_step
from discovery.export.source_text import comment, composition, filled, indented, initial_states, input_words, origin
from discovery.export.symbolic import Assignments, SymbolicModel, equation_text, in_parts, needed, program_of
from discovery.foundation.errors import InputError

if TYPE_CHECKING:
    from discovery.estimation.fit import Fit

#: Span of time over which the largest lateness is looked for [s].
_SPAN = 100.0


class _Printer(C99CodePrinter):
    """Prints sympy as C; powers become products and roots, as in the kernel."""

    def __init__(self) -> None:
        super().__init__({"precision": 17})

    def _print_Pow(self, expr):
        base, exponent = expr.as_base_exp()
        if exponent.is_Rational and exponent.q in (1, 2, 4) and 0 < abs(exponent.p) <= 12:
            factor = self._print(base)
            for _ in range(exponent.q // 2):
                factor = f"sqrt({factor})"
            # A function: an expression written out again for each factor would double at every level.
            product = f"power({factor}, {abs(exponent.p)})" if abs(exponent.p) > 1 else f"({factor})"
            return product if exponent > 0 else f"(1.0/{product})"
        return f"pow({self._print(base)}, {self._print(exponent)})"

    def _print_Integer(self, expr):
        return f"{int(expr)}.0"

    def _print_Rational(self, expr):
        return repr(float(expr))

    def _print_Pi(self, expr):
        return repr(math.pi)


_printed = _Printer().doprint


def _body(
    program: SymbolicModel, results: Sequence[sp.Expr], into: str, *, arrays: Mapping[str, Sequence[sp.Symbol]],
    assignments: Assignments = (), unused: Iterable[str] = (),
) -> str:  # fmt: skip
    """Return the body of a function that computes results from arrays."""
    used = {x for e in (*results, *(e for _, e in assignments)) for x in e.free_symbols}
    lines = [
        f"const double {symbol.name} = {array}[{k}];"
        for array, symbols in {**arrays, "parameters_": program.parameters}.items()
        for k, symbol in enumerate(symbols)
        if symbol in used
    ]
    lines += [f"const double {a.name} = {_printed(e)};" for a, e in assignments]
    lines += [f"(void){name};" for name in (*arrays, "parameters_", *unused)]
    if into == "return":
        return indented([*lines, f"return {_printed(results[0])};"])
    return indented([*lines, *(f"{into}[{k}] = {_printed(e)};" for k, e in enumerate(results))])


def _history(found: FittedModel, program: SymbolicModel, step: float) -> int:
    """Return twice as many steps as the oldest state that is read lies behind, and two."""
    names = [sp.Symbol("t", real=True), *program.parameters]
    late = sp.lambdify(names, program.lateness, "math")
    numbers = [found.values[p.name] for p in program.parameters]
    oldest = max(float(late(_SPAN * k / 1000, *numbers)) for k in range(1001))
    return 2 + 2 * math.ceil(max(oldest, 0.0) / step)


def _head(found: FittedModel) -> str:
    """Return the comment at the top of both files."""
    effects = [f"{e.id()}: {e.title()}." for e in found.model.terms]
    title = f"Equations of motion: base {composition(found)}."
    starts = ["", *initial_states(found)] if found.initial else []
    return comment([title, "", *effects, "", *equation_text(found.model), *starts, "", *origin(found)])


def _places(found: FittedModel, name: str) -> str:
    rows = []
    for parameter, declared in found.model.parameters.items():
        about = comment([f"{found.unit_of(parameter)}: {declared.meaning}"]).removeprefix(" * ")
        rows.append(f"{name.upper()}_{parameter}, /* {about} */")
    return indented(rows)


def _values(found: FittedModel) -> str:
    rows = []
    for parameter in found.model.parameters:
        sd = found.sd.get(parameter, math.nan)
        spread = f" +- {sd:.2g}" if math.isfinite(sd) else ""
        rows.append(f"{found.values[parameter]!r}, /* {parameter}{spread} */")
    return indented(rows or ["0.0"])


def _functions(program: SymbolicModel) -> dict[str, str]:
    """Return the bodies of the functions that the model defines."""
    states = {"state_": program.states, "input_": program.recorded}
    received = needed(program.drive, program.reading)
    parts, initial = in_parts(program.initial)
    return {
        "DERIVATIVE": _body(
            program, program.slopes, "slope_", arrays=states, unused=["t"],
            assignments=needed((*program.drive, *program.assignments), program.slopes),
        ),
        "READING": _body(
            program, program.reading, "reading_", arrays=states, assignments=received, unused=["t"]
        ),
        "LATENESS": _body(program, [program.lateness], "return", arrays={}, unused=["t"]),
        "INITIAL": _body(
            program, initial, "state_", arrays={"input_": program.recorded}, assignments=parts,
            unused=["deflection", "rate"],
        ),
    }  # fmt: skip


def _fields(found: FittedModel, name: str) -> dict[str, Any]:
    """Return the fields of the templates."""
    program, step = program_of(found.model), integration_step(found)
    words, functions = input_words(found.model, program), _functions(program)
    return {
        "NAME": name,
        "NAME_UPPER": name.upper(),
        "HEAD": _head(found),
        "POWER": any("power(" in body for body in functions.values()),
        "MOVES": found.model.mechanics.input_moves,
        "STATES": ", ".join(y.name for y in program.states),
        "N_STATES": len(program.states),
        "INPUTS": words["INPUTS"],
        "N_INPUTS": len(program.recorded),
        "READINGS": words["READING_WORDS"],
        "N_READINGS": len(program.reading),
        "JUMPS": words["JUMPS"],
        "STEP": repr(step),
        "HISTORY": _history(found, program, step),
        "PLACES": _places(found, name),
        "VALUES": _values(found),
        # C has no array of no elements.
        "AT_LEAST": "" if found.model.parameters else " + 1",
        "N": program.n_coordinates,
        **functions,
    }


def to_c(
    source: FittedModel | Fit | Model, values: Mapping[str, float] | None = None, name: str = "model"
) -> tuple[str, str]:
    """Return a model as C99, a header and a source that need the mathematical library alone and allocate nothing.

    They are the texts of ``NAME.h`` and ``NAME.c``, and all names in them begin with `name`. They declare the
    parameters, ``derivative``, ``reading``, ``lateness``, ``initial_state``, and for a motion ``start``, ``step`` (the
    kernel's Runge-Kutta step), ``read`` (the instrument, also a late one) and ``simulate``. `values` replace those of
    `source` [SI, radians].

    InputError if a parameter has no value, or the name is none in C.
    """
    if not re.fullmatch(r"[a-z][a-z0-9_]*", name):
        raise InputError(f"{name!r} is no name in C; take small letters, digits and underscores, a letter first.")
    fields = _fields(fitted_model(source, values), name)
    return filled("c_header.txt", fields), filled("c_source.txt", fields)
