"""What a drive must be told for a wanted motion: inertia, and tables of friction over rate and force over position."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import sympy as sp

from discovery.equations.model import Model
from discovery.equations.program import RECORDED, build_program
from discovery.export.fitted import FittedModel, deviations, fitted_model
from discovery.export.source_text import comment, composition, filled, origin
from discovery.export.symbolic import program_of
from discovery.foundation.arrays import FloatArray
from discovery.foundation.errors import InputError
from discovery.simulation.kernel.compile import numpy_derivative

if TYPE_CHECKING:
    from discovery.estimation.fit import Fit

#: Entries on either side of zero, and the least of them as a part of the largest.
_ENTRIES, _LEAST = 100, 1e-5
#: Part of the largest command below which what depends on rate and position together is passed over.
_APART = 0.01
#: Command c of a motion (position, rate, acceleration) at some parameters.
_Command = Callable[[FloatArray, FloatArray, FloatArray, Mapping[str, float]], FloatArray]


@dataclass(frozen=True)
class FeedForward:
    """The command of a wanted motion: offset + inertia * acceleration + friction(rate) + spring(position).

    `offset` is the command at rest, `inertia` that per acceleration of the coordinate, in the unit of the input or of
    the recorded force. `friction` (k,) is the command against friction at each `rate` [q/s], `spring` (k,) that against
    what holds the body at each `position` [q], beside their standard deviations (NaN without a covariance). `warnings`
    say what the tables leave out.
    """

    offset: float
    inertia: float
    rate: FloatArray
    friction: FloatArray
    friction_sd: FloatArray
    position: FloatArray
    spring: FloatArray
    spring_sd: FloatArray
    warnings: tuple[str, ...] = ()


def _command(model: Model) -> _Command:
    """Return the command of a motion, with memory at rest; InputError if nothing pushes the body by a command."""
    program, base = program_of(model), model.mechanics
    names = [sp.Symbol("t", real=True), *RECORDED, *program.states, *program.parameters]
    if base.prescribed:
        read = sp.lambdify(names, program.reading[0].xreplace(dict(program.drive)))
        memory = [0.0] * len(program.states)

        def recorded(q: FloatArray, v: FloatArray, a: FloatArray, values: Mapping[str, float]) -> FloatArray:
            row = [values[p.name] for p in program.parameters]
            return np.asarray(np.broadcast_to(read(0.0, q, v, a, *memory, *row), q.shape), float)

        return recorded
    if not base.gain:
        raise InputError(f"A feed-forward needs a body that a command pushes; {base.name!r} has none.")
    slopes = numpy_derivative(build_program(model.base, model.effects))

    def needed(q: FloatArray, v: FloatArray, a: FloatArray, values: Mapping[str, float]) -> FloatArray:
        row = [values[p.name] for p in program.parameters]
        idle = base.idle(q, v, values)
        state = [q, v, *[0.0 * q] * (len(program.states) - 2)]
        return np.asarray((a - slopes(0.0, (idle, 0.0 * q, 0.0 * q), state, row)[1]) / values[base.gain], float)

    return needed


def _entries(largest: float) -> FloatArray:
    """Return values from minus to plus the largest, dense at zero where friction turns."""
    half = np.geomspace(_LEAST * largest, largest, _ENTRIES)
    return np.concatenate([-half[::-1], [0.0], half])


def _warnings(model: Model, apart: float) -> tuple[str, ...]:
    said = []
    kept = [e.id() for e in model.terms if e.states() and e.kind != "joint"]
    if kept:
        said.append(f"{', '.join(kept)} depends on the motion before; the tables leave it out.")
    if apart > _APART:
        said.append(f"Up to {apart:.0%} of the command depends on rate and position together; the tables leave it out.")
    return tuple(said)


def feed_forward(
    source: FittedModel | Fit | Model,
    values: Mapping[str, float] | None = None,
    *,
    largest_rate: float,
    largest_position: float,
) -> FeedForward:
    """Return what a drive or an oscillator must be told for a wanted motion.

    Its model is one of a body that a command pushes (`oscillator`, `accelerometer`, `servo`), or of a recorded force;
    `values` replace numbers of `source`. The tables end at the largest rate [q/s] and the largest position [q].

    InputError if nothing pushes the body by a command, the command does not move it, no friction is named, or an end of
    a table is not positive.
    """
    found = fitted_model(source, values)
    if not (0 < largest_rate < np.inf and 0 < largest_position < np.inf):
        raise InputError("The tables need a largest rate and a largest position, both positive.")
    command = _command(found.model)
    if found.values.get("g", 1.0) == 0.0:
        raise InputError("The command does not move the body: its gain g is zero.")
    rate, position = _entries(largest_rate), _entries(largest_position)
    zero = np.zeros(1)

    def tables(given: Mapping[str, float]) -> tuple[FloatArray, ...]:
        rest, still, there = command(zero, zero, zero, given), 0.0 * rate, 0.0 * position
        return command(still, rate, still, given) - rest, command(position, there, there, given) - rest

    table, held = tables(found.values)
    sds = deviations(found, tables) or (np.nan * table, np.nan * held)
    if not np.any(table):
        raise InputError("The model names no friction, so there is nothing to compensate.")
    offset = float(command(zero, zero, zero, found.values)[0])
    corner = command(position[[0, -1, 0, -1]], rate[[0, 0, -1, -1]], np.zeros(4), found.values)
    together = held[[0, -1, 0, -1]] + table[[0, 0, -1, -1]] + offset
    apart = float(np.abs(corner - together).max() / np.abs(corner).max(initial=1e-300))
    return FeedForward(
        offset,
        float(command(zero, zero, zero + 1.0, found.values)[0]) - offset,
        rate=rate,
        friction=table,
        friction_sd=sds[0],
        position=position,
        spring=held,
        spring_sd=sds[1],
        warnings=_warnings(found.model, apart),
    )


def feed_forward_csv(found: FeedForward) -> str:
    """Return both tables as CSV: what is looked up, its value, the command and its standard deviation."""
    rows = ["over,value,command,command_sd", f"acceleration,1.0,{found.inertia!r},", f"rest,0.0,{found.offset!r},"]
    for over, at, command, sd in (
        ("rate", found.rate, found.friction, found.friction_sd),
        ("position", found.position, found.spring, found.spring_sd),
    ):
        table = zip(at.tolist(), command.tolist(), sd.tolist(), strict=True)
        rows += [f"{over},{x!r},{c!r},{'' if np.isnan(s) else repr(s)}" for x, c, s in table]
    return "\n".join(rows) + "\n"


def feed_forward_c(found: FeedForward, source: FittedModel) -> str:
    """Return the tables and where they come from as a C header, with a function that looks them up."""
    title, warned = f"Feed-forward: base {composition(source)}.", [f"Warning: {w}" for w in found.warnings]
    units = "SI units, radians; straight between entries, held beyond them."
    head = comment([title, *warned, "", *origin(source), "", units])
    arrays = {"rate": found.rate, "friction": found.friction, "position": found.position, "spring": found.spring}
    tables = "\n".join(
        f"static const double feed_forward_{name}[{a.size}] = {{\n    {', '.join(map(repr, a.tolist()))}\n}};"
        for name, a in arrays.items()
    )
    fields = {"HEAD": head, "TABLES": tables, "SIZE": found.rate.size}
    return filled("feed_forward.txt", {**fields, "OFFSET": repr(found.offset), "INERTIA": repr(found.inertia)})
