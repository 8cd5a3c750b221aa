"""What the declaration of an effect must fulfil, whatever its physics."""

from __future__ import annotations

import inspect
import json
import math
from collections.abc import Iterator, Mapping
from typing import ClassVar

import numpy as np
import sympy as sp

from discovery.declarations import symbols as s
from discovery.declarations.effect import ARM, OSCILLATOR, Drive, Effect, Joint, Load, Mode, Sensor, Shape
from discovery.declarations.parameters import natural_scale
from discovery.declarations.registry import catalogue, get_effect
from discovery.declarations.system import System
from discovery.declarations.units import dimension
from discovery.equations.model import Model
from discovery.equations.program import RECORDED, build_program
from discovery.foundation.errors import InputError
from discovery.mechanics import base_names, get_base
from discovery.testing.equations import at_rest, memory_states

_KIND_UNITS = {
    "kinetic": "q^2 s^-2",
    "potential": "q^2 s^-2",
    "dissipation": "q^2 s^-3",
    "load": "q^2 s^-3",
    "memory": "q^2 s^-3",
    "closure": "1",
    "mode": "q^2 s^-3",
    "joint": "q",
    "drive": "q",
}
_SYMBOL_UNITS = {
    **dict.fromkeys((s.theta, s.delta, s.slope, s.bend, s.root, s.theta_m), "q"),
    **dict.fromkeys((s.omega, s.delta_dot, s.slope_dot, s.bend_dot, s.root_dot, s.omega_m), "q s^-1"),
    **dict.fromkeys((s.alpha_m, s.push), "q s^-2"),
    **dict.fromkeys((s.v2, s.w2), "q^2 s^-2"),
    **dict.fromkeys((s.arc, s.rho), "1"),
    **{s.t: "s", s.U: "q^2", s.U_4: "q^4", s.alpha: "s^-2", s.xi: "s^-1", s.length: "m", s.u: "u"},
}
#: Lengths along the axes are relative to the arm; those of an oscillator are its coordinate.
_CARTESIAN_UNITS = {
    ARM: {**dict.fromkeys((s.x, s.y, s.x_g, s.y_g), "1"), **dict.fromkeys((s.v_x, s.v_y), "s^-1")},
    OSCILLATOR: {**dict.fromkeys((s.x, s.y, s.x_g, s.y_g), "q"), **dict.fromkeys((s.v_x, s.v_y), "q s^-1")},
}


def expressions(effect: Effect, system: str) -> Iterator[tuple[sp.Expr, str, Mapping[sp.Symbol, str]]]:
    """Yield every expression of an effect with its unit and the units of symbols that only it has."""
    import sympy as sp

    if isinstance(effect, Sensor):
        true = sp.symbols([f"read_{channel}" for channel in System.of(system).channels], real=True)
        unit = "m" if System.of(system).has_rod else "q"
        for expression in effect.read(*true):
            yield sp.sympify(expression), unit, dict.fromkeys(true, unit)
        yield sp.sympify(effect.lateness()), "s", {}
        return
    if isinstance(effect, Shape):
        yield sp.sympify(effect.rest_angle()), "q", {}
        yield sp.sympify(effect.root_turn()), "1", {}
        return
    states = effect.states()
    own = dict.fromkeys(states, "1" if isinstance(effect, Joint) else "u" if isinstance(effect, Drive) else "q")
    if isinstance(effect, Mode):
        own[states[effect.displacement()]] = "q s^-1"
    for state, slope in states.items():
        yield slope, f"{own[state]} s^-1", own
    stated = effect.power() if isinstance(effect, Load) else effect.expression()  # type: ignore[attr-defined]
    received = "u" if effect.kind == "drive" and s.u in stated.free_symbols else _KIND_UNITS[effect.kind]
    yield sp.sympify(stated), received, own


