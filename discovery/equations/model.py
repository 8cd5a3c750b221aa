"""A model: a base plus a sum of effects, and the equation of motion that follows from them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from typing import TYPE_CHECKING, Any

from discovery.declarations.forces import ExternalForce, SmoothForce
from discovery.declarations.parameters import Parameter
from discovery.declarations.registry import catalogue, get_effect
from discovery.foundation.arguments import as_words, check_keys, check_names, check_number, expect
from discovery.foundation.errors import InputError
from discovery.mechanics import base_names, get_base
from discovery.mechanics.systems import check_place, declaration_of, know_system

if TYPE_CHECKING:
    import sympy as sp

    from discovery.declarations.effect import Effect
    from discovery.mechanics.base import Base


@dataclass(frozen=True)
class Model:
    """A base plus a sum of effects.

    Parameters
    ----------
    base : str
        Name of the base, see `discovery.mechanics.base_names`.
    effects : sequence of str
        Effect ids in the order in which they were declared or added.
    known : mapping of str to float
        Values of parameters that are not fitted (from the rig or by convention) [SI]. Those of effects that the model
        lacks wait until these are added.

    Raises
    ------
    InputError
        For an unknown base, effect or parameter, an effect twice, or one that has no meaning on this kind of system.

    Examples
    --------
    >>> model = Model("oscillator", ("viscous_damping", "linear_stiffness"), known={"g": 0.0})
    >>> model.equation()
    Eq(alpha*q + q'*xi + q'', 0)
    >>> model.with_effect("coulomb_friction").without(["viscous_damping"]).effects
    ('linear_stiffness', 'coulomb_friction')
    >>> dict(model.free_parameter("g").known), Model.from_dict(model.to_dict()) == model
    ({}, True)
    >>> model.on_base("servo").base
    'servo'
    """

    base: str
    effects: tuple[str, ...]
    known: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if isinstance(self.effects, str):
            raise InputError(
                f"`effects` is a sequence of names, but {self.effects!r} is one: write [{self.effects!r}]."
            )
        effects = as_words(self.effects, "effects", "Give a sequence of effect ids, as `discovery effects` lists them.")
        object.__setattr__(self, "effects", effects)
        base = get_base(self.base)
        for effect_id in self.effects:
            effect = get_effect(effect_id)
            if base.system not in effect.systems:
                raise InputError(
                    f"Effect {effect_id!r} acts on {', '.join(sorted(effect.systems))}, not on {base.system}."
                )
            check_place(base, effect)
        twice = {e for e in self.effects if self.effects.count(e) > 1}
        if twice:
            raise InputError(f"Effect {', '.join(sorted(twice))} appears twice in the model; name each effect once.")
        expect(self.known, Mapping, "known", 'Name the parameters, as in known={"g": 0.0}.')
        check_declared(self, self.known)
        for name, value in self.known.items():
            check_number(value, f"known[{name!r}]")

    @cached_property
    def mechanics(self) -> Base:
        """The base itself."""
        return get_base(self.base)

    @cached_property
    def terms(self) -> tuple[Effect, ...]:
        """The effects themselves."""
        return tuple(get_effect(e) for e in self.effects)

    @cached_property
    def parameters(self) -> dict[str, Parameter]:
        """Every parameter of the model by name, base first."""
        found = {p.name: p for p in self.mechanics.parameters()}
        for effect in self.terms:
            for parameter in effect.parameters():
                if parameter.name in found:
                    raise InputError(
                        f"Effect {effect.id()!r} and another part of the model both have a parameter named "
                        f"{parameter.name!r}; use distinct names."
                    )
                where = self.mechanics.places().get(parameter.place)
                unit = "" if where is None else where.unit_of(parameter)
                found[parameter.name] = replace(parameter, measured=unit) if unit else parameter
        return found

    @cached_property
    def begins(self) -> tuple[str, ...]:
        """Names of what a recording begins with beside what is read: coordinates, and states of drives."""
        return (*self.mechanics.begins, *(p.name for p in self.parameters.values() if p.begins))

    @cached_property
    def free(self) -> tuple[str, ...]:
        """Names of the parameters that are fitted: those neither known nor fixed by convention."""
        base = [p for p in self.mechanics.parameters() if not p.fixed]
        fitted = [p for effect in self.terms for p in effect.fitted(self.mechanics.system)]
        return tuple(p.name for p in (*base, *fitted) if p.name not in self.known)

    def with_effect(self, *effect_ids: str) -> Model:
        """Return the model with effects added."""
        return Model(self.base, (*self.effects, *effect_ids), self.known)

    def without(self, effect_ids: str | Iterable[str]) -> Model:
        """Return the model with effects removed, which it must have."""
        drop = as_words(effect_ids, "effect_ids", "Give the id of an effect, or a list of them.")
        check_names(drop, self.effects, "The model", "effect")
        return Model(self.base, tuple(e for e in self.effects if e not in drop), self.known)

    def on_base(self, base: str) -> Model:
        """Return the model on another base, without the effects that the new base provides."""
        provided = get_base(base).provides
        return Model(base, tuple(e for e in self.effects if e not in provided), self.known)

    def free_parameter(self, *names: str) -> Model:
        """Return the model in which known parameters are fitted; names that are not known change nothing."""
        return Model(self.base, self.effects, {k: v for k, v in self.known.items() if k not in names})

    def to_dict(self) -> dict[str, Any]:
        """Return a JSON-ready description."""
        system = declaration_of(self.base)
        declared = {} if system is None else {"system": system.to_dict()}
        return {"base": self.base, "effects": list(self.effects), "known": dict(self.known), **declared}

    @classmethod
    def from_dict(cls, description: Mapping[str, Any]) -> Model:
        """Return the model that `to_dict` described."""
        check_keys(description, ("base", "effects", "known"), "description", "Give what `Model.to_dict` returned.")
        know_system(description)
        return cls(description["base"], tuple(description["effects"]), dict(description["known"]))

    def equation(self) -> sp.Eq:
        """Return the equation of motion of a base with one coordinate, theta_t'' on the left.

        Raises
        ------
        InputError
            For a base with several coordinates, whose equations have no readable closed form.
        """
        from discovery.equations.equation import equation_of_motion

        return equation_of_motion(self)


@cache
def _declared() -> frozenset[str]:
    """Return the parameters of all bases that are built in and of all effects."""
    effects = [*catalogue().values(), ExternalForce(), SmoothForce()]
    bases = [p.name for name in base_names() for p in get_base(name).parameters()]
    return frozenset([*bases, *(p.name for effect in effects for p in effect.parameters())])


def check_declared(model: Model, names: Iterable[str]) -> None:
    """Refuse names of parameters that neither a model nor the catalogue has.

    What a rig file states serves every model of it: parameters of effects that a model lacks are no mistake, and
    initial states of recordings neither.

    Raises InputError with the parameters that the model has.
    """
    unusual = [n for n in names if n not in _declared() and not (isinstance(n, str) and n.endswith("]"))]
    if not unusual:
        return
    places = tuple(f"_{place}" for place in model.mechanics.places())
    own = model.parameters
    strangers = [n for n in unusual if n not in own and not (places and str(n).endswith(places))]
    check_names(strangers, own, "The model", "parameter")
