"""Recordings: what was measured, in SI units, checked before anything is computed from it."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from discovery.errors import InputError, suggestion
from discovery.io import Table, read_table
from discovery.plausibility import check_arm, check_signals
from discovery.rig import Rig
from discovery.units import si_factor, si_symbol, split_suffix

__all__ = ["Recording", "blind", "estimate_noise", "read_recording", "resolution"]

FloatArray = npt.NDArray[np.float64]

_ARM_STEMS = {"time": "s", "motor_angle": "rad", "tip_x": "m", "tip_y": "m", "tip_angle": "rad", "tip_deflection": "m"}
_ARM_OUTPUTS = (("tip_x", "tip_y"), ("tip_angle",), ("tip_deflection",))


@dataclass(frozen=True)
class Recording:
    """One measured manoeuvre, in SI units.

    Attributes
    ----------
    name : str
        Name for people: the file's, without its suffix.
    time : array, shape (n,)
        Sample times [s], strictly increasing, at any spacing.
    input : array, shape (n,), or None
        Motor angle of an arm [rad], input of an oscillator, None for a free decay.
    output : array, shape (n, c)
        What the instrument read; NaN marks a gap.
    channels : tuple of str
        ``("tip_x", "tip_y")`` [m], ``("tip_angle",)`` [rad], ``("tip_deflection",)`` [m] or ``("output",)``.
    units : tuple of str
        SI unit of each channel.
    noise : array, shape (c,)
        Standard deviation of each channel, in its unit.
    sha256 : str
        Of the file's bytes.
    source : str
        The file, and the samples taken from it.
    noise_estimated : bool
        Whether `noise` was estimated from this recording because the rig does not state it.
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


def estimate_noise(values: FloatArray) -> float:
    """Estimate the standard deviation of white noise on a signal that is smooth from sample to sample.

    Differences of order 2 to 8 suppress the signal more and more, and each, divided by the root of the sum of its
    squared binomial coefficients, has the variance of the noise. Their median absolute deviation (times 1.4826,
    Gaussian) does not see steps and outliers; the smallest estimate is the one that holds least of the signal.

    Parameters
    ----------
    values : array, shape (n,)
        Samples, about equally spaced; NaN are skipped.

    Returns
    -------
    float
        The estimate in the unit of `values`; 0 for a signal without noise, NaN with fewer than 18 samples.
    """
    estimates = []
    difference = np.asarray(values, np.float64)
    difference = difference[np.isfinite(difference)]
    if difference.size < 18:
        return float("nan")
    square_sum = 1.0  # central binomial coefficient (2k choose k), built up with the order k
    for order in range(1, 9):
        difference = np.diff(difference)
        square_sum *= 2.0 * (2.0 * order - 1.0) / order
        if order > 1:
            deviation = float(np.median(np.abs(difference - np.median(difference))))
            estimates.append(1.4826 * deviation / np.sqrt(square_sum))
    return float(min(estimates))


def blind(recording: Recording) -> Recording:
    """Return times and input of a recording only, as of a file that asks for a prediction."""
    shown = _ARM_OUTPUTS[0] if recording.channels[0] in _ARM_STEMS else ("output",)
    units = ("m", "m") if len(shown) == 2 else recording.units
    empty = np.full((recording.time.size, len(shown)), np.nan)
    noise = np.full(len(shown), float(recording.noise[0]))
    return replace(recording, output=empty, channels=shown, units=units, noise=noise)


