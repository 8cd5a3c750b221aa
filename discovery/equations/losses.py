"""The losses that a model declares, what another law may take the place of, and what of it is passive."""

from __future__ import annotations

import sympy as sp

from discovery.declarations.registry import get_effect
from discovery.equations.model import Model
from discovery.mechanics.systems import declared_base


def takes_energy(effect: str) -> bool:
    """Return whether an effect is a loss: a dissipation, or a force that remembers.

    Examples
    --------
    >>> takes_energy("coulomb_friction"), takes_energy("hysteresis"), takes_energy("time_base_error")
    (True, True, False)
    """
    return get_effect(effect).kind in ("dissipation", "memory")


def is_passive(model: Model, name: str) -> bool:
    """Return whether a constant of a declared system is the factor of a loss, or of an energy that is never negative.

    With another sign it would feed energy, or tear apart what it ties.
    """
    base = declared_base(model.base)
    if base is None:
        return False
    factor = sp.diff(base.equations.potential, sp.Symbol(name, real=True))
    stored = bool(factor.free_symbols) and factor.is_nonnegative
    return name in without_losses(model) or bool(stored)


def without_losses(model: Model) -> dict[str, Model]:
    """Return, for each loss that is fitted, the model without it: an effect, or a constant of a system's own losses.

    Such a constant is the factor of a loss and stands nowhere else in the equations.

    Examples
    --------
    >>> model = Model("oscillator", ("viscous_damping", "linear_stiffness"))
    >>> {loss: other.effects for loss, other in without_losses(model).items()}
    {'viscous_damping': ('linear_stiffness',)}
    """
    free = set(model.free)
    lost = [e for e in model.terms if e.kind == "dissipation" and free.intersection(p.name for p in e.parameters())]
    found = {e.id(): model.without(e.id()) for e in lost}
    if (base := declared_base(model.base)) is None:
        return found
    read = base.equations
    others = [read.kinetic, read.potential, read.output, *read.forces, *(value for value, _ in read.places.values())]
    elsewhere = set().union(*(sp.sympify(other).free_symbols for other in others))
    for x in sorted(read.dissipation.free_symbols - elsewhere, key=str):
        if x.name in free and sp.diff(read.dissipation, x, 2) == 0:
            found[x.name] = Model(model.base, model.effects, {**model.known, x.name: 0.0})
    return found
