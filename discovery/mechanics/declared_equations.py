"""The texts of a declared system, read into the symbols of its base."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import sympy as sp

from discovery.declarations import symbols as s
from discovery.declarations.formula import Quantity, read_formula, unit_words
from discovery.declarations.system import SystemDeclaration
from discovery.foundation.errors import InputError

#: The recorded input with its first two derivatives, where it is a motion.
INPUT = (s.theta_m, s.omega_m, s.alpha_m)


@dataclass(frozen=True)
class Equations:
    """The texts of a declaration, read: energies, forces, output and places in the symbols of the kernel."""

    kinetic: sp.Expr
    potential: sp.Expr
    dissipation: sp.Expr
    forces: tuple[sp.Expr, ...]
    output: sp.Expr
    places: Mapping[str, tuple[sp.Expr, str]]
    output_unit: str


def coordinates_of(n: int) -> tuple[tuple[sp.Symbol, ...], tuple[sp.Symbol, ...], tuple[sp.Symbol, ...]]:
    """Return the symbols of n coordinates, of their rates and of their accelerations."""
    return tuple(  # type: ignore[return-value]
        tuple(sp.Symbol(f"{word}_{k}", real=True) for k in range(1, n + 1)) for word in ("q", "qd", "acceleration")
    )


def read_equations(declaration: SystemDeclaration) -> Equations:
    """Read every text of a declaration.

    Raises InputError naming the key and what is wrong with its text.
    """
    moving = list(zip(*coordinates_of(len(declaration.coordinates)), strict=True))
    constants = {n: Quantity((sp.Symbol(n, real=True),), c.unit) for n, c in declaration.constants.items()}

    def names(order: int) -> dict[str, Quantity]:
        found = {
            name: Quantity(symbols[: order + 1], unit)
            for (name, unit), symbols in zip(declaration.coordinates.items(), moving, strict=True)
        }
        if declaration.input is not None:
            found[declaration.input[0]] = Quantity(INPUT, declaration.input[1])
        return {**found, **constants}

    def formula(key: str, text: str, order: int, unit: str | None) -> tuple[sp.Expr, str]:
        try:
            expression, dimension = read_formula(text, names(order), unit)
        except InputError as error:
            raise InputError(f"key {key!r}: {error}") from error
        return expression, unit_words(dimension)

    for name in declaration.forces:
        if name not in declaration.coordinates:
            known = ", ".join(declaration.coordinates)
            raise InputError(f"key 'forces': there is no coordinate {name!r} to push on. Name one of {known}.")
    output, unit = formula("output", declaration.output, 2, None)
    return Equations(
        formula("kinetic", declaration.kinetic, 1, "J")[0],
        formula("potential", declaration.potential, 0, "J")[0],
        dissipation=formula("dissipation", declaration.dissipation, 1, "W")[0],
        forces=tuple(
            formula(f"forces.{name}", declaration.forces.get(name, "0"), 1, f"J / {'1' if unit == 'rad' else unit}")[0]
            for name, unit in declaration.coordinates.items()
        ),
        output=output,
        places={name: formula(f"places.{name}", text, 0, None) for name, text in declaration.places.items()},
        output_unit=unit,
    )


def is_moved_by_input(equations: Equations) -> bool:
    """Return whether derivatives of the input are needed: it is a motion then."""
    e = equations
    places = [p for p, _ in e.places.values()]
    used = sp.Tuple(e.kinetic, e.potential, e.dissipation, *e.forces, e.output, *places).free_symbols
    stored = sp.Tuple(e.kinetic, *places).free_symbols
    return bool(used & {s.omega_m, s.alpha_m} or s.theta_m in stored)