class DeclarationContract:
    """Words, units, priors and algebra.

    Attributes
    ----------
    constants : mapping of float to str
        Dimensional constants that an expression may hold as numbers, with their units.
    """

    constants: ClassVar[Mapping[float, str]] = {9.80665: "m s^-2"}

    def test_declaration(self, effect: str) -> None:
        """Words, units, source and formula are there; no parameter shares its name with another one."""
        instance = get_effect(effect)
        text = inspect.getdoc(type(instance)) or ""
        assert instance.id() == effect
        assert instance.cite, f"{effect} cites no source"
        assert ".. math::" in text, f"the docstring of {effect} shows no formula"
        assert instance.title(), f"{effect} has no title"
        others = [p.name for e in catalogue().values() if e.id() != effect for p in e.parameters()]
        others += [p.name for b in base_names() for p in get_base(b).parameters()]
        others += [symbol.name for symbol in RECORDED]
        for p in instance.parameters():
            dimension(p.unit)
            assert p.meaning, f"{p.name} of {effect} has no meaning"
            assert p.latex in text, f"the docstring of {effect} does not show {p.latex}"
            assert p.name.isidentifier(), f"{p.name} of {effect} is no word"
            assert p.name not in others, f"another effect, a base or the kernel has a name {p.name}"

    def test_prior(self, effect: str) -> None:
        """Starts lie inside the bounds, where the prior is finite; an amplitude is absent at zero."""
        for p in get_effect(effect).parameters():
            low, high = p.bounds
            assert low < high
            usual = (*p.starts, p.default) if p.shape else p.starts
            assert all(low <= x <= high for x in usual), f"{p.name}: a default or start lies outside its bounds"
            assert p.shape or p.default == 0.0, f"{p.name} is no shape, but the effect is not absent by default"
            assert p.fixed or p.shape or p.starts, f"{p.name} has no start for a fit"
            assert 0 < p.prior.width < math.inf
            inside = np.linspace(max(low, -1e3), min(high, 1e3), 202)[1:-1]
            assert np.isfinite(p.prior.log_density(inside)).all(), (
                f"{p.name}: the prior is not finite inside the bounds"
            )

    def test_dimensions(self, effect: str, base: str) -> None:
        """Expressions scale as their kind when the units of time, length and coordinate change."""
        import sympy as sp

        instance, system = get_effect(effect), get_base(base).system
        rng = np.random.default_rng(1)
        cartesian = _CARTESIAN_UNITS[system]
        for expression, unit, own in expressions(instance, system):
            numbers = {
                f: self.constants[abs(float(f))] for f in expression.atoms(sp.Float) if abs(float(f)) in self.constants
            }
            named = {f: sp.Symbol(f"constant_{k}", positive=True) for k, f in enumerate(numbers)}
            units = {
                **_SYMBOL_UNITS,
                **cartesian,
                **own,
                **{sp.Symbol(p.name, real=True): p.unit for p in instance.parameters()},
            }
            units.update({named[f]: u for f, u in numbers.items()})
            scaled = expression.xreplace(named)
            # On an arm, angles are ratios of lengths: their unit is free only where no length meets them.
            on_arm = isinstance(instance, (Drive, Sensor)) or scaled.has(*cartesian, s.length)
            tied = instance.angular or (system == ARM and on_arm)
            size = {"time": 1.7, "coordinate": 1.0 if tied else 0.6, "length": 2.3, "drive": 0.8}
            assert scaled.free_symbols <= units.keys(), f"{effect} uses {scaled.free_symbols - units.keys()}"
            values = {x: float(rng.uniform(0.3, 1.2)) for x in sorted(scaled.free_symbols, key=str)}
            lacks = {}
            for quantity, factor in size.items():
                one = {**dict.fromkeys(size, 1.0), quantity: factor}
                changed = {x: v * natural_scale(units[x], **one) for x, v in values.items()}
                expected, found = float(scaled.subs(values)) * natural_scale(unit, **one), float(scaled.subs(changed))
                if not abs(found - expected) <= 1e-12 * abs(expected):
                    lacks[quantity] = f"{np.log(expected / found) / np.log(factor):.3g}" if found else "any"
            assert not lacks, f"{expression} is not in {unit}: its unit, or a parameter's, lacks the powers {lacks}"

    def test_absent_by_default(self, effect: str, base: str) -> None:
        """With its amplitudes at zero the effect is exactly absent: the same equations, reading and age remain."""
        import sympy as sp

        # Without the linear stiffness, only what does not scale with it.
        others = ["viscous_damping"] if effect == "linear_stiffness" else ["linear_stiffness", "viscous_damping"]
        context = tuple(e for e in others if e != effect)
        instance = get_effect(effect)
        amplitudes = [p for p in instance.parameters() if not p.shape]
        defaults = {sp.Symbol(p.name, real=True): sp.nsimplify(p.default) for p in amplitudes}
        try:
            without = at_rest(build_program(base, context), {})
        except InputError:
            # A base whose own losses scale with the stiffness cannot do without it.
            assert effect == "linear_stiffness"
            return
        program = build_program(base, (*context, effect))
        if isinstance(instance, Mode):
            # At rest at first, and nothing moves it.
            still = dict.fromkeys(memory_states(instance, base), sp.Integer(0))
            assert all(slope.xreplace(defaults | still) == 0 for slope in program.slopes[-len(still) :])
            defaults |= still
        absent = at_rest(program, defaults)
        assert len(absent) == len(without)
        for row, expected in zip(absent, without, strict=True):
            # An effect of shape goes through the base's own derivation: the same terms may stand in another order.
            same = isinstance(row, sp.Expr) and sp.factor_terms(sp.expand(row - expected)) == 0
            assert row == expected or same

    def test_round_trip(self, effect: str, base: str) -> None:
        """A model survives JSON with the same parameters and the same equations."""
        model = Model(base, ("linear_stiffness", "viscous_damping"), {"alpha": 8.79}).with_effect(
            *({effect} - {"linear_stiffness", "viscous_damping"})
        )
        copy = Model.from_dict(json.loads(json.dumps(model.to_dict())))
        assert copy == model
        assert copy.free == model.free
        # Derived once more, past the cache.
        assert build_program.__wrapped__(copy.base, copy.effects) == build_program(model.base, model.effects)
