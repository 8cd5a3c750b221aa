"""The texts and constants of a declared system, read into the symbols and parameters of its base."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from discovery.declarations import symbols as s
from discovery.declarations.formula import Quantity, read_formula, unit_words
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import Flat, LogUniform, Normal, Prior
from discovery.declarations.system import Constant, SystemDeclaration
from discovery.foundation.errors import InputError

#: The recorded input with its first two derivatives, where it is a motion.
INPUT = (s.theta_m, s.omega_m, s.alpha_m)
#: A free constant keeps the sign of its guess, and is no farther from it than by this factor.
_FARTHEST = 1e4


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
    also: Mapping[str, tuple[sp.Expr, str]]  # what is read beside the output, with its unit


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
        also={name: formula(f"also.{name}", text, 2, None) for name, text in declaration.also.items()},
    )


def is_moved_by_input(equations: Equations) -> bool:
    """Return whether derivatives of the input are needed: it is a motion then."""
    e = equations
    places, also = ([law for law, _ in each.values()] for each in (e.places, e.also))
    energies = (e.kinetic, e.potential, e.dissipation)
    used = sp.Tuple(*energies, *e.forces, e.output, *also, *places).free_symbols
    stored = sp.Tuple(e.kinetic, *places).free_symbols
    return bool(used & {s.omega_m, s.alpha_m} or s.theta_m in stored)


def constant_parameter(name: str, constant: Constant) -> Parameter:
    """Return the parameter that a constant is, in SI units: known, free, or known within an uncertainty."""
    size = abs(constant.value)
    bounds = (-np.inf, np.inf)
    prior: Prior = Flat(size)
    if constant.free:
        prior = LogUniform(size, _FARTHEST)
        near, far = constant.value / _FARTHEST, constant.value * _FARTHEST
        bounds = (min(near, far), max(near, far))
    elif constant.sd is not None:
        prior = Normal(constant.value, constant.sd)
    return Parameter(
        constant.unit, name.replace("_", " "), bounds, prior, default=constant.value, starts=(constant.value,),
        fixed=not constant.free, physical=True, name=name,
    )  # fmt: skip


@dataclass(frozen=True)
class Unread:
    """A coordinate that may begin anywhere, whatever is read."""

    way: NDArray  # (n,), displacement of the coordinates per unit of it, which leaves alone what is read
    starts: tuple[Parameter, ...]  # its displacement from where a static force leads it, and its rate


def unread_coordinates(
    coordinates: Mapping[str, str], gradient: NDArray, shape: NDArray, inertia: NDArray, order: int
) -> tuple[Unread, ...]:
    """Return all coordinates but the one that shows most in what is read, none where nothing shows at rest.

    Each is believed to begin as far away as a displacement that is as heavy as that by one unit of what is read.

    `coordinates`: units by name. `gradient` (n,): what is read per coordinate. `shape` (n,): displacement per unit of
    what is read. `inertia` (n, n). `order`: 1 where what is read is a rate.
    """
    if len(gradient) == 1 or not gradient.any():
        return ()
    heavy = float(np.sqrt(shape @ inertia @ shape))
    read = int(np.argmax(np.abs(gradient) / np.sqrt(np.diag(inertia))))
    # Of a rate that is read, a displacement is so many natural times.
    natural = ("q s", "q") if order == 1 else ("q", "q s^-1")
    found = []
    for j, (name, unit) in enumerate(coordinates.items()):
        if j == read:
            continue
        way = np.zeros(len(gradient))
        way[j], way[read] = 1.0, -gradient[j] / gradient[read]
        size = Normal(0.0, heavy / float(np.sqrt(inertia[j, j])))
        told = ((f"{name}_start", "displacement", unit), (f"{name}_rate_start", "rate", f"{unit} s^-1"))
        starts = (
            Parameter(
                by, f"{what} of {name.replace('_', ' ')} at the start", prior=size, shape=True, fixed=True, own=True,
                name=label, measured=measured,
            )
            for by, (label, what, measured) in zip(natural, told, strict=True)
        )  # fmt: skip
        found.append(Unread(way, tuple(starts)))
    return tuple(found)