def read_recording(
    path: str | os.PathLike[str],
    rig: Rig,
    samples: tuple[int, int] | None = None,
    require_output: bool = True,
) -> Recording:
    """Read a recording and refuse what cannot be a measurement of this rig.

    Parameters
    ----------
    path : path
        CSV, Parquet, MAT or HDF5, see `discovery.io.read_table`. The columns of an arm are ``time_s``,
        ``motor_angle_rad`` and ``tip_x_m``, ``tip_y_m`` (or ``tip_angle_rad``, or ``tip_deflection_m``), with any unit
        of the right kind as the suffix; those of an oscillator are declared in the rig file. Other columns are ignored.
    rig : Rig
        The system.
    samples : (int, int), optional
        Take only ``start <= i < stop``.
    require_output : bool
        False for a file of times and inputs that asks for a prediction: without output columns, every output is NaN.

    Returns
    -------
    Recording

    Raises
    ------
    InputError
        For a file that cannot be read, columns that are missing, given twice or in the wrong unit, cells that are no
        numbers, times that do not increase, gaps in the input, a dead sensor, too short a record, or values that are
        physically impossible; the message names file, column, row and remedy.
    """
    table = read_table(path)
    arm = rig.kind == "flexible_arm"
    channels, names, units = _arm_columns(table) if arm else _declared_columns(table, rig)
    if require_output and not channels:
        wanted = "tip_x_m and tip_y_m, or tip_angle_rad, or tip_deflection_m" if arm else rig.columns.output.name
        raise InputError(f"{table.path} has no output column: add {wanted}.{_suggest(table, wanted)}")
    rows = _slice(table, names, samples)
    values = {stem: table.numbers(name)[rows] * si_factor(units[stem]) for stem, name in names.items()}
    start = rows.start or 0
    if "time" in values:
        time = values["time"]
    else:
        rate = rig.columns.time.rate
        assert rate is not None  # read_rig demands a rate or a column
        time = np.arange(len(values[next(iter(names))])) / rate
    inputs = values.get("motor_angle" if arm else "input")
    shown = channels or (_ARM_OUTPUTS[0] if arm else ("output",))
    output = np.column_stack([values.get(channel, np.full(time.size, np.nan)) for channel in shown])
    check_signals(table, names, start, time, inputs, {channel: values[channel] for channel in channels})
    if arm:
        check_arm(table, names, start, rig, time, inputs, {channel: values[channel] for channel in channels})
    stated = _stated_noise(rig, shown)
    measured = [estimate_noise(column) for column in output.T] if channels else [1.0] * len(shown)
    noise = [found if known is None else known for known, found in zip(stated, measured, strict=True)]
    # A noise of zero would give its samples infinite weight: fall back on the resolution of the readings.
    floors = [resolution(column) for column in output.T]
    return Recording(
        name=table.path.stem,
        time=time,
        input=inputs,
        output=output,
        channels=shown,
        units=tuple(_ARM_STEMS[channel] if arm else si_symbol(rig.columns.output.unit) for channel in shown),
        noise=np.array([max(value, floor) for value, floor in zip(noise, floors, strict=True)]),
        sha256=table.sha256,
        source=str(table.path) + (f"[{samples[0]}:{samples[1]}]" if samples else ""),
        noise_estimated=bool(channels) and any(known is None for known in stated),
    )


def _arm_columns(table: Table) -> tuple[tuple[str, ...], dict[str, str], dict[str, str]]:
    """Channels, and the column and the unit of each stem, by the names of an arm recording."""
    names: dict[str, str] = {}
    units: dict[str, str] = {}
    for name in table.columns:
        split = split_suffix(name, _ARM_STEMS)
        if split is None:
            continue
        stem, unit = split
        if not unit:
            raise InputError(
                f"{table.path}: the column {name!r} lacks its unit. Write it as a suffix, '{name}_{_ARM_STEMS[stem]}'."
            )
        if stem in names:
            raise InputError(f"{table.path}: {stem} is given twice, as {names[stem]!r} and {name!r}. Keep one of them.")
        try:
            si_factor(unit, _ARM_STEMS[stem])
        except InputError as error:
            raise InputError(f"{table.path}, column {name!r}: {error}") from error
        names[stem], units[stem] = name, unit
    for stem in ("time", "motor_angle"):
        if stem not in names:
            wanted = f"{stem}_{_ARM_STEMS[stem]}"
            raise InputError(f"{table.path} has no column {wanted!r}.{_suggest(table, wanted)} {_listed(table)}")
    channels = next((channels for channels in _ARM_OUTPUTS if all(channel in names for channel in channels)), ())
    for first, second in (("tip_x", "tip_y"), ("tip_y", "tip_x")):
        if not channels and first in names:
            wanted = f"{second}_m"
            raise InputError(
                f"{table.path} has {names[first]!r} but no column {wanted!r}: the tip needs both."
                f"{_suggest(table, wanted)} {_listed(table)}"
            )
    used = ("time", "motor_angle", *channels)
    return channels, {stem: names[stem] for stem in used}, units


