"""A model as Python source that needs numpy alone: slopes, reading, initial state and a simulator."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import sympy as sp
from sympy.printing.numpy import NumPyPrinter

from discovery.effect import ARM
from discovery.export.fitted import FittedModel, fitted_model, reader_unit
from discovery.export.header import docstring, origin
from discovery.export.symbolic import Assignments, SymbolicModel, equation_text, program_of
from discovery.model import Model

if TYPE_CHECKING:
    from discovery.fit import Fit

__all__ = ["to_numpy"]

_TEMPLATE = Path(__file__).with_name("model_template.txt")
#: Arguments of the exported functions for what was recorded, by whether the system is an arm.
_INPUTS = {True: ("theta_m", "theta_m_dot", "theta_m_ddot"), False: ("u",)}

_ARM_DRIVE = '''def _drive(time, inputs, piece, fraction):
    """Return the motor's angle, rate and acceleration at fractions of the intervals between samples."""
    samples = np.array([np.broadcast_to(np.asarray(v, float), time.shape) for v in inputs])
    return np.array(_hermite(fraction, np.diff(time)[piece], samples[:, piece], samples[:, piece + 1]))'''

_INPUT_DRIVE = '''def _drive(time, inputs, piece, fraction):
    """Return the input at fractions of the intervals between samples."""
    (u,) = inputs
    at = time[piece] + fraction * np.diff(time)[piece]
    if callable(u):
        return np.broadcast_to(np.asarray(u(at), float), at.shape)[None]
    samples = np.broadcast_to(np.asarray(u, float), time.shape)
    return ((1.0 - fraction) * samples[piece] + fraction * samples[piece + 1])[None]'''

_READ = '''def _read(time, begin, h, states, slopes, first, drive, inputs, parameters):
    """Return the readings at the sample times."""
    everything = np.concatenate([states[0], states[1, -1:]])[first].swapaxes(0, 1)
    return reading(time[:, None], everything, @SAMPLED@parameters)'''

_READ_LATE = '''def _read(time, begin, h, states, slopes, first, drive, inputs, parameters):
    """Return the readings at the sample times, of the state as it was a little earlier."""
    lanes = np.arange(states.shape[-1])
    at = time[:, None] - np.broadcast_to(lateness(time[:, None], parameters), (time.size, lanes.size))
    i = np.clip(np.searchsorted(begin, at, side="right") - 1, 0, begin.size - 1)
    step = h[i]
    f = (at - begin[i]) / step
    ends = [[x[k, i, :, lanes[None]] for x in (states, slopes)] for k in (0, 1)]
    n = @N@
    both = [np.moveaxis(np.stack([y[..., :n], v[..., :n], v[..., n : 2 * n]]), -1, 1) for y, v in ends]@MOTOR@
    between = _hermite(f, step, *both)[0]
    # Before the first or after the last step: Taylor's series from the nearer end.
    before, after = f * step, (f - 1.0) * step
    early = both[0][0] + before * both[0][1] + 0.5 * before**2 * both[0][2]
    late = both[1][0] + after * both[1][1] + 0.5 * after**2 * both[1][2]
    state = np.where(f < 0.0, early, np.where(f > 1.0, late, between))@RATES@
    return reading(at, state, @LATE_INPUT@parameters)'''

_MOTOR = """
    angle = [np.asarray(drive[k])[:, None, i] for k in (0, 2)]
    both = [np.concatenate([y, a], axis=1) for y, a in zip(both, angle, strict=True)]"""

#: Where the reading needs rates as well.
_RATES = """
    early, late = (end[1] + away * end[2] for end, away in zip(both, (before, after), strict=True))
    rate = np.where(f < 0.0, early, np.where(f > 1.0, late, _hermite(f, step, *both)[1]))
    state = np.concatenate([state[:n], rate[:n], state[n:]])"""

#: Where it needs states of memory, of which only value and slope are known.
_MEMORY = """
    (z0, z1), (dz0, dz1) = ([np.moveaxis(end[k][..., 2 * n :], -1, 0) for end in ends] for k in (0, 1))
    turn = f * (1.0 - f) * ((1.0 - f) * (step * dz0 + z0 - z1) - f * (step * dz1 + z0 - z1))
    memory = np.where(f < 0.0, z0 + before * dz0, np.where(f > 1.0, z1 + after * dz1, z0 + f * (z1 - z0) + turn))
    state = np.concatenate([state[: 2 * n], memory, state[2 * n :]])"""


#: What differs between the systems in the template.
_ARM_WORDS = {
    "SAMPLED": "np.broadcast_to(np.asarray(inputs[0], float), time.shape)[:, None], ",
    "LATE_INPUT": "state[-1], ",
    "READ_INPUT": "theta_m, ",
    "START_ARGUMENTS": ", theta_m=0.0, theta_m_dot=0.0",
    "START_VALUES": ", *drive[0][:2, 0]",
    "INPUTS": "theta_m, theta_m_dot, theta_m_ddot",
    "INPUT_WORDS": "theta_m and its derivatives: the recorded motor angle [rad, rad/s, rad/s^2]",
    "READING_WORDS": "tip x, y [m]",
    "JUMPS": "the motor's acceleration",
    "SIMULATE_WORDS": "theta_m, theta_m_dot, theta_m_ddot: the motor's angle, rate and acceleration at these times.",
}
_OSCILLATOR_WORDS = {
    **dict.fromkeys(("SAMPLED", "LATE_INPUT", "READ_INPUT", "START_ARGUMENTS", "START_VALUES"), ""),
    "INPUTS": "u",
    "INPUT_WORDS": "u: the recorded input",
    "READING_WORDS": "the output",
    "JUMPS": "the input",
    "SIMULATE_WORDS": "u: the input at these times, straight in between, or a function of time.",
}


def _used(names: Iterable[str], expressions: Iterable[sp.Expr]) -> list[str]:
    used = {symbol.name for e in expressions for symbol in e.free_symbols}
    return [n for n in names if n in used]


def _body(
    printer: NumPyPrinter,
    program: SymbolicModel,
    results: Sequence[sp.Expr],
    *,
    assignments: Assignments = (),
    drive: Assignments = (),
    states: Sequence[sp.Symbol] = (),
    returns: str = "np.array(np.broadcast_arrays({}))",
) -> str:
    """Return the indented body of a function that returns the results."""
    needed = [*results, *[e for _, e in (*assignments, *drive)]]
    lines = []
    names = _used([p.name for p in program.parameters], needed)
    if names:
        lines.append(f"{', '.join(names)}{',' * (len(names) == 1)} = (parameters[n] for n in {tuple(names)!r})")
    if states:
        lines.append(f"{', '.join(y.name for y in states)}, *_ = state")
    left, right = ", ".join(a.name for a, _ in drive), ", ".join(printer.doprint(e) for _, e in drive)
    # All at once: what the system receives has the names of what was recorded.
    if left != right:
        lines.append(f"{left} = {right}")
    lines += [f"{a.name} = {printer.doprint(e)}" for a, e in assignments]
    lines.append(f"return {returns.format(', '.join(printer.doprint(e) for e in results))}")
    return "\n".join(f"    {line}" for line in lines)


def _text(found: FittedModel, arm: bool) -> str:
    """Return the docstring of the module."""
    effects = [f"{e.id()}: {e.title()}." for e in found.model.terms]
    unit = "q is the unit of the output" if not arm else "deflection = theta_t - theta_m"
    use = "x, y = simulate(time, theta_m, theta_m_dot, theta_m_ddot)" if arm else "(output,) = simulate(time, u)"
    starts = [f"{n}: deflection {d:.9g}, rate {r:.9g}" for n, (d, r) in found.initial.items()]
    return docstring(
        "\n".join(effects),
        "\n".join(equation_text(found.model)),
        f"SI units, radians; {unit}. Needs numpy alone:\n\n    {use}",
        "\n".join(["Initial states of the recordings:", *starts]) if starts else "",
        "\n".join(origin(found)),
    )


def _parameters(found: FittedModel) -> str:
    lines = []
    for name, parameter in found.model.parameters.items():
        sd = found.sd.get(name, math.nan)
        spread = f" +- {sd:.2g}" if math.isfinite(sd) else ""
        unit = reader_unit(parameter.unit, found.model.mechanics.system)
        lines.append(f'    "{name}": {found.values[name]!r},  # {unit}: {parameter.meaning}{spread}')
    return "\n".join(lines)


def _step(found: FittedModel) -> float:
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
    """
    found = fitted_model(source, values)
    program = program_of(found.model)
    arm = found.model.mechanics.system == ARM
    names = dict(zip(program.recorded, sp.symbols(_INPUTS[arm], real=True), strict=True))
    drive = tuple((a, e.xreplace(names)) for a, e in program.drive)
    printer = NumPyPrinter({"fully_qualified_modules": False})
    body = partial(_body, printer, program)
    n = program.n_coordinates
    seen = set().union(*[e.free_symbols for e in (*program.reading, *([drive[0][1]] if arm else []))])
    memory = bool(seen & set(program.states[2 * n :]))
    moving = memory or bool(seen & set(program.states[n : 2 * n]))
    sampled = program.states if memory else program.states[: 2 * n if moving else n]
    fields = {
        "TITLE": f"Equations of motion: base {found.model.base} with {', '.join(found.model.effects) or 'no effects'}.",
        "PARAMETERS": _parameters(found),
        "STEP": repr(_step(found)),
        "STATES": ", ".join(y.name for y in program.states),
        "N_STATES": str(len(program.states)),
        "N_READING": str(len(program.reading)),
        "DERIVATIVE": body(program.slopes, assignments=program.assignments, drive=drive, states=program.states),
        "READING": body(program.reading, drive=drive[:1] if arm else (), states=sampled),
        "LATENESS": body((program.lateness,), returns="{}"),
        "INITIAL": body([e.xreplace(names) for e in program.initial]),
        "DRIVE": _ARM_DRIVE if arm else _INPUT_DRIVE,
        "READ": (_READ if program.lateness == 0 else _READ_LATE)
        .replace("@MOTOR@", _MOTOR if arm else "")
        .replace("@RATES@", (_RATES if moving else "") + (_MEMORY if memory else "")),
        **(_ARM_WORDS if arm else _OSCILLATOR_WORDS),
        "N": str(n),
    }
    used = ", ".join(sorted(printer.module_imports["numpy"]))
    fields["FUNCTIONS"] = f"from numpy import {used}\n" if used else ""
    # Last: names from the rig file are no fields.
    fields["TEXT"] = _text(found, arm)
    text = _TEMPLATE.read_text(encoding="utf-8")
    for key, value in fields.items():
        text = text.replace(f"@{key}@", value)
    return text
