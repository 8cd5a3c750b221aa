"""What a rig file may hold: its tables, with the meaning of every key, from which docs/RIG_FILE.md is written."""

from __future__ import annotations

import unicodedata
from typing import Annotated, Literal

from pydantic import AfterValidator, Field, FiniteFloat

from discovery.rigs.system_table import SystemTable, Table, Text

_Positive = Annotated[FiniteFloat, Field(gt=0)]


def _no_control(value: str) -> str:
    # They break the files and pages that the name is written to.
    if any(unicodedata.category(letter) in ("Cc", "Cs") for letter in value):
        raise ValueError("must not hold control characters")
    return value


_Name = Annotated[Text, AfterValidator(_no_control)]


def _not_zero(value: float) -> float:
    if value == 0.0:
        raise ValueError("must not be zero")
    return value


_Scale = Annotated[
    FiniteFloat,
    AfterValidator(_not_zero),
    Field(description="Factor from the numbers of the column to `unit`; it may be negative, but not zero."),
]


class QuantityTable(Table):
    """A positive number, with or without its standard deviation."""

    value: _Positive = Field(description="The number, in the unit of the key's suffix.")
    sd: Annotated[FiniteFloat, Field(ge=0)] | None = Field(
        default=None,
        description="Its standard deviation, in the same unit. Left out, it is the one in the table of quantities.",
    )


class TimeTable(Table):
    """Either a column with the times of the readings, or their rate."""

    rate_hz: _Positive | None = Field(
        default=None, description="Rows per second, where the file has no column of times. Left out, `name` is needed."
    )
    name: Text | None = Field(
        default=None,
        description="Column of the times: numbers, or what a clock shows (14:03:05.25, with a date or not), in s. "
        "Left out, `rate_hz` is needed.",
    )
    unit: Text = Field(default="s", description="Unit of the column, after `scale`, and of `jitter`.")
    scale: _Positive = Field(
        default=1.0, description="Factor from the numbers of the column to `unit`, as of numbers of frames."
    )
    assumed: bool = Field(
        default=False,
        description="The rate is not known: `rate_hz` is made up. Write 1.0, and rates and frequencies are per row.",
    )
    jitter: Annotated[FiniteFloat, Field(ge=0)] | None = Field(
        default=None,
        description="Standard deviation of the error of a time stamp. Left out, it is estimated from readings "
        "that scatter more where they move fast; 0 takes each stamp as right, as a table `[view]` does. A clock "
        "that goes wrong, `time_base_error`, is sought all the same.",
    )


class InputTable(Table):
    """The column of the input. It is left out where the system moves freely."""

    name: Text = Field(description="Column of the input.")
    unit: Text = Field(
        description="Unit of the input, after `zero` and `scale`; `1` for a pure number. For `base_excited` and with a "
        "`[controller]` it measures what the output's does, but a base under an angle may be shifted by a length."
    )
    interpolation: Literal["band_limited", "spline", "linear", "hold", "motion", "auto"] | None = Field(
        default=None,
        description="How the input ran between its samples. `spline` is a cubic spline; `linear` and `hold` have no "
        "second derivative and are refused where one is needed; `band_limited` needs even steps; `motion` smooths "
        "to the error of an encoder; with `auto` the recordings choose, and a note says what. Left out, it is "
        "`motion` for `base_excited` and `spline` for the others.",
    )
    zero: FiniteFloat = Field(
        default=0.0,
        description="What the column reads at an input of zero: a reading r counts as `scale * (r - zero)`.",
    )
    scale: _Scale = 1.0


class AlsoTable(Table):
    """A column that is read beside the output of a `system`, declared under the name that its equation has there."""

    name: Text = Field(description="Column of the readings.")
    unit: Text = Field(description="Unit of the readings, after `zero` and `scale`; `1` for a pure number.")
    noise: _Positive | Literal["estimate"] | None = Field(
        default=None,
        description="Standard deviation of one reading, in `unit`. Left out, or with `estimate`, it is estimated "
        "from the scatter from reading to reading.",
    )
    zero: FiniteFloat = Field(
        default=0.0, description="What the column reads at zero: a reading r counts as `scale * (r - zero)`."
    )
    scale: _Scale = 1.0


class OutputTable(AlsoTable):
    """The column of the output."""

    name: Text = Field(description="Column of the output.")
    unit: Text = Field(
        description="Unit of the output, after `zero` and `scale`; `1` for a pure number. It measures what is read: "
        "a `pendulum` has an angle, a `falling_body` a length, an accelerometer `m/s^2` or `g_0`, the standard gravity "
        "of 9.80665 m/s^2 (`mg_0` is a thousandth; `g` is the gram, and refused)."
    )
    reads: Literal["position", "acceleration"] = Field(
        default="position",
        description="Whether the coordinate is read, or its second derivative, as an accelerometer does. In a "
        "`system` its own `output` says what is read.",
    )


class ColumnsTable(Table):
    """What the columns of the recordings are. A ``flexible_arm`` has fixed ones; every other kind needs this table."""

    header: Annotated[list[Text], Field(min_length=1)] | None = Field(
        default=None,
        description="Names of all columns, from left to right, of text files without a line of names. Left out, the "
        "files name them.",
    )
    time: TimeTable = Field(description="When the readings were taken.")
    input: InputTable | None = Field(
        default=None,
        description="What drives the system. Left out, it moves freely. `base_excited` and `drive` need it, a "
        "`falling_body` has none, and a `system` has it where its equations do.",
    )
    output: OutputTable = Field(description="What the instrument read.")
    also: dict[str, AlsoTable] = Field(
        default={}, description="What is read beside the output of a `system`, by the names of its own `also`."
    )
    every: Annotated[int, Field(ge=1)] = Field(
        default=1, description="One row in so many is used, counted after `where` and `samples` have chosen theirs."
    )


