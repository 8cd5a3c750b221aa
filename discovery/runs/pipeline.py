"""From a data set to a folder of results: every stage in order, each saved as it is done."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from discovery.declarations.units import si_symbol
from discovery.diagnosis.missing_force import MissingForce
from discovery.estimation.fit import Fit
from discovery.estimation.predict import held_out, predict
from discovery.estimation.problem import natural_units
from discovery.estimation.residual import errors
from discovery.export import FittedModel
from discovery.foundation.errors import ComputationError, InputError
from discovery.foundation.io import atomic_write
from discovery.posterior.draws import Posterior
from discovery.recordings.dataset import Dataset
from discovery.recordings.quantisation import quantum
from discovery.results import curves
from discovery.results.manifest import SAVING, hashes, move_in_place
from discovery.results.provenance import provenance, write_json
from discovery.runs import stages
from discovery.runs.loop import LoopResult

__all__ = ["run", "save_prediction", "write_loop"]

FloatArray = NDArray[np.float64]


def _describe(dataset: Dataset) -> dict[str, Any]:
    from discovery.recordings.experiment import largest_deflection

    rig = dataset.rig
    stated = (
        ("length", "m"),
        ("tip_mass", "kg"),
        ("beam_mass", "kg"),
        ("flexural_rigidity", "N m^2"),
        ("gravity", "m s^-2"),
    )
    quantities = {
        name: {"value": q.value, "sd": q.sd, "unit": unit}
        for name, unit in stated
        if (q := getattr(rig, name)) is not None
    }
    plain_numbers = (
        ("position_noise", "m"),
        ("angle_noise", "rad"),
        ("motor_angle_limit", "rad"),
        ("motor_speed_limit", "rad s^-1"),
        ("motor_acceleration_limit", "rad s^-2"),
        ("deflection_limit", "rad"),
    )
    for name, unit in plain_numbers:
        if getattr(rig, name) is not None:
            quantities[name] = {"value": getattr(rig, name), "sd": None, "unit": unit}
    return {
        "rig": {
            "name": rig.name,
            "kind": rig.kind,
            "base": rig.base,
            "coordinate_unit": dataset.train[0].coordinate_unit,
            "input_unit": None if rig.columns.input is None else si_symbol(rig.columns.input.unit),
            "quantities": quantities,
            "declared": list(rig.declared),
            "view": None if rig.view is None else asdict(rig.view),
        },
        "recordings": [
            {
                "name": e.recording.name,
                "role": role,
                "samples": e.recording.time.size,
                "fitted_samples": len(e.recording.time[e.fitted]) if role == "train" else 0,
                "duration_s": float(e.recording.time[-1] - e.recording.time[0]),
                # Of rounded times no single step is right.
                "rate_hz": float((e.recording.time.size - 1) / np.ptp(e.recording.time)),
                "largest_deflection": largest_deflection([e]),
                "channels": list(e.recording.channels),
                "units": list(e.recording.units),
                "noise": e.recording.noise,
                "noise_estimated": e.recording.noise_estimated,
                "signal": _signal(e.recording.output),
                "step": [quantum(column) for column in e.recording.output.T],
                "notes": list(e.recording.notes),
            }
            for role, e in (*dataset.everything, *(("test", e) for e in dataset.test))
        ],
    }


def _signal(output: FloatArray) -> dict[str, float]:
    """Return the size of what was read, gaps left out: rms of the readings and of their distance from their mean."""
    read = output[np.isfinite(output).all(axis=1)]
    return {
        name: float(np.sqrt(np.mean(np.sum(x**2, axis=1))))
        for name, x in (("rms", read), ("sd", read - read.mean(axis=0)))
    }


def _everywhere(dataset: Dataset, fitted: Fit, train: Sequence[FloatArray]) -> list[FloatArray]:
    """Return predictions of all recordings by a fitted model, initial states of the held-out ones fitted."""
    if not dataset.holdout:
        return list(train)
    bench = fitted.problem.bench
    other = bench.of_others(dataset.holdout)
    (held,) = held_out([(fitted.model, fitted.values)], dataset.holdout, other, fitted.problem.units)
    return [*train, *held]


def _to_clean(dataset: Dataset, predictions: dict[str, list[FloatArray]]) -> dict[str, Any] | None:
    """Return distances to the noise-free tip where a simulated recording brings it along."""
    found: dict[str, Any] = {}
    for i, (role, e) in enumerate(dataset.everything):
        clean = curves.noise_free(e) if role == "holdout" else None
        if clean is not None:
            found[e.recording.name] = {label: errors(arrays[i], clean) for label, arrays in predictions.items()}
    return found or None


def _models(result: LoopResult) -> dict[str, Any]:
    """Return the models before and after the loop with all that an export needs, see `discovery.export`."""
    return {
        "before": FittedModel.from_fit(result.before).to_dict(),
        "after": FittedModel.from_fit(result.after).to_dict(),
    }


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
        content["models"] = _models(result)
    write_json(out / "loop.json", content)
    return content


def run(
    dataset: Dataset,
    out: Path,
    *,
    seed: int,
    tell: stages.Tell,
    command: Sequence[str] | None = None,
    note: str = "",
    with_posterior: bool = True,
) -> dict[str, Any]:
    """Run the whole pipeline and save its results.

    Parameters
    ----------
    dataset : Dataset
        Rig and recordings.
    out : Path
        Folder for results.json, loop.json and the netCDF files; made if need be.
    seed : int
        Seed of everything random.
    tell : callable
        Receives one sentence before every longer piece of work.
    command : sequence of str, optional
        Recorded in the provenance; the process's own by default.
    note : str
        Plain words on the data for the top of the report, for example that they are simulated.
    with_posterior : bool
        Sample the posterior; on long recordings that takes longer than everything else together.

    Returns
    -------
    dict
        The content of results.json.
    """
    out.mkdir(parents=True, exist_ok=True)
    discovered = stages.discover(dataset, seed=seed, tell=tell) if stages.can_discover(dataset.rig) else None
    fits = stages.estimate(dataset, tell=tell)
    began = time.perf_counter()
    loop = stages.loop(dataset, seed=seed, tell=tell)
    seconds = time.perf_counter() - began
    missing = stages.unexplained(loop, dataset, tell=tell)
    tested = stages.scored(loop, dataset, tell=tell)
    on = stages.continued(loop, dataset, tell=tell)
    arm = dataset.train[0].is_arm
    checkpoint = out / "posterior_chains.h5"
    posterior = study = None
    weighed: dict[str, Any] = {"noise": None, "evidence": None}
    if with_posterior:
        # An arm's posterior is that of the paper's model, which the elastica predicts; elsewhere of the final model.
        subject = (fits.models["declared"] if arm else loop.after).specialised()
        posterior = _sampled(subject, seed, tell, checkpoint)
        study = stages.studied(posterior, subject, dataset, seed=seed, tell=tell)
        weighed = stages.compared(subject, loop, seed=seed, tell=tell)
    elastica = stages.predicted(dataset, posterior, seed=seed, tell=tell)

    tell("saving results")
    predictions: dict[str, list[FloatArray]] = {
        **{n: _everywhere(dataset, f, fits.predictions[n]) for n, f in fits.models.items() if n == "linear"},
        "before": list(loop.predictions["before"]),
        "after": list(loop.predictions["after"]),
    }
    content = {
        "provenance": {**provenance(dataset, seed=seed, command=command), "loop_seconds": seconds},
        "data_note": note,
        **_describe(dataset),
        **(discovered.summary() if discovered else dict.fromkeys(("discovery", "radius", "multisine"))),
        **fits.summary(),
        "posterior": posterior
        and study
        and {
            "subject": "declared" if arm else "after",
            "rows": posterior.summary(),
            "status": posterior.status,
            **study.summary(),
        },
        **weighed,
        "elastica": elastica,
        "loop": loop.summary(),
        "missing_force": None if missing is None else missing.summary(),
        "test": tested,
        "continued": on,
        "clean": _to_clean(dataset, predictions),
        "models": _models(loop),
    }
    # Results of one run belong together: they are written beside and moved in place when all are there.
    # An interrupted command beside this one may have removed the folder while it was empty.
    out.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory(dir=out, prefix=SAVING) as folder:
        beside = Path(folder)
        if posterior is not None:
            posterior.to_netcdf(beside / "posterior.nc", bands=study.bands if study else (), experiments=dataset.train)
        if study is not None and study.bands:
            curves.save_groups(beside / "predictive.nc", study.curves())
        bands = study.bands if study else ()
        _save_curves(beside, dataset, predictions, bands, posterior, discovered, elastica)
        if missing is not None:
            curves.save_groups(beside / "force.nc", curves.forces(missing.forces))
        write_loop(beside, loop, alone=False)
        content["provenance"]["files"] = hashes(beside, sorted(path.name for path in beside.iterdir()))
        write_json(beside / "results.json", content)
        move_in_place(beside, out)
    checkpoint.unlink(missing_ok=True)
    return content


def _sampled(subject: Fit, seed: int, tell: stages.Tell, checkpoint: Path) -> Posterior:
    """Return the posterior of a fit, continued from a checkpoint of the same run where one is there."""
    try:
        return stages.sampled(subject, seed=seed, tell=tell, backend=checkpoint)
    except InputError:
        # The checkpoint is of another run of this folder, interrupted and now overtaken.
        checkpoint.unlink(missing_ok=True)
        return stages.sampled(subject, seed=seed, tell=tell, backend=checkpoint)


def _save_curves(folder: Path, dataset: Dataset, predictions, bands, posterior, discovered, elastica) -> None:
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
    if discovered is not None and discovered.multisine is not None:
        curves.save_groups(folder / "multisine.nc", {"/": curves.lines(discovered.multisine)})


def save_prediction(path: Path, experiment, before: Fit, after: Fit, initial: tuple[float, float] | None = None) -> str:
    """Write what the instrument would read before and after the loop, with standard deviations.

    The declared model may blow up beyond the motions that it was fitted to: its columns are empty then.

    Parameters
    ----------
    path : Path
        prediction.csv.
    experiment : Experiment
        Times and input.
    before, after : Fit
        The declared model and the final one.
    initial : tuple of float, optional
        Deflection and rate at the first time; the static equilibrium at rest otherwise.

    Returns
    -------
    str
        Why the columns of the declared model are empty, if they are.

    Raises
    ------
    ComputationError
        If the final model has no prediction.
    """
    import pandas as pd

    columns: dict[str, FloatArray] = {"time_s": experiment.recording.time}
    spreads: dict[str, FloatArray] = {}
    arm = experiment.is_arm
    final, why = predict(after, experiment, initial), ""
    try:
        first = predict(before, experiment, initial)
    except ComputationError as failure:
        nothing, why = np.full_like(final[0], np.nan), str(failure)
        first = nothing, nothing
    for label, (value, sd) in (("before", first), ("after", final)):
        if arm:
            for k, axis in enumerate("xy"):
                columns[f"tip_{axis}_{label}_m"] = value[:, k]
                spreads[f"tip_{axis}_{label}_sd_m"] = sd[:, k]
        else:
            columns[f"output_{label}"] = value[:, 0]
            spreads[f"output_{label}_sd"] = sd[:, 0]
    with atomic_write(path) as temporary:
        pd.DataFrame({**columns, **spreads}).to_csv(temporary, index=False, float_format="%.9g")
    return why
