"""A system that a user declares, as a base: Lagrange's equations from its energies."""

from __future__ import annotations

from functools import cache, cached_property

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from discovery.declarations import symbols as s
from discovery.declarations.effect import OSCILLATOR
from discovery.declarations.place import INERTIA, local
from discovery.mechanics.at_rest import LOOSE, AtRest
from discovery.mechanics.base import Channel, Mechanics, Place, Strand
from discovery.mechanics.declared_equations import (
    INPUT,
    Unread,
    constant_parameter,
    unread_coordinates,
)
from discovery.mechanics.first_angle import ReadByAngle
from discovery.mechanics.lagrangian import total_derivative
from discovery.mechanics.rod import STRAIGHT


class DeclaredBase(AtRest):
    """The bare mechanics of a declared system."""

    system = OSCILLATOR
    blocks = 2

    @classmethod
    def parameters(cls):
        """Return the constants of the declaration, in SI units, and where coordinates begin that are not read."""
        constants = (constant_parameter(name, constant) for name, constant in cls.declaration.constants.items())
        return (*constants, *(start for each in cls.unread() for start in each.starts))

    @classmethod
    @cache
    def unread(cls) -> tuple[Unread, ...]:
        """Return the coordinates whose start no reading tells."""
        own = cls()
        return unread_coordinates(cls.declaration.coordinates, own.gradient, own.shape, own.inertia, own.order)

    def mechanics(self, rod=STRAIGHT) -> Mechanics:
        """Return the mathematics: d/dt dT/dq' - dT/dq + dV/dq + dD/dq' = forces."""
        e, (q, rates, _) = self.equations, self.moving
        momenta = [sp.diff(e.kinetic, rate) for rate in rates]
        mass = tuple(tuple(sp.diff(p, rate) for rate in rates) for p in momenta)
        force = [
            e.forces[i]
            - total_derivative(momenta[i], q, rates)
            + sp.diff(e.kinetic - e.potential, q[i])
            - sp.diff(e.dissipation, rates[i])
            for i in range(len(q))
        ]
        loss = self._at_rest(sp.hessian(e.dissipation, rates))
        channels: dict[sp.Symbol, Channel] = {}
        assignments: list[tuple[sp.Symbol, sp.Expr]] = []
        places: dict[str, Strand] = {}
        for name, (expression, _) in e.places.items():
            own, inertia, stiffness = self._place(name, expression)
            channels |= {local(c, name): channel for c, channel in own.items()}
            assignments += [(local(INERTIA, name), sp.Float(inertia)), (local(s.alpha, name), stiffness)]
            assignments += [(local(s.xi, name), self._across(name, loss) / inertia)]
            places[name] = (own[s.delta].value, own[s.delta_dot].value, own[s.delta].jacobian)
        # What is not named after a place acts at the first one: a force that stands for whatever is unknown.
        first = next(iter(e.places))
        weight = local(INERTIA, first)
        for c in (*s.POSITION_CHANNELS, *s.RATE_CHANNELS):
            found = channels[local(c, first)]
            channels[c] = Channel(found.value, tuple(weight * j for j in found.jacobian), found.bias)
        told = tuple(self._received(f) for f in force)
        heard = {c: self._heard(channel) for c, channel in channels.items()}
        return Mechanics(
            q,
            rates,
            assignments=tuple(assignments),
            channels=heard,
            mass=mass,
            force=told,
            bending=tuple(places.values())[:1],
            places=places,
        )

    def _place(self, name: str, value: sp.Expr) -> tuple[dict[sp.Symbol, Channel], float, sp.Expr]:
        """Return the channels of a place, its inertia as a force there feels it, and its stiffness over that."""
        q, rates, _ = self.moving
        jacobian = tuple(sp.diff(value, a) for a in q)
        rate = total_derivative(value, q, rates)
        still = tuple(sp.Integer(0) for _ in q)
        position, moving = Channel(value, jacobian), Channel(rate, jacobian, total_derivative(rate, q, rates))
        square = Channel(rate**2, tuple(2 * rate * j for j in jacobian))
        found = dict.fromkeys((s.theta, s.delta, s.x, s.x_g, s.slope), position)
        found |= dict.fromkeys((s.omega, s.delta_dot, s.v_x, s.slope_dot), moving)
        found |= dict.fromkeys((s.y, s.y_g, s.v_y), Channel(sp.Integer(0), still))
        found |= dict.fromkeys((s.v2, s.w2), square)
        found[s.U] = Channel(value**2 / 2, tuple(value * j for j in jacobian))
        found[s.U_4] = Channel(value**4 / 4, tuple(value**3 * j for j in jacobian))
        way = self.numbers(sp.Matrix([jacobian]))[0]
        shape = np.linalg.solve(self.inertia, way)
        inertia = 1.0 / float(way @ shape)
        stiffness = self._across(name, self._stiffness())
        if stiffness == 0:
            shape *= inertia
            stiffness = (sp.Matrix([shape.tolist()]) * self._stiffness() * sp.Matrix(shape.tolist()))[0]
        return found, inertia, sp.sympify(stiffness) / inertia

    def _across(self, place: str, matrix: sp.Matrix) -> sp.Expr:
        """Return what of a stiffness or loss matrix acts across a place alone: zero where nothing does.

        Between two coordinates that is what couples them, on one coordinate whatever holds that.
        """
        way = self.way(place)
        moving = np.flatnonzero(way)
        if moving.size > 2:
            return sp.Integer(0)
        i, j = int(moving[0]), int(moving[-1])
        return sp.sympify(matrix[i, j] / (way[i] * way[j]))

    def _is_sprung(self, place: str) -> bool:
        """Return whether a linear spring acts across a place, not gravity or another law."""
        q = self.moving[0]
        stiffness = self._across(place, sp.hessian(self.equations.potential, q))
        return stiffness != 0 and not stiffness.free_symbols & {*q, *INPUT, s.u}

    def way(self, place: str) -> NDArray:
        """Return the displacement of a place per coordinate, at rest."""
        return self.numbers(sp.Matrix([[sp.diff(self.equations.places[place][0], a) for a in self.moving[0]]]))[0]

    def places(self):
        """Return the declared places."""
        return self._places

    @cached_property
    def _places(self) -> dict[str, Place]:
        return {
            name: Place(unit, self._is_tied(name), self._place(name, law)[1], self._is_sprung(name))
            for name, (law, unit) in self.equations.places.items()
        }

    def _is_tied(self, place: str) -> bool:
        stiffness, way = self.stiffness(), self.way(place)
        answer = np.linalg.lstsq(stiffness, way, rcond=LOOSE)[0]
        return bool(np.allclose(stiffness @ answer, way, rtol=1e-6, atol=1e-6 * np.abs(way).max()))

    @property
    def reads_pushed(self):
        """Whether the output is the only coordinate, bar a factor, and the first place moves as that."""
        q, (first, _) = self.moving[0], next(iter(self.equations.places.values()))
        return len(q) == 1 and first == self.equations.output and bool((first / q[0]).is_number)

    @cached_property
    def is_pushed(self) -> bool:
        """Whether an input acts that is no motion."""
        return s.u in sp.Tuple(*self.mechanics().force).free_symbols

    def gains(self):
        """Return the constants without any of which the input does nothing."""
        if not self.is_pushed:
            return set()
        force, zero = sp.Tuple(*self.mechanics().force), sp.Integer(0)
        without = {x: force.xreplace({x: zero}) for x in force.free_symbols - {s.u}}
        # What an input is measured by is no gain: without k no input is left of u / (u + k), but what it does is.
        return {
            x.name for x, left in without.items() if not left.has(s.u) and left == force.xreplace({x: zero, s.u: zero})
        }

    def _received(self, expression: sp.Expr) -> sp.Expr:
        return expression if self.input_moves else expression.xreplace({s.theta_m: s.u})

    def _heard(self, channel: Channel) -> Channel:
        value, bias, *jacobian = map(self._received, map(sp.sympify, (channel.value, channel.bias, *channel.jacobian)))
        return Channel(value, tuple(jacobian), bias)

    @property
    def channels(self):
        """The output, and what is read beside it."""
        return (*super().channels, *self.equations.also)

    @cached_property
    def orders(self):
        """Those of the output, and of what is read beside it."""
        return (self.order, *map(self.order_of, self._also))

    @property
    def _also(self) -> list[sp.Expr]:
        return [law for law, _ in self.equations.also.values()]

    def reading(self, closure, rod=STRAIGHT):
        """Return the declared output, and what is read beside it."""
        return tuple(map(self._received, (self.equations.output, *self._also)))

    @property
    def adrift(self) -> bool:
        """Whether a slow force meets no stiffness where a position is read."""
        return not (self.order or self._return) and self.is_pushed and bool(self.gradient.any())

    @property
    def starts(self) -> int:
        """Two numbers, but one where a rate is read that no spring and no gravity changes."""
        return 1 if self.order == 1 and not self._return else 2

    def initial_coordinates(self, deflection, rate, drive, form=(0, 0)):
        """Return coordinates and rates as a static force at the output would lead them, read as a deflection.

        Where rates are read the numbers are one and its slope: coordinates begin where what pulls them back, linear
        and at the guesses, makes it alone. Where accelerations are, both are of the output's position. `form` holds
        how far coordinates that are not read begin from there, and how fast, each (k,), one after the other.
        """
        way, d, v = self.shape[:, None], np.asarray(deflection)[None], np.asarray(rate)[None]
        if self.order == 1:
            return self._beside(form, way * v * (-1.0 / self._return if self._return else 0.0), way * d)
        return self._beside(form, way * d, way * v)

    def _beside(self, form, q, rates):
        """Return a start with the coordinates that are not read moved beside it."""
        for each, moved, moving in zip(self.unread(), form[0::2], form[1::2], strict=False):
            q, rates = q + each.way[:, None] * np.asarray(moved), rates + each.way[:, None] * np.asarray(moving)
        return q, rates

    def first_state(self, read):
        """Return the start of the one angle of a free system, read as a deflection; None where its reading is one."""
        found = None if self._by_angle is None else self._by_angle.begin(read)
        return None if found is None else (found[0] / self.shape[0], found[1] / self.shape[0])

    @cached_property
    def _by_angle(self) -> ReadByAngle | None:
        """What is read by the one angle of a free system; None of any other."""
        (angle, *more), (unit, *_) = self.moving[0], self.declaration.coordinates.values()
        bends = unit == "rad" and self.declaration.input is None and self.slopes(self.equations.output, 0).any()
        if more or not bends:
            return None
        # At rest what pulls back is all that accelerates.
        e, (rate,), (acceleration,) = self.equations, *self.moving[1:]
        still = {acceleration: -sp.diff(e.potential, angle) / sp.diff(e.kinetic, rate, 2), rate: 0}
        return ReadByAngle.of([law.subs(still).xreplace(self.guess) for law in (e.output, *self._also)], angle)

    def begun(self, read):
        """Return what tells where coordinates that are not the output's begin, and how fast, by parameter.

        Of places that are read beside an output that is one, as the linear motion about rest has them.
        """
        laws, ways = self._also, self.unread()
        told = (np.array(self.orders[1:], int) == 0) & np.isfinite(read[1:]).all(axis=1)
        if self.order or not ways or not told.any() or not np.isfinite(read[0]).all():
            return {}
        slopes = self.numbers(sp.Matrix([[sp.diff(law, a) for a in self.moving[0]] for law in laws]))[told]
        beside = read[1:] - np.outer(self.numbers(sp.Matrix(laws))[:, 0], (1.0, 0.0))  # counted from what rests
        moved = slopes @ np.column_stack([each.way for each in ways])
        if np.linalg.matrix_rank(moved) < len(ways):
            return {}
        begins = np.linalg.lstsq(moved, beside[told] - np.outer(slopes @ self.shape, read[0]), rcond=None)[0]
        names = (p.name for each in ways for p in each.starts)
        return dict(zip(names, begins.ravel().tolist(), strict=True))
