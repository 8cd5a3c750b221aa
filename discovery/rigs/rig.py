"""A measured system as its experimenter knows it before any recording is opened: quantities, columns, model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

from discovery.declarations.system import SystemDeclaration
from discovery.declarations.units import si_symbol
from discovery.mechanics.systems import declare
from discovery.rigs.kinds import KINDS, PAPER_MODEL, Kind


@dataclass(frozen=True)
class Quantity:
    """A number of the rig with its standard deviation, both in SI units."""

    value: float
    sd: float


@dataclass(frozen=True)
class TimeColumn:
    """Where the time comes from: a column of the file, or a sampling rate [Hz] where the file has none.

    ``assumed`` says that nobody knows the rate: times and rates are then per sample, not per second. ``jitter`` is the
    standard deviation of the error of a stamp [s], None where it is not known. Numbers of the column count by `scale`
    in `unit`, and times from ``zero`` [s].
    """

    name: str | None = "time"
    unit: str = "s"
    rate: float | None = None
    assumed: bool = False
    jitter: float | None = None
    zero: float = 0.0
    scale: float = 1.0


@dataclass(frozen=True)
class InputColumn:
    """The measured input, and how it runs between the samples.

    ``interpolation`` is ``"band_limited"``, ``"spline"``, ``"linear"``, ``"hold"``, ``"motion"`` (an encoder's motion,
    smoothed) or ``"auto"``. A reading r is ``scale * (r - zero)`` in `unit`.
    """

    name: str
    unit: str
    interpolation: str
    zero: float = 0.0
    scale: float = 1.0


@dataclass(frozen=True)
class OutputColumn:
    """The measured output; ``noise`` is its standard deviation in SI units, None if it must be estimated.

    A reading r is ``scale * (r - zero)`` in `unit`. ``reads`` says what it is of the coordinate: its ``"position"`` or
    its ``"acceleration"``.
    """

    name: str
    unit: str
    noise: float | None = None
    reads: Literal["position", "acceleration"] = "position"
    zero: float = 0.0
    scale: float = 1.0


@dataclass(frozen=True)
class Columns:
    """The columns of a recording; ``header`` names those of a text file that has no line of names.

    Of the rows, one in ``every`` is used: a signal that changes little from row to row tells no more with all of them.
    ``also`` holds by name what a declared system reads beside its output.
    """

    time: TimeColumn
    input: InputColumn | None
    output: OutputColumn
    header: tuple[str, ...] | None = None
    every: int = 1
    also: Mapping[str, OutputColumn] = field(default_factory=dict)

    @property
    def read(self) -> dict[str, OutputColumn]:
        """What is read, by the name of its channel: the output, and what is read beside it."""
        return {"output": self.output, **self.also}

    @property
    def turns_by_shift(self) -> bool:
        """Whether the input is a length and the output an angle."""
        return self.input is not None and (si_symbol(self.input.unit), si_symbol(self.output.unit)) == ("m", "rad")


@dataclass(frozen=True)
class Controller:
    """The loop around a drive, whose input is the reference: command = kv (kp (reference - q) - q')."""

    kp: float  # gain of the position loop [1/s]
    kv: float  # gain of the velocity loop [command s / q], in SI units
    limit: float | None = None  # largest magnitude of the command, in SI units; None where it never saturates
    unit: str = "1"  # unit of the command as declared
    #: Column with what was added to the command, in `unit`; a file that lacks it had nothing added.
    added: str | None = None


@dataclass(frozen=True)
class ForceView:
    """Inverse dynamics: the motion, which is the input, is prescribed, and the force that it takes is the output."""

    motion_cutoff: float  # the motion is differentiated after a zero-phase low-pass of this frequency [Hz]
    #: The measured and the computed force pass through the same zero-phase low-pass of this frequency [Hz].
    cutoff: float
    #: Of the filtered samples of the force, one in so many is used, the others are gaps of the recording; None: as many
    #: as leave four in a period of `cutoff`.
    decimation: int | None = None


@dataclass(frozen=True)
class RecordPart:
    """Rows of a file."""

    file: Path
    samples: tuple[int, int] | None = None  # ``start <= i < stop`` of the rows that `where` leaves, as a Python slice
    where: tuple[tuple[str, str | float], ...] = ()  # columns and the values that they must have; empty for all rows
    name: str | None = None  # name for people
    at_rest: bool = False  # whether nothing moves at its first sample
    constants: tuple[tuple[str, float], ...] = ()  # of a declared system that are others in it [SI]


ARM_COLUMNS = Columns(TimeColumn(), InputColumn("motor_angle", "rad", "motion"), OutputColumn("tip", "m"))


@dataclass(frozen=True, repr=False)
class Rig:
    """A measured system as its rig file describes it, in SI units.

    Attributes
    ----------
    name : str
    kind : str
        One of `discovery.rigs.kinds.KINDS`.
    length, tip_mass, beam_mass, flexural_rigidity : Quantity or None
        Of the arm: m, kg, kg, N m^2. The length of a pendulum is that of the simple pendulum that swings alike.
    mass, inertia : Quantity or None
        Of what moves along a line [kg], or turns [kg m^2]: forces are told with it.
    position_noise : float or None
        Standard deviation of the camera per axis [m].
    angle_noise : float or None
        Half width of the encoder's uniform error [rad].
    columns : Columns
        What the recordings of this rig contain.
    declared : tuple of str
        Effect ids of the model that the experimenter declares.
    records : mapping of str to tuple of RecordPart
        Named recordings: ``"train"`` is fitted, ``"holdout"`` judges, ``"test"`` is only scored; empty if the file
        names none.
    gravity : Quantity or None
        Gravitational acceleration [m/s^2], of a pendulum or a falling body.
    controller : Controller or None
        Of a drive that was recorded in closed loop.
    view : ForceView or None
        Inverse dynamics in place of the motion.
    system : SystemDeclaration or None
        The equations of a system that the rig file declares itself.
    motor_angle_limit, motor_speed_limit, motor_acceleration_limit : float or None
        What the motor of an arm may do in a manoeuvre that is proposed: angle to either side of where the hub starts
        [rad], speed [rad/s], acceleration [rad/s^2]. None: what the recordings show.
    deflection_limit : float or None
        Largest angle between tip and hub that it may cause [rad].
    path : Path or None
        The rig file.
    sha256 : str
        Of the rig file's bytes.
    unfilled : tuple of str
        What the rig file still marks with FILL IN, with line and key.

    Examples
    --------
    >>> rig = read_rig("datasets/arm/rig.toml")
    >>> rig.kind, rig.length.value, rig.length.sd  # m
    ('flexible_arm', 1.0, 0.001)
    >>> rig.position_noise, rig.with_noise_estimated().position_noise
    (0.0003, None)
    >>> rig.counted_from(1700.0).columns.time.zero  # s
    1700.0
    """

    name: str
    kind: str = "flexible_arm"
    length: Quantity | None = None
    tip_mass: Quantity | None = None
    beam_mass: Quantity | None = None
    flexural_rigidity: Quantity | None = None
    mass: Quantity | None = None
    inertia: Quantity | None = None
    position_noise: float | None = None
    angle_noise: float | None = None
    columns: Columns = ARM_COLUMNS
    declared: tuple[str, ...] = PAPER_MODEL
    records: Mapping[str, tuple[RecordPart, ...]] = field(default_factory=dict)
    gravity: Quantity | None = None
    controller: Controller | None = None
    view: ForceView | None = None
    system: SystemDeclaration | None = None
    motor_angle_limit: float | None = None
    motor_speed_limit: float | None = None
    motor_acceleration_limit: float | None = None
    deflection_limit: float | None = None
    path: Path | None = None
    sha256: str = ""
    unfilled: tuple[str, ...] = ()

    def __repr__(self) -> str:
        """Return name, kind and the declared effects."""
        return f"<Rig {self.name!r} ({self.kind}): {' + '.join(self.declared) or 'no effect'} declared>"

    def with_noise_estimated(self) -> Rig:
        """Return the same rig without the noise that it states: that of each reading is estimated then."""
        read = {name: replace(column, noise=None) for name, column in self.columns.read.items()}
        columns = replace(self.columns, output=read.pop("output"), also=read)
        return replace(self, columns=columns, position_noise=None)

    def counted_from(self, zero: float) -> Rig:
        """Return the same rig with times counted from a moment of the recordings' clock [s]."""
        return replace(self, columns=replace(self.columns, time=replace(self.columns.time, zero=zero)))

    @property
    def integrates(self) -> bool:
        """Whether the motion under a force is given by its speed, of which the integral is the place."""
        given = self.columns.input
        return self.view is not None and given is not None and si_symbol(given.unit) in ("m/s", "rad/s")

    @property
    def input_unit(self) -> str:
        """SI unit of the input as models take it: of the place where a speed is integrated; empty without one."""
        given = "" if self.columns.input is None else si_symbol(self.columns.input.unit)
        return given.removesuffix("/s") if self.integrates else given

    @property
    def traits(self) -> Kind:
        """What its kind of system has and does."""
        return KINDS[self.kind]

    @property
    def base(self) -> str:
        """Name of the mechanics of the bare system."""
        if self.system is not None:
            return declare(self.system)
        if self.view is not None:
            return "inverse_dynamics"
        if self.columns.output.reads == "acceleration":
            return "accelerometer"
        if self.traits.shaken and self.columns.turns_by_shift:
            return "moving_pivot"
        return self.traits.base if self.controller is None else "servo"
