"""The equation of motion of a base with one coordinate, term by term, as sympy writes it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Protocol

import sympy as sp

from discovery.declarations import symbols as s
from discovery.declarations.effect import Dissipation, Drive, Effect, Kinetic, Load, Memory, Mode, Potential
from discovery.declarations.registry import get_effect
from discovery.declarations.system import System
from discovery.equations.contributions import RECORDED, force_received, strands
from discovery.foundation.errors import InputError
from discovery.mechanics import get_base
from discovery.mechanics.rod import rod_of

if TYPE_CHECKING:
    from discovery.mechanics.base import Base, Mechanics

#: An input that is a motion, with its first two derivatives.
MOVING_INPUT = (s.u, *sp.symbols("u' u''", real=True))
#: What is read where the motion is prescribed.
_FORCE = sp.Symbol("F", real=True)


@dataclass(frozen=True)
class EquationTerms:
    """Inertia times acceleration, plus the terms, equals the drive."""

    inertia: sp.Expr  # factor of the acceleration [1]
    acceleration: sp.Symbol  # theta_t'' of an arm, q'' of an oscillator, u'' of a prescribed motion
    #: What the base (under its name) and each effect (under its id) add to the left-hand side [q s^-2]; an effect of
    #: shape adds nothing itself but changes the others.
    terms: tuple[tuple[str, sp.Expr], ...]
    drive: sp.Expr  # the right-hand side [q s^-2]
    memory: tuple[tuple[sp.Symbol, sp.Expr], ...]  # states of memory effects and modes with their time derivatives
    #: What is read of an oscillator, the errors of its instrument left out: q, q'' or the force F, with the modes; None
    #: for an arm.
    output: sp.Expr | None = None


class Sum(Protocol):
    """A base with effects, by their names: a `discovery.equations.model.Model`."""

    @property
    def base(self) -> str:
        """Name of the base."""

    @property
    def effects(self) -> tuple[str, ...]:
        """Ids of the effects."""

    @property
    def known(self) -> Mapping[str, float]:
        """Values of parameters that are not fitted."""


def motion_symbols(system: str) -> tuple[sp.Symbol, sp.Symbol, sp.Symbol]:
    """Return the symbols of coordinate, rate and acceleration: theta_t, theta_t', theta_t'', or q, q', q''."""
    name = System.of(system).coordinate
    return sp.symbols(f"{name} {name}' {name}''", real=True)


class _Lagrange:
    """Lagrange's equation of one coordinate: what each kind of effect adds to its left-hand side."""

    def __init__(self, base: Base, mechanics: Mechanics) -> None:
        self.channels = mechanics.channels
        self.mechanics = mechanics
        self.q, self.rate = mechanics.coordinates[0], mechanics.rates[0]
        if base.prescribed:
            self.q, self.rate = (self.channels[c].value for c in (s.delta, s.delta_dot))
        self.driven = base.push()
        self.meaning = {symbol: sp.sympify(channel.value) for symbol, channel in self.channels.items()}

    def gradient(self, expression: sp.Expr, channels: Sequence[sp.Symbol]) -> sp.Expr:
        """Return the derivative along the coordinate (or its rate) through the channels."""
        parts = [(c, sp.diff(expression, c)) for c in channels]
        return sp.Add(*[p.xreplace(self.meaning) * self.channels[c].jacobian[0] for c, p in parts if p != 0])

    def kinetic(self, effect: Kinetic) -> tuple[sp.Expr, sp.Expr]:
        """Return the inertia and the rest of d/dt dT/dq' - dT/dq."""
        energy = effect.expression().xreplace(self.meaning)
        momentum = sp.diff(energy, self.rate)
        moves = {self.q: self.rate, s.theta_m: s.omega_m, s.omega_m: s.alpha_m}
        # The acceleration itself meets the inertia.
        moves.pop(self.rate, None)
        rest = sp.Add(*[sp.diff(momentum, a) * b for a, b in moves.items()]) - sp.diff(energy, self.q)
        return sp.diff(momentum, self.rate), rest

    def memory(self, effect: Memory) -> tuple[sp.Expr, list[tuple[sp.Symbol, sp.Expr]]]:
        """Return the term of a memory effect, and its states with their slopes."""
        term, slopes = sp.Integer(0), []
        for k, (weight, (value, rate, jacobian)) in enumerate(strands(effect, self.mechanics)):
            own = {z: sp.Symbol(f"{z.name}_{k}", real=True) for z in effect.states()}
            here = own | {s.bend: value, s.bend_dot: rate} | ({} if self.driven is None else {s.push: self.driven})
            term -= weight * sp.diff(effect.expression(), s.bend_dot).xreplace(here) * jacobian[0]
            slopes += [(own[z], slope.xreplace(here)) for z, slope in effect.states().items()]
        return term, slopes

    def parts(self, effect: Effect) -> tuple[sp.Expr, sp.Expr, list[tuple[sp.Symbol, sp.Expr]]]:
        """Return what an effect adds to the inertia, its term on the left, and its states with their slopes."""
        if isinstance(effect, Kinetic):
            return *self.kinetic(effect), []
        if isinstance(effect, Memory):
            return sp.Integer(0), *self.memory(effect)
        return sp.Integer(0), self.push(effect), []

    def push(self, effect: Effect) -> sp.Expr:
        """Return dV/dq, dD/dq', or the load with its sign turned; zero for what moves nothing."""
        if isinstance(effect, Potential):
            return self.gradient(effect.expression(), s.POSITION_CHANNELS)
        if isinstance(effect, Dissipation):
            return self.gradient(effect.expression(), s.RATE_CHANNELS)
        if isinstance(effect, Load) and effect.on is not None:
            return -effect.expression().xreplace(self.meaning) * self.channels[effect.on].jacobian[0]
        return -self.gradient(effect.expression(), s.RATE_CHANNELS) if isinstance(effect, Load) else sp.Integer(0)


