"""What was understood of a rig file and its recordings: sampling, range, noise, excitation, flags."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from discovery.declarations.units import quoted, si_symbol
from discovery.drafting.law_of_motion import LOOKS, FloatArray, is_one_line, is_relative, own_period
from discovery.foundation.arguments import expect
from discovery.foundation.estimate_text import figures
from discovery.foundation.sampling import mean_rate, median_step
from discovery.recordings.dataset import Dataset
from discovery.recordings.experiment import Experiment
from discovery.signals.periods import find_periods

#: Of a step, by which times of a steady rate may differ.
_JITTER = 0.05
#: Share of the power of an input on either side of its band.
_OUTSIDE = 0.05
#: Share of a recording in which a periodic input repeats.
_MOSTLY = 0.8
#: Readings whose periods are looked for at a time that nobody notices.
_SOON = 50_000


def overview(dataset: Dataset) -> dict[str, Any]:
    """Return what a data set holds, in SI units.

    Parameters
    ----------
    dataset : Dataset
        From `load_dataset`.

    Returns
    -------
    dict
        ``rig`` (name, kind, declared model, file, what it marks to be filled in) and ``recordings``, each with role,
        number of readings, duration [s], mean rate [Hz], missing readings, ``channels`` (unit, range, noise and where
        it is from, motion over noise), ``input`` (unit, range, band [Hz], period [s]; null without one), own period [s]
        and ``flags``.

    Raises
    ------
    InputError
        For what is no data set.

    Examples
    --------
    >>> data = load_dataset("datasets/spring_bench/rig.toml")
    >>> content = overview(data)
    >>> sorted(content)[:4]
    ['recordings', 'rig']
    """
    expect(dataset, Dataset, "dataset", "Read one with load_dataset(rig, train, holdout).")
    rig = dataset.rig
    return {
        "rig": {
            "name": rig.name,
            "kind": rig.kind,
            "base": rig.base,
            "declared": list(rig.declared),
            "file": None if rig.path is None else str(rig.path),
            "to_fill_in": list(rig.unfilled),
        },
        "recordings": [_recording(role, experiment) for role, experiment in dataset.with_test],
    }


def _recording(role: str, experiment: Experiment) -> dict[str, Any]:
    r = experiment.recording
    # Averages begin at a moment at which nothing is read.
    first = int(np.isfinite(r.output).any(axis=1).argmax())
    time, output = r.time[first:], r.output[first:]
    steps = np.diff(time)
    step = float(np.median(steps))
    steady = bool((np.abs(steps - step) <= _JITTER * step).all())
    # The law that tells a period is one of positions.
    position = not experiment.system.has_rod and si_symbol(experiment.rig.columns.output.unit) not in ("m/s", "rad/s")
    period = own_period(r.time, experiment.deflection, r.input) if position else None
    return {
        "name": r.name,
        "role": role,
        "source": r.source,
        "readings": time.size,
        "fitted": r.time[experiment.fitted].size - first if role == "train" else 0,
        "duration": float(r.time[-1] - r.time[0]),
        "rate": mean_rate(time),
        "steady": steady,
        "missing": int((~np.isfinite(output)).any(axis=1).sum()) if experiment.rig.view is None else 0,
        "channels": [
            {
                "name": channel,
                "unit": unit,
                "least": float(np.nanmin(values)),
                "largest": float(np.nanmax(values)),
                "noise": float(noise),
                "noise_is": "estimated" if _is_estimated(experiment, channel) else "stated",
                "motion_over_noise": float(np.nanstd(values) / noise) if noise > 0.0 else None,
            }
            for channel, unit, noise, values in zip(r.channels, r.units, r.noise, r.output.T, strict=True)
        ],
        "input": None if r.input is None else _input(r.time, r.input),
        "own_period": period,
        "flags": list(r.notes),
    }


def _is_estimated(experiment: Experiment, channel: str) -> bool:
    """Whether the noise of a channel is not stated."""
    read = experiment.rig.columns.read.get(channel)
    return experiment.recording.noise_estimated and (read is None or read.noise is None)


def _input(time: FloatArray, values: FloatArray) -> dict[str, Any]:
    if np.ptp(values) == 0.0:
        return {"least": float(values[0]), "largest": float(values[0]), "band": None, "period": None}
    step = median_step(time)
    frequency, power = np.fft.rfftfreq(values.size, step), np.abs(np.fft.rfft(values - values.mean())) ** 2
    share = np.cumsum(power) / max(float(power.sum()), np.finfo(float).tiny)
    periods = find_periods(values - values.mean()) if values.size <= _SOON else None
    again = sum(stop - start for start, stop in periods.stretches) if periods else 0
    return {
        "least": float(values.min()),
        "largest": float(values.max()),
        "band": [float(frequency[np.searchsorted(share, edge)]) for edge in (_OUTSIDE, 1.0 - _OUTSIDE)],
        "period": periods.period * step if periods and again > _MOSTLY * values.size else None,
    }


def overview_lines(dataset: Dataset, content: Mapping[str, Any]) -> Iterator[str]:
    """Yield an overview as lines for people, in the units of their columns."""
    rig = content["rig"]
    yield f"rig: {rig['name']}, {rig['kind']}; declared: {' + '.join(rig['declared']) or 'no effect'}"
    columns = dataset.rig.columns
    for found in content["recordings"]:
        yield _size(found)
        for channel in found["channels"]:
            fixed = dataset.rig.traits.has_rod or dataset.rig.view
            unit = channel["unit"] if fixed else columns.read[channel["name"]].unit
            yield _channel(channel, unit)
        if found["input"] is None:
            swing = _swing(found)
            yield f"  input: none, {'it moves' if swing else 'taken to move'} freely{swing}"
        else:
            assert columns.input is not None  # where there is an input, its column is declared
            unit = dataset.rig.input_unit if dataset.rig.integrates else columns.input.unit
            yield _driven(found["input"], unit) + _swing(found)
            if dataset.rig.integrates:
                yield f"  input: the place, integrated from the speed {columns.input.name!r}"
        for flag in found["flags"]:
            yield f"  flag: {flag}"
    if dataset.rig.traits.shaken and columns.input is not None and is_one_line(columns.input.unit, columns.output.unit):
        yield _base(dataset, columns.input.name)
    yield from (f"to fill in: {rig['file']}, {place}" for place in rig["to_fill_in"])
    if not dataset.holdout:
        yield "holdout: none is named, so the part of each that is not fitted judges; another recording judges better"


def _base(dataset: Dataset, name: str) -> str:
    """Say that the output counts from the base, and what its recordings tell of that."""
    inputs = ((e.recording, e.recording.input, e.deflection) for e in dataset.train)
    told = {is_relative(r.time, read, given) for r, given, read in inputs if given is not None} - {None}
    relative = told.pop() if len(told) == 1 else None
    where = "docs/YOUR_RECORDING.md, section 7, has the table [system] for one against the floor"
    return f"output: read as relative to the base, {name!r}; {where}. {LOOKS[relative]}"


def _size(found: Mapping[str, Any]) -> str:
    rate = (
        f"{figures(found['rate'], 4)} a second"
        if found["steady"]
        else f"at uneven times, {figures(found['rate'], 4)} a second on average"
    )
    left = found["role"] == "train" and found["fitted"] < found["readings"]
    fitted = f", the first {found['fitted']} are fitted" if left else ""
    missing = f", {found['missing']} without a reading" if found["missing"] else ""
    return f"{found['role']} {found['name']}: {found['readings']} readings over {figures(found['duration'], 4)} s, {rate}{fitted}{missing}"  # noqa: E501


def _channel(channel: Mapping[str, Any], unit: str) -> str:
    least, largest, noise = (quoted(channel[key], unit) for key in ("least", "largest", "noise"))
    source = "from the scatter" if channel["noise_is"] == "estimated" else "as stated"
    ratio = channel["motion_over_noise"]
    above = "" if ratio is None else f"; the motion is {figures(ratio)} times that (rms)"
    return f"  {channel['name']}: {least} to {largest}, noise {noise} {source}{above}"


def _driven(found: Mapping[str, Any], unit: str) -> str:
    if found["band"] is None:
        return f"  input: {quoted(found['least'], unit)} throughout"
    low, high = found["band"]
    again = "" if found["period"] is None else f", repeats every {found['period']:.4g} s"
    least, largest = quoted(found["least"], unit), quoted(found["largest"], unit)
    return f"  input: {least} to {largest}, most of it from {figures(low)} to {figures(high)} Hz{again}"


def _swing(found: Mapping[str, Any]) -> str:
    period = found["own_period"]
    if period is None:
        return ""
    return f"; swings about once in {period:.3g} s ({figures(1.0 / period)} Hz)"
