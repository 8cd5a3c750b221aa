"""A model as Python source that needs numpy alone: slopes, reading, initial state and a simulator."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING

import sympy as sp
from sympy.printing.numpy import NumPyPrinter

from discovery.declarations import symbols as s
from discovery.equations.model import Model
from discovery.export.fitted import FittedModel, fitted_model
from discovery.export.source_text import composition, docstring, filled, indented, initial_states, input_words, origin
from discovery.export.symbolic import Assignments, SymbolicModel, equation_text, in_parts, program_of, substituted

if TYPE_CHECKING:
    from discovery.estimation.fit import Fit

_STACKED = "np.array(np.broadcast_arrays({}))"
#: Where nothing in it need depend on the state.
_SHAPED = "np.array(np.broadcast_arrays({}, state[0]))[:-1]"
#: The same of what `_slopes` returns.
_SLOPES = {False: _STACKED.format("*slopes"), True: _SHAPED.format("*slopes")}


def _symbols(*expressions: sp.Expr) -> set[sp.Basic]:
    return set().union(*[e.free_symbols for e in expressions])


def _used(names: Iterable[str], expressions: Iterable[sp.Expr]) -> list[str]:
    used = {symbol.name for e in expressions for symbol in e.free_symbols}
    return [n for n in names if n in used]


def _body(
    printer: NumPyPrinter, program: SymbolicModel, results: Sequence[sp.Expr], *, drive: Assignments = (),
    parts: Assignments = (), states: Sequence[sp.Symbol] = (), returns: str = _STACKED,
) -> str:  # fmt: skip
    """Return the indented body of a function that returns the results."""
    lines = []
    names = _used([p.name for p in program.parameters], [*results, *dict(drive).values(), *dict(parts).values()])
    if names:
        lines.append(f"{', '.join(names)}{',' * (len(names) == 1)} = (parameters[n] for n in {tuple(names)!r})")
    if states:
        lines.append(f"{', '.join(y.name for y in states)}, *_ = state")
    lines += _received(printer, drive)
    lines += [f"{a.name} = {printer.doprint(e)}" for a, e in parts]
    lines.append(f"return {returns.format(', '.join(printer.doprint(e) for e in results))}")
    return indented(lines)


def _slopes(
    printer: NumPyPrinter, program: SymbolicModel, drive: Assignments, inputs: Sequence[sp.Symbol]
) -> tuple[list[str], str]:
    """Return the parameters of the slopes, and the body that returns these, of one type so that it compiles."""

    def printed(expression: sp.Expr) -> str:
        return repr(float(expression)) if expression.is_Integer else str(printer.doprint(expression))

    needed = [*program.slopes, *dict(program.assignments).values(), *dict(drive).values()]
    names = _used([p.name for p in program.parameters], needed)
    places = {"numbers": names, "state": [y.name for y in program.states], "inputs": [u.name for u in inputs]}
    lines = [
        f"{name} = {array}[{k}]"
        for array, its in places.items()
        for k, name in enumerate(its)
        if name in _used(its, needed)
    ]
    lines += _received(printer, drive)
    lines += [f"{a.name} = {printed(e)}" for a, e in program.assignments]
    return names, indented([*lines, f"return ({', '.join(map(printed, program.slopes))},)"])


def _received(printer: NumPyPrinter, drive: Assignments) -> list[str]:
    """Return the line that makes what the system receives of what was recorded, all at once: names may be the same."""
    left, right = ", ".join(a.name for a, _ in drive), ", ".join(printer.doprint(e) for _, e in drive)
    return [f"{left} = {right}"] if left != right else []


def _text(found: FittedModel, arm: bool, inputs: str) -> str:
    """Return the docstring of the module."""
    effects = [f"{e.id()}: {e.title()}." for e in found.model.terms]
    unit = "q is the unit of the coordinate" if not arm else "deflection = theta_t - theta_m"
    read = ("x", "y") if arm else found.model.mechanics.channels
    use = f"{', '.join(read) if len(read) > 1 else f'({read[0]},)'} = simulate(time, {inputs})"
    return docstring(
        "\n".join(effects),
        "\n".join(equation_text(found.model)),
        f"SI units, radians; {unit}. Needs numpy alone:\n\n    {use}",
        "\n".join(initial_states(found)),
        "\n".join(origin(found)),
    )


def _parameters(found: FittedModel) -> str:
    lines = []
    for name, parameter in found.model.parameters.items():
        sd = found.sd.get(name, math.nan)
        spread = f" +- {sd:.2g}" if math.isfinite(sd) else ""
        unit = found.unit_of(name)
        lines.append(f'    "{name}": {found.values[name]!r},  # {unit}: {parameter.meaning}{spread}')
    return "\n".join(lines)


def integration_step(found: FittedModel) -> float:
    """Return the step of the fit, else one that resolves the highest frequency."""
    if math.isfinite(found.step):
        return found.step
    slow = math.sqrt(abs(found.values.get("alpha", 1.0))) or 1.0
    return min(0.05 / slow, 0.25 / (slow * found.model.mechanics.highest_frequency(found.values)))


def to_numpy(source: FittedModel | Fit | Model, values: Mapping[str, float] | None = None) -> str:
    """Return a model as Python source that needs numpy alone.

    The source defines ``PARAMETERS``, ``derivative``, ``reading``, ``lateness``, ``initial_state`` and ``simulate``;
    sensors, lateness, drive, memory and input are included, so it gives what the instrument would read. Its functions
    broadcast over samples and parameter sets.

    Parameters
    ----------
    source : FittedModel, Fit or Model
        What to export.
    values : mapping of str to float, optional
        Numbers that replace those of `source` [SI, radians].

    Raises
    ------
    InputError
        If a parameter has no value.

    Examples
    --------
    >>> model = Model("oscillator", ("viscous_damping", "linear_stiffness"))
    >>> values = {"xi": 0.16, "alpha": 400.0, "g": 0.0}  # s^-1, s^-2
    >>> "def simulate" in to_numpy(model, values)
    True
    """
    found = fitted_model(source, values)
    base, program = found.model.mechanics, program_of(found.model)
    arm, moves = base.system.has_rod, base.input_moves
    words = input_words(found.model, program)
    inputs = sp.symbols(words["INPUTS"], real=True, seq=True)
    if moves and not arm:
        program = substituted(program, dict(zip((s.theta_m, s.omega_m, s.alpha_m), inputs, strict=True)))
    names = dict(zip(program.recorded, inputs, strict=True))
    drive = tuple((a, e.xreplace(names)) for a, e in program.drive)
    # What the reading needs of the input: of an arm's, the angle of the hub.
    reported = _symbols(*program.reading)
    received = drive[:1] if arm else tuple((a, e) for a, e in drive if a in reported)
    needs = _symbols(*dict(received).values())
    read = [k for k, symbol in enumerate(inputs) if symbol in needs or (arm and k == 0)]
    printer = NumPyPrinter({"fully_qualified_modules": False})
    body = partial(_body, printer, program)
    names_of_slopes, slopes = _slopes(printer, program, drive, inputs)
    parts, initial = in_parts([e.xreplace(names) for e in program.initial])
    n = program.n_coordinates
    seen = reported | needs
    memory = bool(seen & set(program.states[2 * n :]))
    moving = memory or bool(seen & set(program.states[n : 2 * n]))
    sampled = program.states if memory else program.states[: 2 * n if moving else n]
    fields = {
        "TITLE": f"Equations of motion: base {composition(found)}.",
        "TEXT": _text(found, arm, words["INPUTS"]),
        "PARAMETERS": _parameters(found),
        "STEP": repr(integration_step(found)),
        "STATES": ", ".join(y.name for y in program.states),
        "N_STATES": len(program.states),
        "N_READING": len(program.reading),
        "NAMES": repr(tuple(names_of_slopes)),
        "SLOPES": slopes,
        "DERIVATIVE": _SLOPES[base.prescribed],
        "READING": body(
            program.reading, drive=received, states=sampled, returns=_STACKED if base.reads_state else _SHAPED
        ),
        "LATENESS": body((program.lateness,), returns="{}"),
        "INITIAL": body(initial, parts=parts),
        "ARM": arm,
        "MOVES": moves,
        "LATE": program.lateness != 0,
        "MOVING": moving,
        "MEMORY": memory,
        "READ": read,
        "READ_INPUT": "".join(f"{inputs[k]}, " for k in read),
        **words,
        "N": n,
    }
    functions = ", ".join(sorted(printer.module_imports["numpy"]))
    fields["FUNCTIONS"] = f"from numpy import {functions}\n" if functions else ""
    return filled("model_template.txt", fields)
