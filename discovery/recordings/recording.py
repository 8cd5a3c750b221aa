"""Recordings: what was measured, in SI units, checked before anything is computed from it."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from discovery.declarations.units import si_symbol
from discovery.foundation.arguments import expect
from discovery.foundation.arrays import BoolArray, FloatArray, IntArray
from discovery.plots.recordings import RecordingViews
from discovery.recordings.cleaning import cleaned, timed
from discovery.recordings.file_signals import ARM_STEMS, Signals, judged_channels
from discovery.recordings.flags import REPEATED, Flag
from discovery.recordings.force_view import viewed
from discovery.recordings.plausibility import check_arm, check_signals
from discovery.recordings.reading_flags import bend_flags, swing_flags, time_flags
from discovery.recordings.reading_noise import BandNoise
from discovery.recordings.renewals import on_sensors_clock
from discovery.recordings.repeated_rows import without_repeats
from discovery.recordings.rounding import are_marks, quantum
from discovery.recordings.time_stamps import on_its_clock, scatter
from discovery.recordings.turns import join_turns
from discovery.recordings.unit_mistakes import check_units
from discovery.rigs.rig import Rig


@dataclass(frozen=True, repr=False)
class Recording(RecordingViews):
    """One measured manoeuvre, in SI units.

    Attributes
    ----------
    name : str
        Name for people: the one that the rig file gives, else the file's without its suffix.
    time : array, shape (n,)
        Sample times [s], strictly increasing, at any spacing.
    input : array, shape (n,), or None
        Motor angle of an arm [rad], input of another system, None for a free decay.
    output : array, shape (n, c)
        What the instrument read; NaN marks a gap.
    channels : tuple of str
        ``("tip_x", "tip_y")`` [m], ``("tip_angle",)`` [rad], ``("tip_deflection",)`` [m] or ``("output",)``, which what
        a declared system reads beside its output follows.
    units : tuple of str
        SI unit of each channel.
    noise : array, shape (c,)
        Standard deviation of each channel, in its unit, where it does not move.
    sha256 : str
        Of the file's bytes.
    source : str
        The file, and the rows taken from it.
    noise_estimated : bool
        Whether `noise` was estimated from this recording because the rig does not state it.
    flags : tuple of Flag
        What is unusual: coarse readings, stuck or clipped ones (which are gaps of `output`), spikes, odd times.
    jitter : float
        Standard deviation of the error of a time stamp [s]: a reading that moves errs by slope times that, too.
    bands : tuple of BandNoise or None
        Noise of each channel whose neighbours err alike; None, as an empty tuple for all of them, where it is white.
    rows : array, shape (n + 1,), or None
        Of the rows that were taken, those of the readings, and last their number; None where all hold readings.
    at_rest : bool
        Whether nothing moves at the first reading, as the rig file says.
    constants : tuple of (str, float)
        Those of a declared system that are others here [SI].
    where, samples : tuple of (str, str or float), tuple of (int, int) or None
        By which its rows were chosen: the values of columns, and the first row and the one after the last.

    Examples
    --------
    >>> data = load_dataset("datasets/spring_bench/rig.toml")
    >>> swing = data.train[0].recording
    >>> swing.time.size, swing.units, swing.noise.tolist()  # m
    (800, ('m',), [5e-05])
    >>> swing.to_pandas().head(2)
             output
    time
    0.000  0.040014
    0.005  0.039765
    >>> swing.to_xarray()["output"].attrs
    {'units': 'm', 'noise': 5e-05}
    >>> swing.part(slice(100, None)).time[:2].tolist()
    [0.5, 0.505]
    """

    name: str
    time: FloatArray
    input: FloatArray | None
    output: FloatArray
    channels: tuple[str, ...]
    units: tuple[str, ...]
    noise: FloatArray
    sha256: str
    source: str
    noise_estimated: bool = False
    flags: tuple[Flag, ...] = ()
    jitter: float = 0.0
    bands: tuple[BandNoise | None, ...] = ()
    rows: IntArray | None = None
    at_rest: bool = False
    constants: tuple[tuple[str, float], ...] = ()
    where: tuple[tuple[str, str | float], ...] = ()
    samples: tuple[int, int] | None = None

    @cached_property
    def scatter(self) -> FloatArray:
        """Standard deviation of each reading, shape (n, c): its noise, and what the error of its stamp adds."""
        return scatter(self.time, self.output, self.noise, self.jitter)

    def noise_floor(self, used: BoolArray | None = None) -> float:
        """Return the rms distance of the output from a perfect model's, of the readings `used` (n, c).

        Examples
        --------
        >>> from discovery import load_dataset
        >>> load_dataset("datasets/spring_bench/rig.toml").train[0].recording.noise_floor()  # m
        5e-05
        """
        rows, own = (np.isfinite(self.output) if used is None else used).any(axis=1), self.judged
        if self.jitter == 0.0 or not rows.any():
            return float(np.linalg.norm(self.noise[own]))
        return float(np.sqrt(np.square(self.scatter[rows, own]).sum(axis=1).mean()))

    @property
    def judged(self) -> slice:
        """Which channels are the output, of which errors are told; what else is read is only fitted."""
        return judged_channels(self.channels)

    @property
    def judged_output(self) -> FloatArray:
        """Readings of the output alone, shape (n, 1), or (n, 2) of a tip's position."""
        return self.output[:, self.judged]

    @property
    def worth(self) -> FloatArray:
        """What an error of each channel counts in the unit of the output, shape (c,): as many noise sds of that."""
        found = np.ones(len(self.channels))
        beside = slice(self.judged.stop, None)
        found[beside] = self.noise[0] / self.noise[beside]
        return found

    @cached_property
    def steps(self) -> FloatArray:
        """Step to which each channel is rounded, shape (c,), in its unit; 0 where it is not."""
        return np.array([quantum(column, self.time) for column in self.output.T])

    def part(self, rows: slice) -> Recording:
        """Return the recording of some of its readings, in a row."""
        inputs = None if self.input is None else self.input[rows]
        still = self.at_rest and not rows.start
        return replace(self, time=self.time[rows], output=self.output[rows], input=inputs, at_rest=still)

    @property
    def notes(self) -> tuple[str, ...]:
        """The flags in words."""
        return tuple(flag.sentence for flag in self.flags)


