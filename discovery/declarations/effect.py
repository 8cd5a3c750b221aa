"""What a physical effect is: one named, cited, unit-carrying contribution to the equation of motion.

A new effect is one small class in one file: its parameters and one expression in `discovery.declarations.symbols`.
Simulation, fit, posterior, attribution, report row, catalogue page and contract tests follow.

>>> from discovery.declarations.registry import catalogue
>>> catalogue()["cubic_stiffness"].expression()
beta*delta**4/4
"""

from __future__ import annotations

import inspect
import re
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING, ClassVar

from discovery.declarations.parameters import Parameter
from discovery.declarations.system import ARM, OSCILLATOR, System
from discovery.foundation.arguments import check_names

if TYPE_CHECKING:
    import sympy as sp

    from discovery.foundation.arrays import FloatArray

__all__ = [
    "ARM",
    "OSCILLATOR",
    "ROTOR",
    "SHAKEN",
    "SPRING",
    "WEIGHT",
    "Closure",
    "Dissipation",
    "Drive",
    "Effect",
    "Expressed",
    "Joint",
    "Kinetic",
    "Load",
    "Memory",
    "Mode",
    "Potential",
    "Sensor",
    "Shape",
    "first_sentence",
]

#: What an effect may need: a linear spring, an angle that nothing ties, a falling body, or a base that moves.
SPRING, ROTOR, WEIGHT, SHAKEN = "spring", "rotor", "weight", "shaken"


def first_sentence(kind: type) -> str:
    """Return the first sentence of the docstring of a class."""
    return (inspect.getdoc(kind) or "").partition("\n")[0].rstrip(".")