class ControllerTable(Table):
    """The position loop around a ``drive``, command = kv (kp (input - output) - rate of the output).

    The input is then the reference. Left out, the input acts on the drive itself.
    """

    kp: _Positive = Field(description="Gain of the position loop, in 1/s.")
    kv: _Positive = Field(description="Gain of the velocity loop, in `unit` s over the output's unit, such as V s/m.")
    limit: _Positive | None = Field(
        default=None, description="Largest magnitude of the command, in `unit`. Left out, the command has no limit."
    )
    unit: Text = Field(default="1", description="Unit of the command; `1` for a pure number.")
    added: Text | None = Field(
        default=None,
        description="Column with what was added to the command, in `unit`. Left out, or in a file without this "
        "column, nothing was.",
    )


class ViewTable(Table):
    """A ``drive`` or an ``oscillator`` seen as the force that its motion takes: inverse dynamics.

    The input is then the motion, and the output the force. A motion in ``m/s`` or ``rad/s``, or what converts to them,
    is a speed: it is integrated to the place, from zero. Uneven steps are made even; gaps are refused. Left out, the
    force is given and the motion is compared. A file has either this table or ``[controller]``.
    """

    output: Literal["force"] = Field(description="What is compared: the force that was measured, and the computed one.")
    motion_cutoff_hz: _Positive = Field(
        description="The motion is differentiated after a low-pass of this frequency, at least `cutoff_hz`."
    )
    cutoff_hz: _Positive = Field(
        description="Measured and computed force pass through the same low-pass of this frequency."
    )
    decimation: Annotated[int, Field(ge=1)] | None = Field(
        default=None,
        description="One sample of the force in so many is compared. Left out, or smaller than that, so many that "
        "two are left in a period of `cutoff_hz`: their noise is then white.",
    )


class ModelTable(Table):
    """The model that you declare."""

    effects: list[Text] = Field(
        description="Its effects, by their names in the catalogue; of a `system`, EFFECT_at_PLACE. The list may be "
        "empty for `drive`, `falling_body` and `system`."
    )


class PartTable(Table):
    """One recording of any of these lists: a file, or some of its rows."""

    file: Text = Field(
        description="File of the recording. It is looked for beside the rig file, then in the folders of "
        "`DISCOVERY_DATA`."
    )
    samples: Annotated[list[Annotated[int, Field(ge=0)]], Field(min_length=2, max_length=2)] | None = Field(
        default=None,
        description="`[start, stop]`: rows from `start` to the one before `stop`, counted from 0 among those that "
        "`where` leaves. Left out, all of them.",
    )
    where: dict[str, str | FiniteFloat] = Field(
        default={}, description="Columns, and the values that they have in the rows to take. Left out, all rows."
    )
    name: Annotated[str, Field(pattern=r"^[\w.+-]+$")] | None = Field(
        default=None,
        description="Name of the recording on pages: letters, digits and `_ . + -`. Left out, it is made from the "
        "file's.",
    )
    at_rest: bool = Field(
        default=False,
        description="Whether nothing moves at its first row: no coordinate has a rate, and those that are not read are "
        "where a steady force holds them, and of an input that lags nothing has arrived. Left out, the start is "
        "fitted.",
    )
    constants: dict[str, FiniteFloat] = Field(
        default={},
        description="Constants of a `system` that are others in this recording, each in its unit: another mass or "
        "length. `[system.constants]` has a `value` of each, without `sd`, which holds elsewhere.",
    )


class RecordsTable(Table):
    """The recordings.

    Where a command is given ``--train``, none of these is used. ``--holdout`` alone takes the place of ``holdout``, and
    ``test`` is then left out.
    """

    train: list[PartTable] = Field(default=[], description="They are fitted.")
    holdout: list[PartTable] = Field(
        default=[],
        description="They judge, and are never fitted. Without any, the last third of each training recording, or "
        "of its motion where that ends sooner, is kept out of the fit.",
    )
    test: list[PartTable] = Field(
        default=[], description="They are scored only: neither a fit nor a decision sees them."
    )


class RigTable(Table):
    """The whole file, without the keys that carry a unit."""

    name: _Name = Field(description="Name of the system on pages.")
    kind: Literal["flexible_arm", "oscillator", "pendulum", "base_excited", "drive", "falling_body", "system"] = Field(
        default="flexible_arm", description="Kind of system. Left out beside a table `[system]`, it is `system`."
    )
    system: SystemTable | None = Field(default=None, description="The equations of a `system`; no other kind has it.")
    columns: ColumnsTable | None = Field(
        default=None, description="The columns of the recordings. A `flexible_arm` has none, every other kind needs it."
    )
    controller: ControllerTable | None = Field(
        default=None, description="The controller of a `drive` that was recorded in closed loop."
    )
    view: ViewTable | None = Field(
        default=None, description="A `drive` or an `oscillator` is seen as the force that its motion takes."
    )
    model: ModelTable | None = Field(default=None, description="The declared model. Left out, it is that of the kind.")
    records: RecordsTable = Field(
        default=RecordsTable(), description="The recordings. Left out, the command names them."
    )