def read_recording(
    path: str | os.PathLike[str],
    rig: Rig | None = None,
    samples: tuple[int, int] | None = None,
    with_output: bool = True,
    *,
    where: Sequence[tuple[str, str | float]] = (),
    name: str | None = None,
) -> Recording:
    """Read a recording, refuse what cannot be a measurement of this rig, and leave out what no sensor measured.

    Parameters
    ----------
    path : path
        Text, Parquet, MAT or HDF5, see `discovery.foundation.io.read_table`. The columns of an arm are ``time_s``,
        ``motor_angle_rad`` and ``tip_x_m``, ``tip_y_m`` (or ``tip_angle_rad``, or ``tip_deflection_m``), with any unit
        of the right kind as the suffix; those of other systems are declared in the rig file. Other columns are ignored.
    rig : Rig
        The system, without which columns mean nothing.
    samples : (int, int), optional
        Take only ``start <= i < stop`` of the rows that `where` leaves.
    with_output : bool
        False for a file that asks for a prediction: of times and inputs only. Columns of outputs are not looked at, and
        every output is NaN.
    where : sequence of (str, str or float)
        Take only the rows in which these columns have these values.
    name : str, optional
        Name of the recording; the file's by default.

    Raises
    ------
    InputError
        For a file that cannot be read, columns that are missing, given twice or in the wrong unit, cells that are no
        numbers, times that do not increase, gaps in the input, a dead sensor, too short a record, or values that are
        physically impossible; the message names file, column, row and remedy.

    Examples
    --------
    >>> rig = read_rig("datasets/spring_bench/rig.toml")
    >>> swing = read_recording("datasets/spring_bench/holdout.csv", rig)
    >>> swing.time[[0, -1]].tolist(), swing.units
    ([0.0, 3.995], ('m',))
    """
    expect(rig, Rig, "rig", "Read one with read_rig(path).")
    assert rig is not None
    found = Signals.read(path, rig, samples, with_output, where)
    stated = _stated_noise(rig, found.channels)
    flags = _checked(rig, found)
    repeats = [flag for flag in flags if flag.code == REPEATED]
    if found.inputs is None and "output" in found.outputs:
        told = swing_flags(found.names["output"], found.time, found.outputs["output"], _own_period(rig))
        # Part of a swing may as well be the way of what nothing pulls back.
        flags += [flag for flag in told if rig.traits.returns or flag.code == "swings_few"]
    noise, bands, more = cleaned(rig, found, stated)
    check_signals(found, rig.traits.fewest, _may_rest(rig))
    jitter, late = timed(rig, found, noise, stated, bands, repeats)
    if rig.view is not None and found.inputs is not None:
        noise = viewed(rig, found, noise, flags)
    missing, read = np.full(found.time.size, np.nan), rig.columns.read
    return Recording(
        name=name or found.table.path.stem,
        time=found.time,
        input=found.inputs,
        output=np.column_stack([found.outputs.get(channel, missing) for channel in found.channels]),
        channels=found.channels,
        units=tuple(ARM_STEMS[c] if rig.traits.has_rod else si_symbol(read[c].unit) for c in found.channels),
        noise=np.array(noise),
        sha256=found.table.sha256,
        source=found.source,
        noise_estimated=bool(found.outputs) and any(known is None for known in stated),
        flags=(*flags, *more, *late),
        jitter=jitter,
        bands=tuple(bands),
        rows=found.rows,
    )