class Effect(ABC):
    """One contribution to the mechanics, the drive or the reading of a system.

    Subclass one of the kinds below, declare `Parameter` attributes and write the expression. The class docstring holds
    the formula and its meaning; `cite` names the source.

    Examples
    --------
    >>> friction = get_effect("coulomb_friction")
    >>> friction.id(), friction.kind, friction.title()
    ('coulomb_friction', 'dissipation', 'Dry friction of constant size against the motion')
    >>> [(p.name, p.unit) for p in friction.parameters()]  # q: unit of the coordinate
    [('f_c', 's^-2 q'), ('v_c', 's^-1 q')]
    >>> [p.name for p in friction.fitted("oscillator")]
    ['f_c']
    >>> friction.imitates({"f_c": 0.1, "v_c": 1e-3}, time=0.1, duration=10.0, step=0.01, reach=1.0, passes=1.0)
    False
    >>> import numpy as np
    >>> force = get_effect("periodic_disturbance")
    >>> lag = get_effect("input_lag")
    >>> [str(z) for z in lag.states()], friction.states(), [str(z) for z in lag.relaxation()]
    (['u_l'], {}, ['u_l'])
    >>> force.own().name, force.gathered(force.turned(np.array([0.3, 0.4]), 0.5)[None])[1]
    ('psi', array([0.]))
    """

    kind: ClassVar[str]
    #: Kinds of system on which the effect is meaningful.
    systems: ClassVar[frozenset[str]] = frozenset({ARM, OSCILLATOR})
    cite: ClassVar[str] = ""  #: Where the law comes from.
    called: ClassVar[str] = ""  #: Words for it where those of its id mislead.
    #: True for a law so pliable that it may imitate others: it is tried last, see also `imitates`.
    pliable: ClassVar[bool] = False
    imitative: ClassVar[bool] = False  #: True for a law that does at any values what others do, see `imitates`.
    reduces_to: ClassVar[frozenset[str]] = frozenset()  #: Ids of effects that it is where an amplitude vanishes.
    #: Quantity of an arm's rig file of which a relative error reads as the effect's only parameter does, if any.
    stands_for: ClassVar[str] = ""
    angular: ClassVar[bool] = False  #: True for a law of an angle: it has no meaning in another unit than radians.
    pictured: ClassVar[bool] = False  #: True for a fault of a picture: no camera reads a rate or a force.
    #: True for a law of the distance from a place of rest: it has no meaning on a body that is tied to none.
    anchored: ClassVar[bool] = False
    ties: ClassVar[bool] = False  #: Whether it itself ties a body to a place.
    #: True for a law that remembers where the motion turned: without reversals it is no other than one of the place.
    remembers: ClassVar[bool] = False
    #: What a base, or the place of a declared system, must have for it: `SPRING`, `ROTOR`, `WEIGHT` or `SHAKEN`.
    needs: ClassVar[str] = ""
    place: ClassVar[str] = ""  #: Where it acts on a declared system, see `discovery.declarations.place`.

    @classmethod
    def id(cls) -> str:
        """Return the word that users see: the class name in snake case."""
        return re.sub(r"(?<!^)(?=[A-Z])", "_", cls.__name__).lower()

    @classmethod
    @cache
    def parameters(cls) -> tuple[Parameter, ...]:
        """Return the declared parameters in the order of the class body."""
        owners = (vars(owner).items() for owner in reversed(cls.__mro__))
        found = {n: p for own in owners for n, p in own if isinstance(p, Parameter)}
        return tuple(replace(p, read=cls.kind == "sensor") for p in found.values())

    @classmethod
    def fitted(cls, system: str) -> tuple[Parameter, ...]:
        """Return the parameters that a fit estimates on this kind of system: "oscillator" or "flexible_arm"."""
        check_names([system], list(System), "The catalogue", "kind of system")
        return tuple(p for p in cls.parameters() if not p.fixed and (System.of(system).has_rod or not p.planar))

    @classmethod
    def imitates(
        cls, values: Mapping[str, float], time: float, duration: float, step: float, reach: float, passes: float
    ) -> float:
        """Return whether, at these values, a law does what others do: 0 or 1; infinite where it could be anything.

        Given are natural time, longest duration, step between readings [s], half of the way [q], and its `passes`.
        """
        return cls.pliable or cls.imitative

    @classmethod
    def turned(cls, amplitudes: FloatArray, own: float) -> FloatArray:
        """Return the amplitudes (k,) that do in a recording without an own value what these do with it: a sum."""
        return amplitudes + own

    @classmethod
    def gathered(cls, amplitudes: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return common amplitudes (k,) and own values (m,) for those of each recording (m, k): zero for the first."""
        return amplitudes[0], amplitudes[:, 0] - amplitudes[0, 0]

    @classmethod
    def own(cls) -> Parameter | None:
        """Return the parameter of which every recording has its own value, if there is one."""
        return next((p for p in cls.parameters() if p.own), None)

    def states(self) -> dict[sp.Symbol, sp.Expr]:
        """Return each extra state with its time derivative; it is zero where a recording starts."""
        return {}

    def relaxation(self) -> dict[sp.Symbol, sp.Expr]:
        """Return bounds of how fast states forget, -dz'/dz [s^-1], which steps should not have to resolve."""
        return {}

    @classmethod
    def title(cls) -> str:
        """Return the first sentence of the docstring."""
        return first_sentence(cls)

    def __repr__(self) -> str:
        return f"<{self.kind} effect {self.id()}({', '.join(p.name for p in self.parameters())})>"


class Expressed(Effect):
    """An effect that is one expression."""

    @abstractmethod
    def expression(self) -> sp.Expr:
        """Return the expression of the effect's kind."""


class Kinetic(Expressed):
    """A kinetic energy T of channel rates, per unit inertia [q^2 s^-2]."""

    kind = "kinetic"


class Potential(Expressed):
    """A potential energy V of channel positions (and time), per unit inertia [q^2 s^-2]."""

    kind = "potential"
    anchored = True


class Dissipation(Expressed):
    """A Rayleigh dissipation function D, even in the channel rates, per unit inertia [q^2 s^-3]."""

    kind = "dissipation"


class Load(Expressed):
    """A load given by its power P, linear in the channel rates, per unit inertia [q^2 s^-3].

    A force that itself depends on rates names the channel rate `on` which it acts: its expression is then the force
    [q s^-2], and its power is the force times that rate.
    """

    kind = "load"
    on: ClassVar[sp.Symbol | None] = None

    def power(self) -> sp.Expr:
        """Return P."""
        return self.expression() if self.on is None else self.expression() * self.on


class Closure(Expressed):
    """A static law rho/l of the deflection that others use (the radius law)."""

    kind = "closure"


class Memory(Expressed):
    """A load of power P on the bending that depends on states of its own; written for one `bend`, it acts on each.

    With `local`, one `bend` is the curvature at one place of the rod, in units of the deflection of a linear spring.
    """

    kind = "memory"
    anchored = True
    local: ClassVar[bool] = False

    @abstractmethod
    def states(self) -> dict[sp.Symbol, sp.Expr]:
        """Return each extra state with its time derivative."""


class Mode(Memory):
    """Another mode of vibration, moved by the input beside the coordinate and added to what the instrument reads."""

    kind = "mode"
    systems = frozenset({OSCILLATOR})
    anchored = False

    def expression(self) -> sp.Expr | int:
        """Return no power: modes are independent of each other."""
        return 0

    @abstractmethod
    def displacement(self) -> sp.Symbol:
        """Return the state that adds to the coordinate; the next state is its rate."""


class Drive(Expressed):
    """What the system really receives: the effective motor angle (or input u) in terms of the recorded one and time.

    States [u] are those of an input that is a force.
    """

    kind = "drive"


class Shape(Effect):
    """What changes the rod itself: override what differs from a straight rod in a rigid clamp."""

    kind = "shape"
    systems = frozenset({ARM})

    def rest_angle(self) -> sp.Expr | int:
        """Return the slope of the unloaded rod against its root [q], a polynomial in the arc length `arc`."""
        return 0

    def root_turn(self) -> sp.Expr | int:
        """Return the turn of the root per bending curvature there, in lengths of the arm [-]."""
        return 0


class Joint(Expressed):
    """A joint between hub and rod: the turn of the root [q] as `root` asks for; states [-] rest where that does."""

    kind = "joint"
    systems = frozenset({ARM})


class Sensor(Effect):
    """What the instrument reports instead of the state; override what the instrument changes."""

    kind = "sensor"

    def arm_reading(self, tip_x: sp.Expr, tip_y: sp.Expr) -> tuple[sp.Expr, sp.Expr]:
        """Return the reported tip position [m] for the true one [m]."""
        return tip_x, tip_y

    def oscillator_reading(self, output: sp.Expr) -> sp.Expr:
        """Return the reported output for the true one."""
        return output

    def read(self, *true: sp.Expr) -> tuple[sp.Expr, ...]:
        """Return what is reported for a true tip position or output."""
        return self.arm_reading(*true) if len(true) == 2 else (self.oscillator_reading(*true),)

    def lateness(self) -> sp.Expr | int:
        """Return the age of the reported state [s]; positive when the instrument is late."""
        return 0
