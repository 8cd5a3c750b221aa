"""From a data set to a folder of results: every stage in order, saved with the answer, the posterior, the evidence."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

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
from discovery.foundation.time_limit import TimeIsUp, time_limit
from discovery.posterior.draws import Posterior
from discovery.recordings.dataset import Dataset
from discovery.recordings.quantisation import quantum
from discovery.results import curves
from discovery.results.manifest import SAVING, check_whole, hashes, move_in_place
from discovery.results.provenance import plain, provenance, read_json, restored, write_json
from discovery.runs import stages
from discovery.runs.loop import LoopResult

if TYPE_CHECKING:
    from discovery.posterior.sampling import Progress
    from discovery.posterior.study import PosteriorStudy

__all__ = ["Answer", "add_posterior", "answer", "gather_loop", "run", "save_prediction", "write_loop"]

FloatArray = NDArray[np.float64]
#: What follows the answer, in words; and under which names it is in results.json.
_PARTS = ("the posterior and what it predicts", "the noise models and the evidence of the models")
_AFTERWARDS = ("posterior", "pending", "noise", "evidence", "elastica")


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
                "flags": [flag.summary() for flag in e.recording.flags],
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


@dataclass(frozen=True)
class Answer:
    """What a run knows when its loop is done, which is in its folder then.

    Parameters
    ----------
    dataset : Dataset
        Rig and recordings.
    out : Path
        Folder of the run.
    seed : int
        Seed of everything random.
    content : mapping
        Of results.json, with nothing of the posterior.
    discovered : Discovered or None
        Equations found in the motion.
    fits : Fits
        Of the linear and the declared model.
    loop : LoopResult
        What the loop found.
    missing : MissingForce or None
        The force that the final model lacks.
    predictions : mapping
        Of every recording by "linear", "before" and "after".
    """

    dataset: Dataset
    out: Path
    seed: int
    content: Mapping[str, Any]
    discovered: stages.Discovered | None
    fits: stages.Fits
    loop: LoopResult
    missing: MissingForce | None
    predictions: Mapping[str, list[FloatArray]]

    @property
    def subject(self) -> Fit:
        """The fit that is sampled: an arm's is the paper's model, which the elastica predicts, else the final one."""
        is_arm = self.dataset.train[0].is_arm
        return (self.fits.models["declared"] if is_arm else self.loop.after).specialised()

    @cached_property
    def kept(self) -> Mapping[str, Any]:
        """Content of results.json of an earlier run that came to the same answer; empty where there is none."""
        try:
            found = read_json(self.out / "results.json")
            check_whole(self.out, found)
        except (FileNotFoundError, InputError):
            return {}
        same = isinstance(found, Mapping) and _answer_in(found) == restored(plain(_answer_in(self.content)))
        return found if same else {}


def _answer_in(content: Mapping[str, Any]) -> dict[str, Any]:
    """Return what of results.json is the answer, and what it was made from."""
    origin = content.get("provenance") or {}
    made_from = {k: origin.get(k) for k in ("seed", "rig_sha256", "data", "versions", "git_revision")}
    return {**{k: v for k, v in content.items() if k not in (*_AFTERWARDS, "provenance")}, "made_from": made_from}


@dataclass
class Sampled:
    """What follows the answer, as far as it is there.

    Parameters
    ----------
    posterior : Posterior, optional
        Draws.
    study : PosteriorStudy, optional
        Of the draws.
    weighed : mapping
        "noise" and "evidence".
    reached : Progress, optional
        How far the sampler was when it was last asked.
    left_out : tuple of str
        What is not there, in words.
    because : str
        Why: "asked" (not to be sampled), "running", "time", or what failed.
    """

    posterior: Posterior | None = None
    study: PosteriorStudy | None = None
    weighed: Mapping[str, Any] = field(default_factory=lambda: {"noise": None, "evidence": None})
    reached: Progress | None = None
    left_out: tuple[str, ...] = _PARTS
    because: str = "running"

    def summary(self, answer: Answer) -> dict[str, Any]:
        """Return what results.json holds of it."""
        posterior, study = self.posterior, self.study
        found = None
        if posterior is not None and study is not None:
            subject = "declared" if answer.dataset.train[0].is_arm else "after"
            found = {
                "subject": subject,
                "rows": posterior.summary(),
                "status": posterior.status,
                **study.summary(),
            }
        pending: dict[str, Any] | None = None
        if self.left_out:
            pending = {"left_out": list(self.left_out), "because": self.because}
            if self.reached is not None and posterior is None:
                pending |= {"effective": self.reached.effective, "wanted": self.reached.wanted}
        return {"posterior": found, "pending": pending, **self.weighed}


def run(
    dataset: Dataset,
    out: Path,
    *,
    seed: int = 1,
    progress: stages.Tell = stages.silent,
    command: Sequence[str] | None = None,
    note: str = "",
    with_posterior: bool = True,
) -> dict[str, Any]:
    """Run the whole pipeline and save its results: the answer first, then the posterior.

    Parameters
    ----------
    dataset : Dataset
        Rig and recordings.
    out : Path
        Folder for results.json, loop.json and the netCDF files; made if need be.
    seed : int
        Seed of everything random.
    progress : callable
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
    found = answer(
        dataset, out, seed=seed, progress=progress, command=command, note=note, with_posterior=with_posterior
    )
    return add_posterior(found, progress=progress) if with_posterior else dict(found.content)


