"""What a base is: coordinates, inertia, and the channels on which effects push.

A base hands over straight-line mathematics: a list of assignments, the mass matrix M and bias force of
M(q) q'' = force + sum over channels of J^T F, and for every channel its value or rate, its Jacobian dc/dq and the part
of its acceleration that does not contain q''. `discovery.simulation.kernel.compile` turns this into a kernel.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import lru_cache
from typing import TYPE_CHECKING, ClassVar

from numpy.typing import NDArray

from discovery.declarations.effect import ARM, ROTOR, SPRING, Effect
from discovery.declarations.parameters import Parameter
from discovery.declarations.priors import Normal
from discovery.declarations.system import System
from discovery.declarations.unit_suffixes import named_unit
from discovery.declarations.units import dimension, in_coordinate
from discovery.mechanics.rod import STRAIGHT, Rod

if TYPE_CHECKING:
    import sympy as sp

#: One measure of the bending: its value, its rate, and its Jacobian.
Strand = tuple["sp.Expr", "sp.Expr", tuple["sp.Expr", ...]]
#: Joints at the root of the rod: a base whose only coordinate is the angle of the tip has no root that could turn.
ROOT_JOINTS = frozenset({"base_backlash", "base_hysteresis"})
#: Laws of the radius: part of every base whose tip moves as the elastica's does.
RADIUS_LAWS = frozenset({"radius_law", "radius_quartic", "radius_tension"})
#: What a radius that shortens as the arm bends does to the motion: part of every base whose tip moves on that radius.
SHORTENING_RADIUS = frozenset({"centrifugal_stiffening", "coriolis_coupling", "radial_inertia"})


@dataclass(frozen=True)
class Channel:
    """One quantity on which effects push."""

    value: sp.Expr  # the quantity (a position-like channel) or rate
    jacobian: tuple[sp.Expr, ...]  # derivative with respect to the coordinates (of a rate: to the coordinate rates)
    bias: sp.Expr | int = 0  # for a rate: its time derivative at zero coordinate accelerations


@dataclass(frozen=True)
class RodEnd:
    """How the end of the rod turns beyond what the shapes of a base show, where it bears a moment."""

    #: stiffness, damping, inertia: moment per such turn [s^-2] and per its rate [s^-1], and the inertia of the rod in
    #: it [-], over m_eff l^2.
    stiffness: sp.Expr
    damping: sp.Expr
    inertia: sp.Expr


@dataclass(frozen=True)
class Place:
    """A displacement of a declared system at which effects act.

    `unit`: its SI unit. `tied`: whether springs answer a force there with a finite deflection. `inertia`: its reference
    inertia [J s^2 over the square of `unit`]. `sprung: bool`: whether a linear spring acts across it.
    """

    unit: str
    tied: bool
    inertia: float
    sprung: bool = False

    def suits(self, effect: Effect) -> bool:
        """Return whether an effect has a meaning here; a linear spring has none beside a declared one."""
        spring = effect.id() == "linear_stiffness"
        angle = self.unit in ("rad", "1") or not effect.angular
        held = self.tied or not effect.anchored or spring
        there = {"": True, SPRING: self.sprung, ROTOR: not self.tied}.get(effect.needs, False)
        return angle and held and there and not (spring and self.tied and self.sprung)

    def unit_of(self, parameter: Parameter) -> str:
        """Return the SI unit of the values of a parameter of an effect at this place."""
        if self.unit == "1" and not parameter.forced:
            # What has no unit and can be displaced is an angle.
            return in_coordinate(parameter.unit, "rad")
        found = {base: power for base, power in dimension(parameter.unit).items() if base != "q"}
        powers = [(dimension(self.unit), dimension(parameter.unit).get("q", Fraction(0)) - 2 * parameter.forced)]
        powers += [(dimension("J s^2"), Fraction(1))] if parameter.forced else []
        for unit, power in powers:
            for base, exponent in unit.items():
                found[base] = found.get(base, Fraction(0)) + exponent * power
        return named_unit({base: power for base, power in found.items() if power})


@dataclass(frozen=True)
class Mechanics:
    """The mathematics of a base, ready to be printed."""

    #: coordinates, rates: q and q'.
    coordinates: tuple[sp.Symbol, ...]
    rates: tuple[sp.Symbol, ...]
    assignments: tuple[tuple[sp.Symbol, sp.Expr], ...]  # intermediate values in order of computation
    channels: Mapping[sp.Symbol, Channel]  # what the symbols of `discovery.declarations.symbols` are in this base
    mass: tuple[tuple[sp.Expr, ...], ...]  # mass matrix per unit of effective inertia
    #: Inertial forces at zero q'' (centrifugal, Coriolis, base acceleration), on the right-hand side.
    force: tuple[sp.Expr, ...]
    bending: tuple[Strand, ...]  # components of the bending: value, rate and Jacobian of each
    #: The same for the curvature at places of the rod, over three, each with its weight in an integral of its square.
    fibres: tuple[tuple[float, Strand], ...] = ()
    #: The same for the curvature at the root over three; None where the root is no part of the base.
    root: Strand | None = None
    end: RodEnd | None = None  # how the end gives way to a moment; None where only the shapes do
    #: Of a declared system: the displacement of each place, its rate and its Jacobian.
    places: Mapping[str, Strand] = field(default_factory=dict)


class Base(ABC):
    """The bare mechanics of a system: subclass and describe one."""

    name: ClassVar[str]
    #: Kind of system that it describes.
    system: ClassVar[System]
    #: Number of coordinates.
    n_coordinates: ClassVar[int]
    #: Effects whose physics is already in this base, and which it therefore replaces, or which it cannot show.
    provides: ClassVar[frozenset[str]] = frozenset()
    #: Effects that do what others do where a spring or gravity ties the coordinate.
    provides_tied: ClassVar[frozenset[str]] = frozenset()
    #: What effects may need of it, see `discovery.declarations.effect.Effect.needs`.
    has: ClassVar[frozenset[str]] = frozenset()
    #: Typical distance of its tip from that of the structure which it idealises, rms for each axis, in lengths; 0 where
    #: it is not stated.
    accuracy: ClassVar[float] = 0.0
    #: Whether the input is a motion, theta_m with its two derivatives, rather than a force u.
    input_moves: ClassVar[bool] = False
    #: Whether something ties the body to a place, so that it can be deflected from it.
    anchored: ClassVar[bool] = True
    #: Whether the coordinate moves as recorded: nothing is integrated, and there is no initial state.
    prescribed: ClassVar[bool] = False
    #: Whether the coordinate is an angle about a pivot that the input shifts: it tells no path in the plane.
    pivots: ClassVar[bool] = False
    #: What the instrument reads, in a word, where that is not the state but follows from it: a force, an acceleration.
    reads: ClassVar[str] = ""
    #: What the input is, in a word, where the kind of system does not tell it.
    input_word: ClassVar[str] = ""
    #: Parameter that is the acceleration per unit of what pushes the body, an input or a command; none where none does.
    gain: ClassVar[str] = ""
    #: Whether the library of the sparse regression describes it.
    in_library: ClassVar[bool] = False
    #: Bases of the same parameters that this one approximates; an answer stands on the first that is as likely.
    approximates: ClassVar[tuple[str, ...]] = ()
    #: Parameter sets simulated side by side in one block of the kernel.
    lanes: ClassVar[int] = 16
    #: Blocks that take the time of one beside what a call costs, on two cores: fewer where a step is dear.
    blocks: ClassVar[int] = 4

    @classmethod
    def parameters(cls) -> tuple[Parameter, ...]:
        """Return the parameters of the bare system."""
        return tuple(p for owner in reversed(cls.__mro__) for p in vars(owner).values() if isinstance(p, Parameter))

    @abstractmethod
    def mechanics(self, rod: Rod = STRAIGHT) -> Mechanics:
        """Return the mathematics."""

    def places(self) -> Mapping[str, Place]:
        """Return where effects act, by name; none where they act on the only coordinate there is."""
        return {}

    def push(self) -> sp.Expr | None:
        """Return what the input alone does to the coordinate [s^-2 q]; None where no mode could be added to it."""
        return None

    def gains(self) -> set[str]:
        """Return the parameters without any of which the input does nothing."""
        push = self.push()
        return set() if push is None else {x.name for x in push.free_symbols}

    @property
    def starts(self) -> int:
        """How many numbers its start has: deflection and rate, or less where what is read does not depend on them."""
        return 0 if self.prescribed else 2

    @property
    def order(self) -> int:
        """Whether positions are read, rates, or accelerations: 0, 1, or 2."""
        return 2 if self.reads == "acceleration" else 0

    @property
    def reads_state(self) -> bool:
        """Whether the instrument reads the state itself."""
        return not self.reads

    @property
    def begins(self) -> tuple[str, ...]:
        """Parameters that say where coordinates begin that are not read: every recording has its own values."""
        return tuple(p.name for p in self.parameters() if p.own)

    @property
    def reads_pushed(self) -> bool:
        """Whether the instrument reads the one coordinate there is, and a force without a place pushes on that."""
        return self.reads_state

    @property
    def adrift(self) -> bool:
        """Whether a force pushes what is read, a position, and nothing of the base pulls it back."""
        return False

    def drifts(self, effects: Iterable[Effect]) -> bool:
        """Return whether that is so with these effects, too."""
        return self.adrift and not any(effect.kind == "potential" and effect.anchored for effect in effects)

    def idle(self, q: NDArray, rate: NDArray, values: Mapping[str, float]) -> NDArray:
        """Return the input at which nothing pushes the body, in these states."""
        return 0.0 * q

    @property
    def is_pushed(self) -> bool:
        """Whether the input is a force or a voltage, which passes a drive before it acts, not a motion."""
        return self.push() is not None and not self.input_moves

    @property
    def channels(self) -> tuple[str, ...]:
        """What `reading` gives, by name."""
        return self.system.channels

    @property
    def orders(self) -> tuple[int, ...]:
        """How often what each channel reads is differentiated: 0 for positions, 1 for rates, 2 for accelerations."""
        return (self.order,) * len(self.channels)

    @abstractmethod
    def reading(self, closure: sp.Expr | None, rod: Rod = STRAIGHT) -> tuple[sp.Expr, ...]:
        """Return the true output in coordinates and theta_m: tip x, y in lengths of the arm, or the coordinate.

        `closure` is rho/l as a function of `delta` where the model declares a radius law.
        """

    @abstractmethod
    def initial_coordinates(
        self, deflection: NDArray, rate: NDArray, drive: Sequence[float] | NDArray, form: Sequence = (0, 0)
    ) -> tuple[NDArray, NDArray]:
        """Return q, q' of shape (n_coordinates, k) for tip deflections [q] and rates [q/s] of shape (k,).

        `drive` holds theta_m, theta_m' at that time (zeros for an oscillator), `form` the deflection of the unloaded
        rod [q] and the turn of its root per curvature [-], see `discovery.equations.program.Program.form`.
        """

    def first_state(self, read: NDArray) -> tuple[float, float] | None:
        """Return the start that readings tell, deflection and its rate, where they are no lines of it; None otherwise.

        `read` (c, 2): as for `begun`.
        """
        return None

    def begun(self, read: NDArray) -> dict[str, float]:
        """Return by name what readings tell of the parameters that `begins` lists; nothing of those that they do not.

        `read` (c, 2): first value of every channel, and its rate; NaN of one that is first read later.
        """
        return {}

    def calmed(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return the values at which the integration step is chosen: as they are, where every motion converges."""
        return dict(values)

    def highest_frequency(self, values: Mapping[str, float]) -> float:
        """Return the highest small-amplitude angular frequency over sqrt(alpha); it limits the step."""
        return 1.0


@lru_cache(maxsize=64)
def _derived(arm: ArmBase, rod: Rod) -> Mechanics:
    """Derive the mathematics of an arm once: it is the same with all effects that leave the rod as it is."""
    return arm.derive(rod)


class ArmBase(Base):
    """A base of the flexible arm: lengths are in units of the arm's length, which the reading needs."""

    system = ARM
    input_moves = True
    length = Parameter("m", "length of the arm", (1e-3, 100.0), Normal(1.0, 1.0), default=1.0, fixed=True, latex="l")

    def mechanics(self, rod: Rod = STRAIGHT) -> Mechanics:
        """Return the mathematics."""
        return _derived(self, rod)

    @abstractmethod
    def derive(self, rod: Rod) -> Mechanics:
        """Return the mathematics, derived anew."""

    def initial_coordinates(self, deflection, rate, drive, form=(0, 0)):
        """Return the tip angle and its rate."""
        return (drive[0] + deflection)[None], (drive[1] + rate)[None]
