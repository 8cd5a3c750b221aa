"""A measured system as its experimenter knows it before any recording is opened: quantities, columns, model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

__all__ = [
    "ARM_COLUMNS",
    "LINEAR_MODEL",
    "PAPER_MODEL",
    "Columns",
    "InputColumn",
    "OutputColumn",
    "Quantity",
    "RecordPart",
    "Rig",
    "TimeColumn",
]

PAPER_MODEL = ("viscous_damping", "linear_stiffness", "cubic_stiffness", "radius_law")
LINEAR_MODEL = ("viscous_damping", "linear_stiffness")


@dataclass(frozen=True)
class Quantity:
    """A number of the rig with its standard deviation, both in SI units."""

    value: float
    sd: float


@dataclass(frozen=True)
class TimeColumn:
    """Where the time comes from: a column of the file, or a sampling rate [Hz] where the file has none."""

    name: str | None = "time"
    unit: str = "s"
    rate: float | None = None


@dataclass(frozen=True)
class InputColumn:
    """The measured input, and how it runs between the samples.

    ``interpolation`` is ``"band_limited"``, ``"spline"``, ``"linear"``, ``"hold"``, or ``"motion"``, which only the
    encoder of a flexible arm has: smoothed.
    """

    name: str
    unit: str
    interpolation: str


@dataclass(frozen=True)
class OutputColumn:
    """The measured output; ``noise`` is its standard deviation in SI units, None if it must be estimated."""

    name: str
    unit: str
    noise: float | None = None


@dataclass(frozen=True)
class Columns:
    """The columns of a recording."""

    time: TimeColumn
    input: InputColumn | None
    output: OutputColumn


@dataclass(frozen=True)
class RecordPart:
    """A file, or the samples ``start <= i < stop`` of it, as a Python slice."""

    file: Path
    samples: tuple[int, int] | None = None


ARM_COLUMNS = Columns(TimeColumn(), InputColumn("motor_angle", "rad", "motion"), OutputColumn("tip", "m"))


@dataclass(frozen=True)
class Rig:
    """A measured system as its rig file describes it, in SI units.

    Attributes
    ----------
    name : str
    kind : str
        ``"flexible_arm"`` or ``"oscillator"``.
    length, tip_mass, beam_mass, flexural_rigidity : Quantity or None
        Of the arm: m, kg, kg, N m^2.
    position_noise : float or None
        Standard deviation of the camera per axis [m].
    angle_noise : float or None
        Half width of the encoder's uniform error [rad].
    columns : Columns
        What the recordings of this rig contain.
    declared : tuple of str
        Effect ids of the model that the experimenter declares.
    records : mapping of str to tuple of RecordPart
        Named recordings, ``"train"`` and ``"holdout"``; empty if the file names none.
    path : Path or None
        The rig file.
    sha256 : str
        Of the rig file's bytes.
    """

    name: str
    kind: str = "flexible_arm"
    length: Quantity | None = None
    tip_mass: Quantity | None = None
    beam_mass: Quantity | None = None
    flexural_rigidity: Quantity | None = None
    position_noise: float | None = None
    angle_noise: float | None = None
    columns: Columns = ARM_COLUMNS
    declared: tuple[str, ...] = PAPER_MODEL
    records: Mapping[str, tuple[RecordPart, ...]] = field(default_factory=dict)
    path: Path | None = None
    sha256: str = ""
