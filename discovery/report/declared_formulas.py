"""A system in its own equations, and the effects at its places, as formulas in the names that its user gave."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from discovery.declarations import symbols as s
from discovery.declarations.effect import Effect, Memory
from discovery.declarations.place import INERTIA, local
from discovery.declarations.system import SystemDeclaration
from discovery.mechanics.declared_equations import coordinates_of
from discovery.mechanics.systems import system_base
from discovery.report.effect_formulas import LETTERS, NEXT, equal
from discovery.report.mathml import expression, row, symbol

if TYPE_CHECKING:
    import sympy as sp

__all__ = ["declared_formulas", "placed_formula"]

_DOTS = ("", "'", "''")
_INPUT = (s.theta_m, s.omega_m, s.alpha_m)


def declared_formulas(declaration: SystemDeclaration) -> list[tuple[str, str]]:
    """Return words and MathML of energies, forces, output and places, as they were declared."""
    import sympy as sp

    read = system_base(declaration).equations
    own: dict[sp.Symbol, sp.Symbol] = {}
    for dots, symbols in zip(_DOTS, coordinates_of(len(declaration.coordinates)), strict=True):
        own |= {x: sp.Symbol(n + dots, real=True) for n, x in zip(declaration.coordinates, symbols, strict=True)}
    if declaration.input is not None:
        own |= {x: sp.Symbol(declaration.input[0] + dots, real=True) for x, dots in zip(_INPUT, _DOTS, strict=True)}

    def told(value: sp.Expr) -> str:
        return expression(value.xreplace(own), "")

    found = [
        (words, equal(symbol(letter), told(value)))
        for words, letter, value in (
            ("Kinetic energy", "T", read.kinetic),
            ("Potential energy", "V", read.potential),
            ("Dissipation function", "D", read.dissipation),
        )
        if value != 0
    ]
    for name, force in zip(declaration.coordinates, read.forces, strict=True):
        if force != 0:
            found.append((f"Generalised force on {name.replace('_', ' ')}", equal(symbol(f"Q_{name}"), told(force))))
    found += [(f"Place {n.replace('_', ' ')}", equal(symbol(n), told(value))) for n, (value, _) in read.places.items()]
    return [*found, ("What is read", equal(symbol("y_read"), told(read.output)))]


def placed_formula(effect: Effect) -> str:
    """Return what an effect at a place declares: its energy or power in the displacement there, alpha the stiffness."""
    import sympy as sp

    where = sp.Symbol(effect.place, real=True)
    rate = sp.Symbol(f"{effect.place}'", real=True)
    meant: dict[sp.Symbol, Any] = dict.fromkeys((s.theta, s.delta, s.x, s.x_g, s.slope), where)
    meant |= dict.fromkeys((s.omega, s.delta_dot, s.v_x, s.slope_dot), rate) | {s.v2: rate**2, s.w2: rate**2}
    meant |= {s.U: where**2 / 2, s.U_4: where**4 / 4, s.y: sp.Integer(0), s.y_g: sp.Integer(0), s.v_y: sp.Integer(0)}
    meant |= {INERTIA: sp.Integer(1), s.alpha: sp.Symbol(f"k_{effect.place}", real=True)}
    told = {local(c, effect.place): value for c, value in meant.items()} | {s.bend: where, s.bend_dot: rate}
    law = effect.expression().xreplace(told)  # type: ignore[attr-defined]
    letter = "F" if getattr(effect, "on", None) is not None else LETTERS[effect.kind]
    lines = [equal(symbol(letter), expression(law, ""))]
    if isinstance(effect, Memory):
        lines += [equal(symbol(z.name, 1), expression(r.xreplace(told), "")) for z, r in effect.states().items()]
    return row(NEXT.join(lines))
