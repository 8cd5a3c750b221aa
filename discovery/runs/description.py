"""A data set as results.json describes it."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from discovery.foundation.arrays import FloatArray
from discovery.recordings.dataset import Dataset
from discovery.recordings.experiment import Experiment, largest_deflection
from discovery.recordings.recording import Recording
from discovery.rigs.quantities import QUANTITIES
from discovery.rigs.rig import Rig


def describe(dataset: Dataset) -> dict[str, Any]:
    """Return the rig and its recordings, JSON-ready."""
    rig = dataset.rig
    return {
        "rig": {
            "name": rig.name,
            "kind": rig.kind,
            "base": rig.base,
            "coordinate_unit": dataset.train[0].coordinate_unit,
            "input_unit": rig.input_unit or None,
            "quantities": _quantities(rig),
            "declared": list(rig.declared),
            "view": None if rig.view is None else asdict(rig.view),
        },
        "recordings": [_recording(role, e) for role, e in dataset.with_test],
    }


def _signal(output: FloatArray) -> dict[str, float]:
    """Return the size of what was read, gaps left out: rms of the readings and of their distance from their mean."""
    read = output[np.isfinite(output).all(axis=1)]
    return {
        name: float(np.sqrt(np.mean(np.sum(x**2, axis=1))))
        for name, x in (("rms", read), ("sd", read - read.mean(axis=0)))
    }


def _quantities(rig: Rig) -> dict[str, dict[str, Any]]:
    found = {}
    for name, kind in QUANTITIES.items():
        if (stated := getattr(rig, name)) is not None:
            value, sd = (stated.value, stated.sd) if kind.has_sd else (stated, None)
            found[name] = {"value": value, "sd": sd, "unit": kind.symbol}
    return found


def _recording(role: str, e: Experiment) -> dict[str, Any]:
    return {
        "name": e.recording.name,
        "role": role,
        "samples": e.recording.time.size,
        "fitted_samples": len(e.recording.time[e.fitted]) if role == "train" else 0,
        "duration_s": float(e.recording.time[-1] - e.recording.time[0]),
        # Of rounded times no single step is right.
        "rate_hz": float((e.recording.time.size - 1) / np.ptp(e.recording.time)),
        "largest_deflection": largest_deflection([e], whole=True),
        "deflection_unit": e.deflection_unit,
        "channels": list(e.recording.channels),
        "units": list(e.recording.units),
        "noise": e.recording.noise,
        "noise_estimated": e.recording.noise_estimated,
        "signal": _signal(e.recording.judged_output),
        "step": e.recording.steps.tolist(),
        **flagged(e.recording),
    }


def flagged(recording: Recording) -> dict[str, Any]:
    """Return what is unusual about a recording, JSON-ready."""
    flags = [flag.summary() for flag in recording.flags]
    return {"name": recording.name, "notes": list(recording.notes), "flags": flags}
