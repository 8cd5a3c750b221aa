"""A model as sympy: the equation of motion where it has a closed form, and the exact program for every base."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import sympy as sp

from discovery.declarations import symbols as s
from discovery.declarations.effect import Effect, Joint, Memory
from discovery.equations.declared_terms import LETTERS, every_line
from discovery.equations.equation import MOVING_INPUT, EquationTerms, equation_of_motion, equation_terms, motion_symbols
from discovery.equations.model import Model
from discovery.equations.program import RECORDED, Program, build_program
from discovery.export.fitted import FittedModel, given_numbers, model_of
from discovery.foundation.errors import InputError
from discovery.mechanics.rod import rod_of
from discovery.mechanics.systems import declared_base

if TYPE_CHECKING:
    from discovery.estimation.fit import Fit

Assignments = tuple[tuple[sp.Symbol, sp.Expr], ...]
#: Initial deflection [q] and rate [q/s] in `SymbolicModel.initial`.
DEFLECTION, RATE = sp.symbols("deflection rate", real=True)
#: An oscillator's input that is a motion, as it is written.
_MOTION = dict(zip((s.theta_m, s.omega_m, s.alpha_m), MOVING_INPUT, strict=True))


@dataclass(frozen=True)
class SymbolicModel:
    """A model in sympy: evaluate `drive`, `assignments` and `slopes` in this order.

    `recorded` is the motor angle, or an oscillator's input that is a motion, with its two derivatives, else the input
    alone. `drive` says with it and t what the system receives: theta_m or u, with their rates where they are a motion.
    `assignments` are intermediate values, and `slopes` the rates of `states`: coordinates, their rates, and states of
    memory; theta_t of an arm or q of an oscillator where there is a closed form. `reading` is what the instrument
    reports, tip x, y [m] or the output, of the state that is `lateness` [s] old; it may need what the system receives.
    `initial` is the state for an initial `deflection` and `rate` and the motor's recorded angle and rate. `equation` is
    the equation of motion, see `discovery.equations.equation.equation_terms`, None where there is no closed form, and
    `memory` has the equations of states that it needs.
    """

    parameters: tuple[sp.Symbol, ...]
    recorded: tuple[sp.Symbol, ...]
    states: tuple[sp.Symbol, ...]
    n_coordinates: int
    drive: Assignments
    assignments: Assignments
    slopes: tuple[sp.Expr, ...]
    reading: tuple[sp.Expr, ...]
    lateness: sp.Expr
    initial: tuple[sp.Expr, ...]
    equation: sp.Eq | None
    memory: tuple[sp.Eq, ...]


def closed_form(model: Model) -> EquationTerms | None:
    """Return the equation term by term, or None where the base has no closed form."""
    try:
        return equation_terms(model)
    except InputError:
        return None


def needed(assignments: Sequence[tuple[sp.Symbol, sp.Expr]], results: Iterable[sp.Expr]) -> Assignments:
    """Return the assignments on which the results depend."""
    wanted = set().union(*[e.free_symbols for e in results])
    kept = []
    for symbol, expression in reversed(assignments):
        if symbol in wanted:
            kept.append((symbol, expression))
            wanted |= expression.free_symbols
    return tuple(reversed(kept))


def in_parts(results: Sequence[sp.Expr]) -> tuple[Assignments, Sequence[sp.Expr]]:
    """Return results with what recurs in them assigned before: written out, it would double at every level."""
    parts, found = sp.cse(results, symbols=sp.numbered_symbols("part_", real=True))
    return tuple(parts), found


def _initial(model: Model, program: Program) -> tuple[sp.Expr, ...]:
    """Return the initial state as expressions: the base's own arithmetic, carried out on symbols."""

    def array(*symbols: sp.Expr) -> np.ndarray:
        return np.array(symbols, dtype=object)

    start = array(*RECORDED[:2])[:, None]
    rod = rod_of(model.terms)
    begins = tuple(array(sp.Symbol(name, real=True)) for name in model.mechanics.begins)
    form = begins or (rod.deflection, rod.root)
    q, rate = model.mechanics.initial_coordinates(array(DEFLECTION), array(RATE), start, form)
    found = [sp.sympify(e) for e in (*q[:, 0], *rate[:, 0])]
    begun = {state: sp.Symbol(name, real=True) for state, name in program.begun}
    return (*found, *(begun.get(state, sp.Integer(0)) for state in program.states[len(found) :]))


def program_of(model: Model) -> SymbolicModel:
    """Return a model with all of its parameters as symbols, states named as the program names them."""
    program = build_program(model.base, model.effects)
    terms = closed_form(model)
    results = (*program.slopes, *program.reading, program.lateness)
    moves = model.mechanics.input_moves
    return SymbolicModel(
        parameters=tuple(sp.Symbol(n, real=True) for n in program.parameters),
        recorded=RECORDED if moves else RECORDED[:1],
        states=program.states,
        n_coordinates=program.n_coordinates,
        drive=program.drive,
        assignments=needed(program.derivative, results),
        slopes=program.slopes,
        reading=program.reading,
        lateness=sp.sympify(program.lateness),
        initial=_initial(model, program),
        equation=None if terms is None else equation_of_motion(model),
        memory=() if terms is None else tuple(sp.Eq(sp.Symbol(f"{z.name}'", real=True), e) for z, e in terms.memory),
    )


