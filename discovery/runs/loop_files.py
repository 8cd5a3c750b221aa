"""The files of a loop: loop.json, its predictions and curves, and what its page reads."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from discovery.diagnosis.missing_force import MissingForce
from discovery.estimation.fit import Fit
from discovery.estimation.natural_units import natural_units
from discovery.estimation.predict import predict
from discovery.estimation.residual import errors
from discovery.export import FittedModel
from discovery.foundation.arrays import FloatArray
from discovery.foundation.errors import ComputationError
from discovery.foundation.io import atomic_write
from discovery.recordings.dataset import Dataset
from discovery.results import curves
from discovery.results.provenance import provenance, write_json
from discovery.runs.description import describe
from discovery.runs.loop_result import LoopResult


def models_of(result: LoopResult) -> dict[str, Any]:
    """Return the models before and after the loop with all that an export needs, see `discovery.export`."""
    return {k: FittedModel.from_fit(f).to_dict() for k, f in (("before", result.before), ("after", result.after))}


def write_loop(
    out: Path, result: LoopResult, *, alone: bool = True, missing: MissingForce | None = None
) -> dict[str, Any]:
    """Write loop.json and return its content; where it stands alone, its models are in it, ready to be exported.

    A designed manoeuvre that can decide between rivals is written beside it as a course of the motor.
    """
    content = result.summary()
    if missing is not None:
        content["missing_force"] = missing.summary()
    designed = {f"manoeuvre_{i}.csv": s for i, s in enumerate(getattr(result, "separations", ()), 1) if s.decides}
    for name, separation in designed.items():
        with atomic_write(out / name) as draft:
            draft.write_text(separation.csv(), encoding="utf-8")
    # Those of an earlier run would tell apart what this one never named.
    for old in {p.name for p in out.glob("manoeuvre_*.csv")} - {*designed}:
        (out / old).unlink()
    if alone and isinstance(result, LoopResult):
        content["models"] = models_of(result)
    write_json(out / "loop.json", content)
    return content


def of_loop(dataset: Dataset, loop: LoopResult, missing: MissingForce | None) -> dict[str, Any]:
    """Return what results.json holds of a loop and its recordings."""
    return {
        **describe(dataset),
        "loop": loop.summary(),
        "missing_force": None if missing is None else missing.summary(),
    }


def gather_loop(folder: Path, dataset: Dataset, result: LoopResult, missing: MissingForce | None, seed: int) -> None:
    """Gather in an empty folder what the page of a loop alone is made of."""
    predictions = dict(result.predictions)
    content = {
        "provenance": provenance(dataset, seed=seed),
        **of_loop(dataset, result, missing),
        "scope": "loop",
        "clean": to_clean(dataset, predictions),
    }
    save_curves(folder, dataset, predictions, missing=missing)
    write_json(folder / "results.json", content)


def save_curves(
    folder: Path, dataset: Dataset, predictions, *, bands=(), posterior=None, elastica=None,
    missing: MissingForce | None = None,
) -> None:  # fmt: skip
    """Save what the report draws."""
    curves.save_groups(folder / "trajectories.nc", curves.trajectories(dataset, predictions, bands))
    period = 2 * np.pi * natural_units(dataset.train).time
    decays = curves.backbones(dataset, predictions, period)
    if decays:
        curves.save_groups(folder / "amplitude.nc", decays)
    if elastica is not None:
        groups = {"laws": curves.laws(posterior, elastica["delta_max"])}
        points = curves.measured_radius(dataset)
        if points is not None:
            groups["measured"] = points
        curves.save_groups(folder / "laws.nc", groups)
    if missing is not None:
        curves.save_groups(folder / "force.nc", curves.forces(missing.forces))


def save_prediction(
    path: Path, experiment, before: Fit, after: Fit, initial: tuple[float, float] | None = None,
    errors: tuple[float, float] = (0.0, 0.0),
) -> str:  # fmt: skip
    """Write what the instrument would read before and after the loop, with standard deviations, to prediction.csv.

    The motion begins at a deflection and a rate, at rest otherwise. The deviations are those of the parameters and of
    what either model is expected to err by [unit of the output]; a reading has its noise beside them. Where the
    declared model blows up its columns are empty, and what is returned says why; ComputationError if the final model
    does.
    """
    import pandas as pd

    columns: dict[str, FloatArray] = {"time_s": experiment.recording.time + experiment.rig.columns.time.zero}
    spreads: dict[str, FloatArray] = {}
    recording = experiment.recording
    names, suffix = recording.channels, ""
    if experiment.system.has_rod:
        names, suffix = ("tip_x", "tip_y"), "_m"
    worth = after.problem.bench.experiments[0].recording.worth  # what is predicted has no noise of its own
    final, why = predict(after, experiment, initial), ""
    try:
        first = predict(before, experiment, initial)
    except ComputationError as failure:
        nothing, why = np.full_like(final[0], np.nan), str(failure)
        first = nothing, nothing
    for label, (value, told), error in zip(("before", "after"), (first, final), errors, strict=True):
        sd = np.sqrt(told**2 + (error / worth) ** 2)  # not a number where there is no prediction
        for k, name in enumerate(names):
            columns[f"{name}_{label}{suffix}"] = value[:, k]
            spreads[f"{name}_{label}_sd{suffix}"] = sd[:, k]
    with atomic_write(path) as temporary:
        pd.DataFrame({**columns, **spreads}).to_csv(temporary, index=False, float_format="%.9g")
    return why


def to_clean(dataset: Dataset, predictions: dict[str, list[FloatArray]]) -> dict[str, Any] | None:
    """Return distances to the noise-free tip where a simulated recording brings it along."""
    found: dict[str, Any] = {}
    for i, (role, e) in enumerate(dataset.everything):
        clean = curves.noise_free(e) if role == "holdout" else None
        if clean is not None:
            found[e.recording.name] = {label: errors(arrays[i], clean) for label, arrays in predictions.items()}
    return found or None