def answer(
    dataset: Dataset,
    out: Path,
    *,
    seed: int = 1,
    progress: stages.Tell = stages.silent,
    command: Sequence[str] | None = None,
    note: str = "",
    with_posterior: bool = True,
) -> Answer:
    """Run everything but the posterior, and save it; see `run` for the parameters.

    Where the folder holds a run that came to the same answer, it stays as it is until the posterior is there.
    """
    out.mkdir(parents=True, exist_ok=True)
    discovered = stages.discover(dataset, seed=seed, progress=progress) if stages.can_discover(dataset.rig) else None
    fits = stages.estimate(dataset, progress=progress)
    began = time.perf_counter()
    loop = stages.loop(dataset, seed=seed, progress=progress)
    seconds = time.perf_counter() - began
    missing = stages.unexplained(loop, dataset, progress=progress)
    tested = stages.scored(loop, dataset, progress=progress)
    on = stages.continued(loop, dataset, progress=progress)
    linear = {n: _everywhere(dataset, f, fits.predictions[n]) for n, f in fits.models.items() if n == "linear"}
    predictions = {**linear, **_loops_predictions(loop)}
    content = {
        "provenance": {**provenance(dataset, seed=seed, command=command), "loop_seconds": seconds},
        **_of_loop(dataset, loop, missing),
        "data_note": note,
        **(discovered.summary() if discovered else dict.fromkeys(("discovery", "radius", "multisine"))),
        **fits.summary(),
        "test": tested,
        "continued": on,
        "clean": _to_clean(dataset, predictions),
        "models": _models(loop),
    }
    found = Answer(
        dataset,
        out,
        seed=seed,
        content=content,
        discovered=discovered,
        fits=fits,
        loop=loop,
        missing=missing,
        predictions=predictions,
    )
    if not (with_posterior and found.kept):
        _save(found, Sampled(because="running" if with_posterior else "asked"), progress=progress, first=True)
    return found


def add_posterior(found: Answer, *, progress: stages.Tell = stages.silent, seconds: float = math.inf) -> dict[str, Any]:
    """Sample the posterior of a run whose answer is saved, study it, and save all of it.

    Parameters
    ----------
    found : Answer
        From `answer`.
    progress : callable
        Receives one sentence before every longer piece of work.
    seconds : float
        Time for it, saving left out; what is not done then is left out, and results.json says so. The chains stay:
        the same run goes on with them. Only in the main thread.

    Returns
    -------
    dict
        The content of results.json.

    Raises
    ------
    ComputationError
        If there is no posterior; results.json says why.
    """
    done, checkpoint = Sampled(), found.out / "posterior_chains.h5"
    failed = None
    try:
        with time_limit(seconds):
            _sample(found, done, progress, checkpoint)
    except TimeIsUp:
        done.because = "time"
        if _came_as_far(found.kept, done):
            return dict(found.kept)
    except ComputationError as failure:
        failed, done.because = failure, str(failure)
    content = _save(found, done, progress=progress)
    if failed is not None:
        raise failed
    if not done.left_out:
        checkpoint.unlink(missing_ok=True)
    return content


