"""Curves that a report draws: trajectories, spring and radius laws, frequency and damping against amplitude."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from discovery.foundation.arrays import FloatArray
from discovery.foundation.io import atomic_write
from discovery.recordings.dataset import Dataset
from discovery.recordings.experiment import Experiment, largest_deflection
from discovery.signals.amplitude import backbone


def save_groups(path: Path, groups: Mapping[str, xr.Dataset]) -> None:
    """Write named groups of arrays to one netCDF file, beside first."""
    # In memory: on a full disk the library of the format ends the process.
    made = BytesIO()
    for i, (name, group) in enumerate(groups.items()):
        group.to_netcdf(made, group=name, mode="w" if i == 0 else "a", engine="h5netcdf")
    with atomic_write(path) as temporary:
        temporary.write_bytes(made.getbuffer())


def trajectories(
    dataset: Dataset, predictions: Mapping[str, Sequence[FloatArray | None]], bands: Sequence[Any] = ()
) -> dict[str, xr.Dataset]:
    """Return measured and predicted channels of every recording, training first, with bands by recording name.

    `predictions` hold by model an array (n, c) for each recording, None where there is none.
    """
    groups = {}
    for i, (role, e) in enumerate(dataset.everything):
        r = e.recording
        fitted = np.zeros(r.time.size, np.int8)
        if role == "train":
            fitted[e.fitted] = 1
        variables: dict[str, Any] = {
            "measured": (("time", "channel"), r.output),
            "deflection": (("time",), e.deflection),
            "fitted": (("time",), fitted),
        }
        if r.input is not None:
            variables["input"] = (("time",), r.input)
        for label, arrays in predictions.items():
            array = arrays[i] if i < len(arrays) else None
            if array is not None:
                variables[label] = (("time", "channel"), array)
        for band in bands:
            if band.name == r.name:
                for q, values in zip(("q05", "q50", "q95"), band.motion, strict=True):
                    variables[f"posterior_{q}"] = (("time", "channel"), values)
        clean = noise_free(e)
        if clean is not None:
            variables["clean"] = (("time", "channel"), clean)
        groups[r.name] = xr.Dataset(
            variables,
            {"time": r.time, "channel": list(r.channels)},
            {"role": role, "units": list(r.units), "noise": list(map(float, r.noise))},
        )
    return groups


def noise_free(experiment: Experiment) -> FloatArray | None:
    """Return the noise-free tip that a simulated recording brings along beside its file, for judging only."""
    source = Path(experiment.recording.source.partition("[")[0])
    beside = source.with_name(f"{source.stem}_clean{source.suffix}")
    if not os.path.exists(beside) or experiment.recording.channels != ("tip_x", "tip_y"):
        return None
    from discovery.recordings.recording import read_recording

    clean = read_recording(beside, experiment.rig)
    return clean.output if clean.output.shape == experiment.recording.output.shape else None


def laws(posterior, delta_max: float) -> xr.Dataset:
    """Return spring and radius law of the elastica and of the posterior of the paper's model.

    The spring is the torque on the deflection per unit of linear stiffness: for the paper's model
    delta + (beta/alpha) delta^3, for the elastica rho F_n / 3, and F_n / 3 for the force alone.
    """
    from discovery.theory.elastica.static_law import perpendicular_law

    delta = np.linspace(0.0, 1.15 * delta_max, 120)
    force, rho = perpendicular_law(delta)
    variables: dict[str, Any] = {
        "elastica_spring": (("delta",), force / 3.0),
        "elastica_torque": (("delta",), rho * force / 3.0),
        "elastica_radius": (("delta",), rho),
    }
    draws = posterior.flat() if posterior is not None else {}
    thin = slice(None, None, max(1, len(next(iter(draws.values()), [])) // 2000))
    curves: dict[str, FloatArray] = {}
    if {"alpha", "beta"} <= draws.keys():
        ratio = (draws["beta"] / draws["alpha"])[thin]
        curves["spring"] = delta[None] + ratio[:, None] * delta[None] ** 3
    if "gamma" in draws:
        curves["radius"] = np.cos(draws["gamma"][thin][:, None] * delta[None])
    for law, values in curves.items():
        for q, curve in zip(("q05", "q50", "q95"), np.quantile(values, (0.05, 0.5, 0.95), axis=0), strict=True):
            variables[f"posterior_{law}_{q}"] = (("delta",), curve)
    return xr.Dataset(variables, {"delta": delta}, {"delta_max": delta_max})


def forces(reconstructed) -> dict[str, xr.Dataset]:
    """Return missing forces [q s^-2] with their standard deviations and the states along, by recording."""
    return {
        f.name: xr.Dataset(
            {
                "force": (("time",), f.mean),
                "sd": (("time",), f.sd),
                **{n: (("time",), v) for n, v in f.variables.items() if n != "time"},
            },
            {"time": f.time},
        )
        for f in reconstructed
    }


def measured_radius(dataset: Dataset) -> xr.Dataset | None:
    """Return measured deflection and radius over length of the first training recordings, thinned."""
    parts = []
    for e in dataset.train:
        if e.recording.channels != ("tip_x", "tip_y") or e.rig.length is None:
            return None
        rho = np.hypot(*e.recording.output.T) / e.rig.length.value
        parts.append(np.column_stack([e.deflection, rho])[:: max(1, len(rho) // 800)])
    points = np.concatenate(parts)
    return xr.Dataset({"delta": (("point",), points[:, 0]), "rho": (("point",), points[:, 1])})


def backbones(
    dataset: Dataset, predictions: Mapping[str, Sequence[FloatArray | None]], period: float
) -> dict[str, xr.Dataset]:
    """Return frequency and damping against amplitude of the longest free decay, measured and by each model."""
    best = max(dataset.train, key=lambda e: (largest_deflection([e]), e.recording.time[-1] - _release(e)))
    index = next(i for i, (_, e) in enumerate(dataset.everything) if e is best)
    start = _release(best)
    sources = {"measured": best.deflection}
    for label, arrays in predictions.items():
        array = arrays[index] if index < len(arrays) else None
        if array is not None:
            sources[label] = _deflection_of(best, array)
    groups = {}
    for label, deflection in sources.items():
        found = backbone(best.recording.time, deflection, period, start)
        groups[label] = xr.Dataset(
            {"frequency": (("swing",), found.frequency), "damping": (("swing",), found.damping)},
            {"amplitude": (("swing",), found.amplitude)},
            {"recording": best.recording.name},
        )
    return groups if groups["measured"].sizes["swing"] else {}


def _deflection_of(experiment: Experiment, channels: FloatArray) -> FloatArray:
    from dataclasses import replace

    return replace(experiment, recording=replace(experiment.recording, output=channels)).deflection


def _release(experiment: Experiment) -> float:
    """Return when the motor has stopped for good."""
    if experiment.drive is None:
        return float(experiment.recording.time[0])
    if not experiment.system.has_rod:
        return float("inf")
    rate = np.abs(experiment.drive.evaluate(experiment.recording.time)[1])
    moving = np.flatnonzero(rate > 1e-3 * rate.max()) if rate.max() > 0 else np.empty(0, int)
    return float(experiment.recording.time[moving[-1]]) if moving.size else float(experiment.recording.time[0])
