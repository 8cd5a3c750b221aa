"""From a data set to a folder of results: every stage in order, saved with the answer, the posterior, the evidence."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from discovery.estimation.fit import Fit
from discovery.estimation.held_states import held_out
from discovery.foundation.arguments import as_folder, check_seed, expect
from discovery.foundation.arrays import FloatArray
from discovery.foundation.errors import ComputationError, InputError
from discovery.foundation.progress import Progress, Tell, silent, teller
from discovery.recordings.dataset import Dataset
from discovery.results import curves
from discovery.results.manifest import SAVING, hashes, move_in_place
from discovery.results.provenance import provenance, write_json
from discovery.runs import stages
from discovery.runs.answer import _PARTS, Answer, Sampled
from discovery.runs.failed_loop import FailedLoop, gather_failed_loop
from discovery.runs.loop_files import models_of, of_loop, save_curves, to_clean, write_loop
from discovery.runs.processes import TimeIsUp, time_limit
from discovery.runs.regression_stage import can_discover, discover


def _everywhere(dataset: Dataset, fitted: Fit, train: Sequence[FloatArray]) -> list[FloatArray]:
    """Return predictions of all recordings by a fitted model, initial states of the held-out ones fitted."""
    if not dataset.holdout:
        return list(train)
    bench = fitted.problem.bench
    other = bench.of_others(dataset.holdout)
    (held,) = held_out([(fitted.model, fitted.values)], other, fitted.problem.units)
    return [*train, *held]


def run(
    dataset: Dataset,
    out: str | os.PathLike[str],
    *,
    seed: int = 1,
    progress: Tell | None = None,
    command: Sequence[str] | None = None,
    note: str = "",
    with_posterior: bool = True,
) -> dict[str, Any]:
    """Run the whole pipeline and save its results: the answer first, then the posterior.

    Parameters
    ----------
    dataset : Dataset
        Rig and recordings.
    out : path
        Folder for results.json, loop.json and the netCDF files; made if need be.
    seed : int
        Seed of everything random.
    progress : callable, optional
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

    Raises
    ------
    InputError
        For what is no data set, a folder that cannot be made, or a declared model that cannot be the recordings'.
    ComputationError
        If the declared model blows up wherever its fit begins, or no ensemble of the posterior converges.

    Examples
    --------
    >>> data = load_dataset("datasets/spring_bench/rig.toml")
    >>> run(data, "out", with_posterior=False)["loop"]["verdict"]
    'explained'
    """
    expect(dataset, Dataset, "dataset", "Read one with load_dataset(rig, train, holdout).")
    check_seed(seed)
    tell = teller(progress)
    folder = as_folder(out, "out", "Give the folder for the results.")
    found = answer(dataset, folder, seed=seed, progress=tell, command=command, note=note, with_posterior=with_posterior)
    return add_posterior(found, progress=tell) if with_posterior else dict(found.content)


def answer(
    dataset: Dataset,
    out: Path,
    *,
    seed: int = 1,
    progress: Tell = silent,
    command: Sequence[str] | None = None,
    note: str = "",
    with_posterior: bool = True,
) -> Answer:
    """Run everything but the posterior, and save it; see `run` for the parameters.

    Where the folder holds a run that came to the same answer, it stays as it is until the posterior is there. Where
    the declared model has no fit, LoopFailure is raised, and nothing is saved: see `save_failed`.
    """
    out.mkdir(parents=True, exist_ok=True)
    discovered = discover(dataset, seed=seed, progress=progress) if can_discover(dataset.rig) else None
    began = time.perf_counter()
    loop = stages.loop(dataset, seed=seed, progress=progress)
    took = {"loop_seconds": time.perf_counter() - began}
    fits = stages.estimate(dataset, progress=progress)
    missing = stages.unexplained(loop, dataset, progress=progress)
    linear = {n: _everywhere(dataset, f, fits.predictions[n]) for n, f in fits.models.items() if n == "linear"}
    predictions = {**linear, **loop.predictions}
    content = {
        "provenance": provenance(dataset, seed=seed, command=command) | took,
        **of_loop(dataset, loop, missing),
        "data_note": note,
        **(discovered.summary() if discovered else dict.fromkeys(("discovery", "radius"))),
        **fits.summary(),
        "test": stages.scored(loop, dataset, progress=progress),
        "continued": stages.continued(loop, dataset, progress=progress),
        "clean": to_clean(dataset, predictions),
        "models": models_of(loop),
    }
    made: dict[str, Any] = {"loop": loop, "missing": missing, "predictions": predictions}
    found = Answer(dataset, out, seed=seed, content=content, fits=fits, **made)
    if not (with_posterior and found.kept):
        left = Sampled(because="running" if with_posterior else "asked")
        _save(found, left, progress=progress, first=True)
    return found


def save_failed(out: Path, loop: FailedLoop, *, seed: int = 1, note: str = "") -> None:
    """Save the run of a declared model that has no fit: what is known of it takes the place of an earlier run."""
    out.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory(dir=out, prefix=SAVING) as folder:
        beside = Path(folder)
        write_json(beside / "loop.json", loop.summary())
        gather_failed_loop(beside, loop, seed, note=note)
        move_in_place(beside, out)


def add_posterior(found: Answer, *, progress: Tell = silent, seconds: float = math.inf) -> dict[str, Any]:
    """Sample the posterior of a run whose answer is saved, study it, save it, and return what results.json holds.

    What is not done after so many seconds is left out; the same run goes on with its chains. A limit holds in the main
    thread only. ComputationError if there is no posterior; results.json says why.
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


def _sample(found: Answer, done: Sampled, progress: Tell, checkpoint: Path) -> None:
    """Do what follows an answer, a part after the other."""
    subject, seed = found.subject, found.seed

    def heard(told: str) -> None:
        done.reached = told if isinstance(told, Progress) else done.reached
        progress(told)

    try:
        posterior = stages.sampled(subject, seed=seed, progress=heard, backend=checkpoint)
    except InputError:
        # The checkpoint is of another run of this folder, interrupted and now overtaken.
        checkpoint.unlink(missing_ok=True)
        posterior = stages.sampled(subject, seed=seed, progress=heard, backend=checkpoint)
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


def _save(found: Answer, done: Sampled, *, progress: Tell, first: bool = False) -> dict[str, Any]:
    """Save a run with what there is of its posterior, at `first` over another run's, and return its results.json."""
    dataset, posterior, study = found.dataset, done.posterior, done.study
    elastica = stages.predicted(dataset, posterior, seed=found.seed, progress=progress)
    progress("saving results")
    content = {**found.content, **done.summary(found), "elastica": elastica}
    out = found.out
    # Results of one run belong together: they are written beside and moved in place when all are there.
    # An interrupted command beside this one may have removed the folder while it was empty.
    out.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory(dir=out, prefix=SAVING) as folder:
        beside = Path(folder)
        if posterior is not None:
            posterior.to_netcdf(beside / "posterior.nc", dataset)
        if study is not None and study.bands:
            curves.save_groups(beside / "predictive.nc", study.curves())
        drawn = {"bands": study.bands if study else (), "posterior": posterior, "elastica": elastica}
        save_curves(beside, dataset, found.predictions, missing=found.missing, **drawn)
        write_loop(beside, found.loop, alone=False)
        files = hashes(beside, sorted(path.name for path in beside.iterdir()))
        content["provenance"] = {**content["provenance"], "files": files}
        write_json(beside / "results.json", content)
        move_in_place(beside, out, same_answer=not first)
    return content