def _sample(found: Answer, done: Sampled, progress: stages.Tell, checkpoint: Path) -> None:
    """Do what follows an answer, a part after the other."""
    subject, seed = found.subject, found.seed

    def heard(progress: Progress) -> None:
        done.reached = progress

    posterior = _draws(subject, seed, progress, checkpoint, heard)
    study = stages.studied(posterior, subject, found.dataset, seed=seed, progress=progress)
    done.posterior, done.study, done.left_out = posterior, study, _PARTS[1:]
    if not _came_as_far(found.kept, done):
        _save(found, done, progress=progress)
    done.weighed = stages.compared(subject, found.loop, seed=seed, progress=progress)
    done.left_out = ()


def _came_as_far(kept: Mapping[str, Any], done: Sampled) -> bool:
    """Return whether an earlier run came to the same answer and had the time for as much after it."""
    left_out = (kept.get("pending") or {}).get("left_out", ())
    return bool(kept.get("posterior")) and len(left_out) <= len(done.left_out)


def _of_loop(dataset: Dataset, loop: LoopResult, missing: MissingForce | None) -> dict[str, Any]:
    """Return what results.json holds of a loop and its recordings."""
    return {
        **_describe(dataset),
        "loop": loop.summary(),
        "missing_force": None if missing is None else missing.summary(),
    }


def _loops_predictions(loop: LoopResult) -> dict[str, list[FloatArray]]:
    return {when: list(loop.predictions[when]) for when in ("before", "after")}


def _save(found: Answer, done: Sampled, *, progress: stages.Tell, first: bool = False) -> dict[str, Any]:
    """Save a run with what there is of its posterior, and return the content of results.json.

    The first time, what the folder holds is of another run.
    """
    dataset, posterior, study = found.dataset, done.posterior, done.study
    elastica = stages.predicted(dataset, posterior, seed=found.seed, progress=progress)
    progress("saving results")
    content = {**found.content, **done.summary(found), "elastica": elastica}
    out, bands = found.out, study.bands if study else ()
    # Results of one run belong together: they are written beside and moved in place when all are there.
    # An interrupted command beside this one may have removed the folder while it was empty.
    out.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory(dir=out, prefix=SAVING) as folder:
        beside = Path(folder)
        if posterior is not None:
            posterior.to_netcdf(beside / "posterior.nc", dataset)
        if study is not None and study.bands:
            curves.save_groups(beside / "predictive.nc", study.curves())
        _save_curves(
            beside,
            dataset,
            predictions=found.predictions,
            bands=bands,
            posterior=posterior,
            discovered=found.discovered,
            elastica=elastica,
        )
        if found.missing is not None:
            curves.save_groups(beside / "force.nc", curves.forces(found.missing.forces))
        write_loop(beside, found.loop, alone=False)
        files = hashes(beside, sorted(path.name for path in beside.iterdir()))
        content["provenance"] = {**content["provenance"], "files": files}
        write_json(beside / "results.json", content)
        move_in_place(beside, out, same_answer=not first)
    return content


def _draws(
    subject: Fit, seed: int, progress: stages.Tell, checkpoint: Path, heard: Callable[[Progress], None]
) -> Posterior:
    """Return the posterior of a fit, continued from a checkpoint of the same run where one is there."""
    try:
        return stages.sampled(subject, seed=seed, progress=progress, backend=checkpoint, heard=heard)
    except InputError:
        # The checkpoint is of another run of this folder, interrupted and now overtaken.
        checkpoint.unlink(missing_ok=True)
        return stages.sampled(subject, seed=seed, progress=progress, backend=checkpoint, heard=heard)


def gather_loop(folder: Path, dataset: Dataset, result: LoopResult, missing: MissingForce | None, seed: int) -> None:
    """Gather in an empty folder what the page of a loop alone is made of."""
    predictions = _loops_predictions(result)
    content = {
        "provenance": provenance(dataset, seed=seed),
        **_of_loop(dataset, result, missing),
        "scope": "loop",
        "clean": _to_clean(dataset, predictions),
    }
    _save_curves(folder, dataset, predictions=predictions, bands=(), posterior=None, discovered=None, elastica=None)
    if missing is not None:
        curves.save_groups(folder / "force.nc", curves.forces(missing.forces))
    write_json(folder / "results.json", content)


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
