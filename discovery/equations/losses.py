"""The losses that a model declares, what another law may take the place of, and what of it is passive."""

from __future__ import annotations

from collections.abc import Iterable

import sympy as sp

from discovery.declarations.place import placed
from discovery.declarations.registry import get_effect
from discovery.equations.model import Model
from discovery.mechanics.declared_equations import coordinates_of
from discovery.mechanics.lagrangian import total_derivative
from discovery.mechanics.systems import declared_base


def is_loss(effect: str) -> bool:
    """Return whether an effect is a loss as those that a model declares: a dissipation, which asks for rates alone.

    A force that remembers stores energy, too, and may look like much that no catalogue holds.

    Examples
    --------
    >>> is_loss("coulomb_friction"), is_loss("hysteresis"), is_loss("time_base_error")
    (True, False, False)
    """
    return get_effect(effect).kind == "dissipation"


def is_passive(model: Model, name: str) -> bool:
    """Return whether a constant of a declared system is the factor of a loss, or of an only spring.

    With another sign it would feed energy, or tear apart what it ties.
    """
    base = declared_base(model.base)
    if base is None:
        return False
    if name in without_losses(model):
        return True
    potential, x = base.equations.potential, sp.Symbol(name, real=True)
    spring = sp.diff(potential, x)
    tied = spring.free_symbols & {*coordinates_of(len(base.declaration.coordinates))[0]}
    only = not (potential - x * spring).expand().free_symbols & tied
    square = spring.is_polynomial(*tied) and sp.Poly(spring.expand(), *tied).total_degree() == 2 if tied else False
    return bool(square and only and spring.is_nonnegative)


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
    fitted = (e.id() for e in model.terms if free.intersection(p.name for p in e.parameters()))
    found = {e: model.without(e) for e in fitted if is_loss(e)}
    if (base := declared_base(model.base)) is None:
        return found
    read = base.equations
    others = [read.kinetic, read.potential, read.output, *read.forces, *(value for value, _ in read.places.values())]
    elsewhere = set().union(*(sp.sympify(other).free_symbols for other in others))
    for x in sorted(read.dissipation.free_symbols - elsewhere, key=str):
        factor = sp.diff(read.dissipation, x)
        if x.name in free and factor.is_nonnegative and x not in factor.free_symbols:
            found[x.name] = Model(model.base, model.effects, {**model.known, x.name: 0.0})
    return found


def same_losses(model: Model, loss: str) -> frozenset[str]:
    """Return the effects that are a declared loss by another name: itself, or viscous damping at a place.

    Examples
    --------
    >>> same_losses(Model("oscillator", ("viscous_damping",)), "viscous_damping")
    frozenset({'viscous_damping'})
    """
    base = declared_base(model.base)
    if base is None or loss in model.effects:
        return frozenset({loss})
    factor, found = sp.diff(base.equations.dissipation, sp.Symbol(loss, real=True)), set()
    places, rates, _ = coordinates_of(len(base.declaration.coordinates))
    for name, (value, _) in base.equations.places.items():
        rate = total_derivative(value, places, rates)
        if rate != 0 and not sp.simplify(factor / rate**2).free_symbols.intersection((*places, *rates)):
            found.add(placed("viscous_damping", name))
    return frozenset(found)


def doubled(model: Model, added: Iterable[str]) -> dict[str, Model]:
    """Return, for each law of a model that added ones contain, and so double, the model without it.

    It is an effect, or a constant of a system's own losses.

    Examples
    --------
    >>> sorted(doubled(Model("oscillator", ("viscous_damping", "linear_stiffness")), ["recording_damping"]))
    ['viscous_damping']
    """
    contained = {law for effect in added for law in get_effect(effect).reduces_to}
    declared = without_losses(model) if contained else {}
    losses = {loss: less for loss, less in declared.items() if contained & same_losses(model, loss)}
    return losses | {law: model.without(law) for law in contained.intersection(model.effects)}
