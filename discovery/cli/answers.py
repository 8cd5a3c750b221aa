"""The commands that answer: the loop alone, and the whole pipeline."""

from __future__ import annotations

import math
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from discovery.cli.folders import results_folder
from discovery.cli.loop_page import check_parts, remove_page, write_failed_page, write_page
from discovery.cli.options import PATH, Seconds, load, once, options, print_json, progress
from discovery.cli.prediction import check_state, read_state, read_wanted, write_prediction
from discovery.cli.say import doubts, say_doubts, say_failed, say_left_out, say_loop, say_missing
from discovery.cli.streams import spoken

if TYPE_CHECKING:
    from collections.abc import Mapping

    from discovery.diagnosis.missing_force import MissingForce
    from discovery.foundation.errors import ComputationError
    from discovery.recordings.dataset import Dataset
    from discovery.runs.answer import Answer
    from discovery.runs.failed_loop import FailedLoop
    from discovery.runs.loop_result import LoopResult


@click.command()
@click.argument("rig", type=PATH)
@options("train", "holdout", "estimate_noise")
@options("out", "seed", "quiet", "json")
@click.option("--note", "data_note", default="", help="Plain words on the data for the top of the report.")
@click.option(
    "--posterior/--no-posterior", "with_posterior", default=True, help="Sample the posterior, the longest part."
)
@click.option(
    "--max-time",
    type=Seconds(),
    multiple=True,
    callback=once,
    help="Seconds, or a time as 5min or 1h: what of the posterior is not there then is left out. The answer of the "
    "loop is always given, however long it takes.",
)
def run(
    rig: Path, train, holdout, out: Path, seed: int, estimate_noise: bool, quiet: bool, as_json: bool, data_note: str,
    with_posterior: bool, max_time: float | None,
) -> None:  # fmt: skip
    """Run the whole pipeline: first the answer of the loop and its page, then the posterior."""
    from discovery.results.manifest import RESULTS

    began = time.monotonic()
    dataset = load(rig, train, holdout, quiet, estimate_noise=estimate_noise)
    folder = results_folder(out, *RESULTS, "report.html")
    from discovery.report import build_report
    from discovery.runs import pipeline
    from discovery.runs.failed_loop import LoopFailure

    try:
        with progress(quiet) as tell:
            found = pipeline.answer(
                dataset, folder, seed=seed, progress=tell, note=data_note, with_posterior=with_posterior
            )
    except LoopFailure as failure:
        pipeline.save_failed(folder, failure.loop, seed=seed, note=data_note)
        _say_failed(failure.loop, [folder / "loop.json", build_report(folder)], as_json)
        return
    doubted = _said(found.loop, dataset, None, as_json)
    start = time.monotonic()
    with progress(quiet) as tell:
        tell("writing the report")
        page = build_report(folder)
    pending, failed = None, None
    if with_posterior:
        # The page will be written once more, with more figures.
        end = time.monotonic()
        left = math.inf if max_time is None else began + max_time - end - 2 * (end - start)
        pending, failed = _posterior(found, folder, left, quiet)
    if as_json:
        print_json({**found.loop.summary(), "doubts": doubted, "pending": pending, "files": [page]})
    if failed is not None:
        raise failed
    if not as_json:
        say_left_out(pending)
        click.echo(f"{page}")


def _posterior(
    found: Answer, folder: Path, seconds: float, quiet: bool
) -> tuple[Mapping[str, Any] | None, ComputationError | None]:
    """Add the posterior to a run and its page: return what is left out, and why there is none."""
    from discovery.foundation.errors import ComputationError
    from discovery.report import build_report
    from discovery.runs import pipeline

    pending, failed = None, None
    with progress(quiet) as tell:
        try:
            pending = pipeline.add_posterior(found, progress=tell, seconds=seconds)["pending"]
        except ComputationError as failure:
            # The page says why there is none.
            failed = failure
        tell("writing the report")
        build_report(folder)
    return pending, failed