def substituted(found: SymbolicModel, names: Mapping[sp.Symbol, sp.Expr]) -> SymbolicModel:
    """Return the model with symbols replaced throughout, all at once."""

    def told(expression: sp.Expr) -> sp.Expr:
        return sp.sympify(expression).xreplace(names)

    def each(assignments: Assignments) -> Assignments:
        return tuple((names.get(a, a), told(e)) for a, e in assignments)

    return replace(
        found,
        parameters=tuple(p for p in found.parameters if p not in names),
        states=tuple(names.get(y, y) for y in found.states),
        drive=each(found.drive),
        assignments=each(found.assignments),
        slopes=tuple(map(told, found.slopes)),
        reading=tuple(map(told, found.reading)),
        lateness=told(found.lateness),
        initial=tuple(map(told, found.initial)),
        equation=None if found.equation is None else told(found.equation),
        memory=tuple(map(told, found.memory)),
    )


def to_sympy(source: FittedModel | Fit | Model, values: Mapping[str, float] | None = None) -> SymbolicModel:
    """Return a model as sympy.

    Parameters
    ----------
    source : FittedModel, Fit or Model
        What to export; parameters stay symbols.
    values : mapping of str to float, optional
        Parameters to replace by numbers [SI, radians], for example ``fit.values``.

    Returns
    -------
    SymbolicModel
        Lagrange's equations (source paper, equations (7) to (16), or the exact arm); sensors and drive included.

    Raises
    ------
    InputError
        If an effect needs the linear stiffness and nothing declares it, for a name that is not a parameter of the
        model, or a value that is not a finite number.

    Examples
    --------
    >>> model = Model("oscillator", ("viscous_damping", "linear_stiffness"))
    >>> values = {"xi": 0.16, "alpha": 400.0, "g": 0.0}  # s^-1, s^-2
    >>> [str(slope) for slope in to_sympy(model, values).slopes]
    ["q'", "F_U*q + 2*F_v2*q'"]
    """
    model = model_of(source)
    given = given_numbers(model, values)
    found = program_of(model)
    if model.mechanics.system.has_rod:
        names = {s.delta_dot: "delta'", s.omega_m: "theta_m'", s.alpha_m: "theta_m''"}
        written = {symbol: sp.Symbol(name, real=True) for symbol, name in names.items()}
    else:
        written = dict(_MOTION)
    if found.equation is not None:
        written |= dict(zip(found.states[:2], motion_symbols(model.mechanics.system)[:2], strict=True))
    found = substituted(found, written)
    numbers = {sp.Symbol(n, real=True): sp.Float(v) for n, v in given.items()}
    return substituted(found, numbers) if numbers else found


def received(model: Model) -> tuple[sp.Symbol, sp.Expr]:
    """Return what the root of a rod or an oscillator receives, from what is recorded; joints turn it by p."""
    rigid = tuple(effect.id() for effect in model.terms if not isinstance(effect, Joint))
    symbol, value = build_program(model.base, rigid).drive[0]
    symbol, value = symbol if model.mechanics.system.has_rod else s.u, s.readable(value)
    return symbol, value if len(rigid) == len(model.effects) else value + sp.Symbol("p", real=True)


def _declared(effect: Effect) -> list[str]:
    """Return what an effect adds to Lagrange's equations of a rod, and the rates of its states."""
    lines = []
    if effect.kind in LETTERS:
        letter, body = LETTERS[effect.kind], f"{effect.expression()}"  # type: ignore[attr-defined]
        if isinstance(effect, Memory):
            body = (
                f"3 int_0^1 ({body}) ds, bend = kappa(s, t)/3" if effect.local else f"sum ({body}), U = sum bend**2/2"
            )
        lines.append(f"{effect.id()}: {'F' if getattr(effect, 'on', None) is not None else letter} = {body}")
    elif isinstance(effect, Joint):
        lines.append(f"{effect.id()}: p = {effect.expression()}, P = -alpha*root*p', root = kappa(0, t)/3")
    lines += [f"{z}' = {slope}" for z, slope in effect.states().items()]
    return lines


def equation_text(model: Model) -> tuple[str, ...]:
    """Return the motion as lines of plain text, of a rod Lagrange's, and what is read where that is no coordinate.

    Of a declared system they are its energies, forces and places, in the names that its user gave.
    """
    if (declared := declared_base(model.base)) is not None:
        own = every_line(declared, model.terms, model.known)
        return (
            "d/dt dT/dx' - dT/dx + dV/dx + dD/dx' = Q_x + dP/dx' for every coordinate x, sums over what follows",
            *(f"{x.words}: {x.name}{x.dots * chr(39)} = {s.readable(x.value)}" for x in own),
        )
    symbol, from_recorded = received(model)
    drive = () if from_recorded in RECORDED else (f"{symbol} = {from_recorded}, r_0 being what is recorded",)
    terms = closed_form(model)
    if terms is not None:
        equation = equation_of_motion(model)
        plain = terms.output in (None, motion_symbols(model.mechanics.system)[0])
        read = () if plain else (f"output = {terms.output}",)
        return (f"{equation.lhs} = {equation.rhs}", *(f"{z}' = {e}" for z, e in terms.memory), *drive, *read)
    rod = rod_of(model.terms)
    rest = "" if rod.rest == 0 else f" + {rod.rest.subs(s.arc, sp.Symbol('s'))}"
    shapes = "phi_k(s)" if rod.root == 0 else f"(phi_k(s) + {rod.root} phi_k'(0))"
    lines = [
        f"theta(s, t) = theta_m(t){rest} + sum_k q_k(t) {shapes}",
        "d/dt dT/dq_k' - dT/dq_k + dV/dq_k + dD/dq_k' - dP/dq_k' = 0",
    ]
    return (*lines, *[line for effect in model.terms for line in _declared(effect)], *drive)