def _collected(expression: sp.Expr, motion: Sequence[sp.Symbol]) -> sp.Expr:
    """Return a polynomial in rates with each coefficient in its shortest form."""
    polynomial = sp.Poly(sp.expand(expression), *motion)
    return sp.Add(
        *[sp.trigsimp(c) * sp.prod(m**k for m, k in zip(motion, p, strict=True)) for p, c in polynomial.terms()]
    )


def equation_terms(model: Sum) -> EquationTerms:
    """Return the equation of motion term by term: Lagrange's equation, (15) of the source paper and its extensions.

    Symbols: theta_t, its rates theta_t' and theta_t'', delta, delta', theta_m'' for an arm; q, q', q'' and u, with u'
    and u'' where it is a motion, for an oscillator; parameters by name. theta_m is what the arm receives, u what the
    oscillator does; a gain known to be zero, as without an input, passes nothing on. Of a prescribed motion u is the
    coordinate, and the force F that it takes drives.

    Raises InputError for a base with several coordinates, or one whose mechanics has no closed form.
    """
    found = _terms(model.base, model.effects)
    gains = {symbol: 0 for symbol in found.drive.free_symbols if model.known.get(symbol.name) == 0.0}
    memory = tuple((state, slope.subs(gains)) for state, slope in found.memory)
    return replace(found, drive=found.drive.subs(gains), memory=memory)


@lru_cache(maxsize=64)
def _terms(base_name: str, effect_ids: tuple[str, ...]) -> EquationTerms:
    base = get_base(base_name)
    effects = [get_effect(e) for e in effect_ids]
    mechanics = base.mechanics(rod_of(effects))
    if base.n_coordinates != 1 or mechanics.assignments:
        raise InputError(f"The equations of base {base_name!r} have no readable closed form; export them as a program.")
    lagrange = _Lagrange(base, mechanics)
    here, moving, accelerating = motion_symbols(base.system)
    delta, delta_rate, motor_acceleration = sp.symbols("delta delta' theta_m''", real=True)
    names = {lagrange.q: here, lagrange.rate: moving, s.alpha_m: motor_acceleration}
    if base.system.has_rod:
        # The motor's angle and rate are told by the deflection and its rate.
        names |= {s.theta_m: here - delta, s.omega_m: moving - delta_rate}
    else:
        names |= dict(zip((s.theta_m, s.omega_m, s.alpha_m), MOVING_INPUT, strict=True))
        accelerating = MOVING_INPUT[2] if base.prescribed else accelerating

    def told(expression: sp.Expr) -> sp.Expr:
        return sp.factor_terms(s.readable(expression).xreplace(names))

    inertia, drive, output, terms = mechanics.mass[0][0], sp.Integer(0), None, []
    if base.system.has_rod:
        bare = sp.expand(-mechanics.force[0].xreplace(names))
        terms = [(base_name, _collected(bare, (moving, delta_rate, motor_acceleration)))]
    else:
        drive, output = mechanics.force[0].xreplace(names), base.reading(None)[0]
        if base.prescribed:
            per_force = -1 / sp.diff(output, s.acceleration)
            inertia, drive, output = sp.diff(output, s.alpha_m) * per_force, _FORCE * per_force, _FORCE
        output = output.xreplace({**names, s.acceleration: accelerating})
    memory: list[tuple[sp.Symbol, sp.Expr]] = []
    for name, effect in zip(effect_ids, effects, strict=True):
        more, term, states = lagrange.parts(effect)
        inertia = inertia + more
        own = [(state, told(slope)) for state, slope in states]
        if isinstance(effect, Mode):
            own = [(state, sp.expand(slope)) for state, slope in own]
            z, _ = states[0]
            output += z if base.reads_state else sp.Symbol(f"{z}''", real=True)
        memory += own
        terms.append((name, told(term)))
    shown = tuple((n, t) for n, t in terms if t != 0)
    return EquationTerms(told(inertia), accelerating, shown, drive, (*memory, *_lagging(effects)), output)


def _lagging(effects: Sequence[Effect]) -> list[tuple[sp.Symbol, sp.Expr]]:
    """Return the states that the input passes, with their slopes, in what was recorded."""
    _, states = force_received([e for e in effects if isinstance(e, Drive)], RECORDED[0])
    return [(state, s.readable(slope)) for state, slope in states.items()]


def equation_of_motion(model: Sum) -> sp.Eq:
    """Return acceleration + ... = 0 (or = the drive) of a model, see `equation_terms`.

    Raises InputError for a base with several coordinates, or one whose mechanics has no closed form.
    """
    found = equation_terms(model)
    left = found.inertia * found.acceleration + sp.Add(*[term for _, term in found.terms])
    return sp.Eq(left, found.drive)