def _checked(rig: Rig, found: Signals) -> list[Flag]:
    """Refuse what cannot be a measurement of this rig, and tell what is odd about its file, its times and its turns.

    Times become those of steady clocks, turns of an angle are joined, and an added input is taken in.
    """
    guessed = found.table.guessed
    flags = [Flag("encoding_guessed", numbers={"encoding": guessed})] if guessed else []
    odd = [*_clocked(rig, found), *join_turns(rig, found)]
    inputs, outputs = found.inputs, found.outputs
    check_signals(found, rig.traits.fewest, _may_rest(rig))
    if rig.traits.has_rod:
        check_arm(found, rig)
        odd += [] if inputs is None else bend_flags(inputs, outputs)
    elif outputs and rig.columns.output.reads == "position":
        check_units(found, rig)
    if inputs is not None and found.added is not None and rig.controller is not None:
        # What is added to the command acts as a reference that is further off.
        found.inputs = inputs + found.added / (rig.controller.kv * rig.controller.kp)
    odd += [] if rig.view else on_sensors_clock(found)
    marks = any(are_marks(found.time, values) for values in found.outputs.values())
    return [*flags, *time_flags(found.time, rig.columns.time, marks=marks), *odd]


def _clocked(rig: Rig, found: Signals) -> list[Flag]:
    """Take times of steady clocks, and rows that stand twice once, and tell it: of rounded stamps many repeat."""
    if (clock := on_its_clock(rig, found)) or not (twice := without_repeats(found)):
        return clock
    return [*twice, *on_its_clock(rig, found)]


def _own_period(rig: Rig) -> float | None:
    """Period of a small swing [s] by a pendulum's stated length; an extended body swings slower."""
    if not rig.traits.hangs or rig.length is None or rig.gravity is None:
        return None
    return float(2.0 * np.pi * np.sqrt(rig.length.value / rig.gravity.value))


def _may_rest(rig: Rig) -> list[str]:
    """Return what is read beside the output with a stated noise."""
    return [name for name, column in rig.columns.also.items() if column.noise is not None]


def _stated_noise(rig: Rig, channels: Sequence[str]) -> list[float | None]:
    """Noise of each channel from the rig; the camera sees the tip's angle from about one arm's length."""
    if not rig.traits.has_rod:
        return [rig.columns.read[channel].noise for channel in channels]
    if rig.position_noise is None:
        return [None] * len(channels)
    assert rig.length is not None  # read_rig demands it of an arm
    return [
        rig.position_noise / rig.length.value if channel == "tip_angle" else rig.position_noise for channel in channels
    ]
