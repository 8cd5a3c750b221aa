"""What a refit leaves: the one place where rough cases meet the program that they test."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

FloatArray = NDArray[np.float64]
#: Trajectory error of the fits, as in the exact world.
TOLERANCE = 2e-5


@dataclass(frozen=True)
class Wanted:
    """A model to be refitted: effects beside the declared ones, where it starts, what is known."""

    added: tuple[str, ...]
    start: Mapping[str, float]
    known: Mapping[str, float]


def _fitted(rig: Path, train: Sequence[Path], wanted: Wanted) -> Any:
    from discovery.equations.model import Model
    from discovery.estimation.declared import declared_model
    from discovery.estimation.fit import fit
    from discovery.recordings.dataset import load_dataset

    experiments = load_dataset(rig, train, keep_third=False).train
    declared = declared_model(experiments[0])
    if experiments[0].system.has_rod:
        declared = Model("elastica", ("viscous_damping", "linear_stiffness"), declared.known)
    effects = tuple(e for e in wanted.added if e not in declared.effects)
    model = Model(declared.base, (*declared.effects, *effects), {**declared.known, **wanted.known})
    start = {n: v for n, v in wanted.start.items() if n in model.parameters}
    return fit(model, experiments, start=start, tolerance=TOLERANCE)


def leftover(rig: Path, train: Sequence[Path], start: Mapping[str, float], known: Mapping[str, float]) -> float:
    """Rms over noise of what the declared model leaves when it is refitted; of an arm, the exact arm.

    Raises
    ------
    ArithmeticError
        If the recordings are refused, as where nothing swings any more, or cannot be fitted.
    """
    from discovery.foundation.errors import ComputationError, InputError

    try:
        found = _fitted(rig, train, Wanted((), start, known))
    except (ComputationError, InputError) as error:
        raise ArithmeticError(str(error)) from error
    left = [
        (p - e.recording.output)[e.fitted] * e.weights()[e.fitted]
        for p, e in zip(found.predict(), found.problem.bench.experiments, strict=True)
    ]
    return float(np.sqrt(np.nanmean(np.concatenate(left) ** 2)))


def prediction_error(folder: Path, train: Sequence[Path], wanted: Wanted, clean: pd.DataFrame) -> float:
    """Rms distance of a model, fitted to the noisy training recordings, to the noise-free hold-out.

    An arm starts at rest. Of any other system the initial state is fitted to the hold-out.
    """
    from discovery.recordings.dataset import load_dataset

    found = _fitted(folder / "rig.toml", train, wanted)
    (held,) = load_dataset(folder / "rig.toml", train, [folder / "holdout.csv"]).holdout
    away = free_run(found, held) - at_times(clean, held.recording.time)
    return float(np.sqrt(np.nanmean(np.sum(away**2, axis=1))))


def at_times(clean: pd.DataFrame, time: FloatArray) -> FloatArray:
    """Return noise-free readings at the times of a recording, which is averaged where it was read far too fast."""
    readings = clean.drop(columns=["time_s", "motor_angle_rad"], errors="ignore").to_numpy()
    if len(time) == len(clean):
        return readings
    return CubicSpline(clean["time_s"].to_numpy(), readings)(time)


def free_run(found: Any, held: Any) -> FloatArray:
    """Return what a fitted model reads in a hold-out: from rest, or from the initial state that fits it best."""
    from discovery.estimation.held_states import held_out
    from discovery.estimation.predict import predict

    if held.system.has_rod:
        return predict(found, held)[0]
    bench = found.problem.bench.of_others([held])
    ((predicted,),) = held_out([(found.model, found.values)], bench, found.problem.units)
    return predicted


def check_readable(folder: Path) -> None:
    """Read a case as its user would.

    Raises
    ------
    InputError
        If a recording is refused, as where friction lets nothing swing.
    """
    from discovery.recordings.dataset import load_dataset

    load_dataset(folder / "rig.toml", sorted(folder.glob("train*.csv")), [folder / "holdout.csv"])


def clean_reading(rig: Path, recording: Path) -> pd.DataFrame:
    """Return times and channels of a recording as the program reads it: in SI units, through the filters of the rig."""
    from discovery.recordings.recording import read_recording
    from discovery.rigs.rig_file import read_rig

    found = read_recording(recording, read_rig(rig))
    return pd.DataFrame({"time_s": found.time, **dict(zip(found.channels, found.output.T, strict=True))})
