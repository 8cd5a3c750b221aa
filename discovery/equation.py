"""The equation of motion of a base with one coordinate, as sympy writes it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import sympy as sp

from discovery import symbols as s
from discovery.effect import ARM
from discovery.errors import InputError
from discovery.program import RECORDED, build_program

if TYPE_CHECKING:
    from discovery.model import Model

__all__ = ["equation_of_motion"]


def equation_of_motion(model: Model) -> sp.Eq:
    """Return acceleration + ... = 0 (or = the drive) of a model.

    Symbols: theta_t, its rates theta_t' and theta_t'', delta, delta', theta_m, theta_m', theta_m'' for an arm; q, q',
    q'' and u for an oscillator; parameters by name.

    Raises
    ------
    InputError
        For a base with several coordinates, or a model with memory.
    """
    program = build_program(model.base, model.effects)
    if program.n_coordinates != 1 or len(program.states) != 2:
        raise InputError(f"The equations of base {model.base!r} with these effects have no readable closed form.")
    arm = model.mechanics.system == ARM
    force, inertia = program.slopes[1].as_numer_denom()
    for symbol, expression in reversed(program.derivative):
        force, inertia = force.subs(symbol, expression), inertia.subs(symbol, expression)
    for symbol, expression in reversed(program.drive):
        if expression not in RECORDED:
            force = force.subs(symbol, expression)
    position, rate = program.states
    names = ("theta_t", "theta_t'", "theta_t''") if arm else ("q", "q'", "q''")
    here, moving, accelerating = sp.symbols(names, real=True)
    names_of = {position: here, rate: moving}
    if arm:
        delta, delta_rate = sp.symbols("delta delta'", real=True)
        relative = {s.theta_m: position - delta, s.omega_m: rate - delta_rate}
        force = sp.simplify(force.subs(relative, simultaneous=True))
        inertia = sp.simplify(inertia.subs(relative, simultaneous=True))
        # Whatever still needs the motor's own motion keeps it.
        motor = sp.symbols("theta_m theta_m' theta_m''", real=True)
        names_of.update(zip((s.theta_m, s.omega_m, s.alpha_m), motor, strict=True))
    left = inertia.subs(names_of) * accelerating - sp.expand(force.subs(names_of))
    driven = left.coeff(s.u) if not arm else sp.Integer(0)
    if driven != 0:
        return sp.Eq(sp.expand(left - driven * s.u), -driven * s.u)
    return sp.Eq(left, 0)