def _declared_columns(table: Table, rig: Rig) -> tuple[tuple[str, ...], dict[str, str], dict[str, str]]:
    """Channels, and the column and the unit of each signal, as the rig file declares them."""
    columns = rig.columns
    wanted = [("time", columns.time.name, columns.time.unit)] if columns.time.name and columns.time.rate is None else []
    if columns.input is not None:
        wanted.append(("input", columns.input.name, columns.input.unit))
    present = columns.output.name in table.columns
    if present:
        wanted.append(("output", columns.output.name, columns.output.unit))
    for _, name, _ in wanted:
        if name not in table.columns:
            raise InputError(
                f"{table.path} has no column {name!r}, which the rig file declares.{_suggest(table, str(name))} "
                f"{_listed(table)}"
            )
    channels = ("output",) if present else ()
    names = {stem: str(name) for stem, name, _ in wanted}
    return channels, names, {stem: unit for stem, _, unit in wanted}


def _slice(table: Table, names: dict[str, str], samples: tuple[int, int] | None) -> slice:
    sizes = {name: table.columns[name].size for name in names.values()}
    if not sizes:
        raise InputError(f"{table.path} has neither a time nor an input column, so the number of samples is not known.")
    if len(set(sizes.values())) > 1:
        listed = ", ".join(f"{name!r} {size}" for name, size in sizes.items())
        raise InputError(f"{table.path}: the columns differ in length ({listed}). Export them with the same samples.")
    size = next(iter(sizes.values()))
    if samples is None:
        return slice(0, size)
    if not 0 <= samples[0] < samples[1] <= size:
        raise InputError(f"{table.path} has {size} samples, so [{samples[0]}, {samples[1]}] is not a part of it.")
    return slice(*samples)


def _stated_noise(rig: Rig, channels: Sequence[str]) -> list[float | None]:
    """Noise of each channel from the rig; the camera sees the tip's angle from about one arm's length."""
    if rig.kind != "flexible_arm":
        return [rig.columns.output.noise]
    if rig.position_noise is None:
        return [None] * len(channels)
    assert rig.length is not None  # read_rig demands it of an arm
    return [
        rig.position_noise / rig.length.value if channel == "tip_angle" else rig.position_noise for channel in channels
    ]


def resolution(values: FloatArray) -> float:
    """Give the standard deviation of rounding, the smallest error that readings can have.

    Parameters
    ----------
    values : array, shape (n,)
        Readings; NaN are skipped.

    Returns
    -------
    float
        The smallest step between different readings over sqrt(12) if the readings repeat, else that of the last bit.
    """
    finite = values[np.isfinite(values)]
    distinct = np.unique(finite)
    bit = float(np.spacing(np.max(np.abs(distinct), initial=np.finfo(float).tiny)))
    step = float(np.min(np.diff(distinct))) if 1 < distinct.size < 0.5 * finite.size else 0.0
    return max(step, bit) / float(np.sqrt(12.0))


def _suggest(table: Table, wanted: str) -> str:
    return suggestion(wanted, table.columns)


def _listed(table: Table) -> str:
    return f"Columns found: {', '.join(str(name) for name in table.columns)[:300]}."