@click.command()
@click.argument("rig", type=PATH)
@options("train", "holdout", "estimate_noise")
@options("out", "seed", "quiet", "json")
@click.option(
    "--predict",
    "target",
    type=PATH,
    multiple=True,
    callback=once,
    help="File with times and input: write prediction.csv for it. Its outputs, if any, are not looked at.",
)
@click.option(
    "--initial-state",
    metavar="POSITION,RATE",
    help="Initial state of --predict, what is read and its rate: rad and rad/s (80 degrees are 1.396), m and m/s of a "
    "length, rad/s and rad/s^2 of a speed; otherwise static equilibrium, zero where nothing pulls back.",
)
def loop(
    rig: Path, train, holdout, out: Path, seed: int, estimate_noise: bool, quiet: bool, as_json: bool,
    target: Path | None, initial_state: str | None,
) -> None:  # fmt: skip
    """Find what the declared model lacks, and write it with its page."""
    from discovery.runs.failed_loop import LoopFailure
    from discovery.runs.stages import loop as close
    from discovery.runs.stages import unexplained

    initial = read_state(initial_state)
    if initial is not None and target is None:
        raise click.UsageError("--initial-state needs --predict: training and hold-out start where their fit says.")
    dataset = load(rig, train, holdout, quiet, estimate_noise=estimate_noise)
    check_state(initial, dataset)
    wanted = None if target is None else read_wanted(target, dataset, initial)
    folder = results_folder(out, "loop.json", "prediction.csv", "report.html")
    check_parts(folder)
    try:
        with progress(quiet) as tell:
            result = close(dataset, seed=seed, progress=tell)
    except LoopFailure as failure:
        _say_failed(failure.loop, _failed(folder, failure.loop, seed), as_json)
        if target is not None:
            raise
        return
    with progress(quiet) as tell:
        missing = unexplained(result, dataset, progress=tell)
        content = _written(folder, result, missing)
        failed = None if wanted is None else write_prediction(folder, wanted, result, initial, tell, target)
    doubted = _said(result, dataset, missing, as_json)
    with progress(quiet) as tell:
        tell("writing the report")
        page = write_page(folder, dataset, result, missing, seed)
    files = [folder / "loop.json", page, *sorted(folder.glob("manoeuvre_*.csv"))]
    files += [folder / "prediction.csv"] if wanted is not None and failed is None else []
    if as_json:
        print_json({**content, "doubts": doubted, "files": files})
    else:
        click.echo(f"written: {', '.join(map(str, files))}")
    if failed is not None:
        # What was found has been said.
        raise failed


def _said(result: LoopResult, dataset: Dataset, missing: MissingForce | None, as_json: bool) -> list[str]:
    """Say what a loop found, unless a document will, and return what doubts it."""
    doubted = doubts(result, dataset)
    if not as_json:
        with spoken():
            say_loop(result)
            say_doubts(doubted)
            say_missing(missing)
    return doubted


def _failed(folder: Path, failed: FailedLoop, seed: int) -> list[Path]:
    """Write loop.json and the page of a declared model that has no fit, and return them."""
    from discovery.results.provenance import write_json

    for name in ("prediction.csv", "report.html", *(p.name for p in folder.glob("manoeuvre_*.csv"))):
        (folder / name).unlink(missing_ok=True)
    write_json(folder / "loop.json", failed.summary())
    return [folder / "loop.json", write_failed_page(folder, failed, seed)]


def _say_failed(failed: FailedLoop, files: list[Path], as_json: bool) -> None:
    """Say that the declared model has no fit, and what would help."""
    content = failed.summary()
    if as_json:
        print_json({**content, "doubts": [], "files": files})
        return
    say_failed(content)
    click.echo(f"written: {', '.join(map(str, files))}")


def _written(folder: Path, result: LoopResult, missing: MissingForce | None) -> dict[str, Any]:
    """Write loop.json, and return its content."""
    from discovery.runs.loop_files import write_loop

    # Those of an earlier run would be another model's.
    (folder / "prediction.csv").unlink(missing_ok=True)
    remove_page(folder)
    return write_loop(folder, result, missing=missing)


COMMANDS: tuple[click.Command, ...] = (run, loop)
