"""The stages of a run as commands: the whole pipeline, the loop, and each stage alone."""

from __future__ import annotations

import math
import os
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from discovery.cli.doubts import doubts
from discovery.cli.initial_state import check_state, read_state
from discovery.cli.options import (
    PATH,
    Seconds,
    estimate_text,
    held,
    load,
    note,
    once,
    options,
    progress,
    results_folder,
)

if TYPE_CHECKING:
    from collections.abc import Mapping

    from discovery.diagnosis.missing_force import MissingForce
    from discovery.recordings.dataset import Dataset
    from discovery.runs.loop import LoopResult

__all__ = ["COMMANDS", "NOISES"]

#: Noise models, named here so that the help is there at once; "auto" is the one of largest evidence.
NOISES = ("auto", "gaussian", "student_t", "correlated", "input", "quantised")


@click.command()
@click.argument("rig", type=PATH)
@options("train", "holdout", "out", "seed", "quiet")
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
    rig: Path, train, holdout, out: Path, seed: int, quiet: bool, data_note: str, with_posterior: bool,
    max_time: float | None,
) -> None:  # fmt: skip
    """Run the whole pipeline: first the answer of the loop and its page, then the posterior."""
    from discovery.foundation.errors import ComputationError
    from discovery.results.manifest import RESULTS, remove_unfinished

    began = time.monotonic()
    dataset = load(rig, train, holdout, quiet)
    folder = results_folder(out, *RESULTS, "report.html")
    remove_unfinished(folder)
    from discovery.report import build_report
    from discovery.runs import pipeline

    with progress(quiet) as tell:
        found = pipeline.answer(dataset, folder, seed=seed, tell=tell, note=data_note, with_posterior=with_posterior)
    _say_loop(found.loop)
    _say_doubts(found.loop, dataset)
    start = time.monotonic()
    with progress(quiet) as tell:
        tell("writing the report")
        page = build_report(folder)
    if with_posterior:
        # The page will be written once more, with more figures.
        end = time.monotonic()
        left = math.inf if max_time is None else began + max_time - end - 2 * (end - start)
        failed: ComputationError | None = None
        with progress(quiet) as tell:
            try:
                content = pipeline.add_posterior(found, tell=tell, seconds=left)
            except ComputationError as failure:
                # The page says why there is none.
                failed = failure
            tell("writing the report")
            build_report(folder)
        if failed is not None:
            raise failed
        _say_left_out(content["pending"])
    click.echo(f"{page}")


def _say_left_out(pending: Mapping[str, Any] | None) -> None:
    """Say what the time limit has left out."""
    if pending:
        known = pending.get("effective") is not None
        of = f" ({pending['effective']:.0f} of {pending['wanted']:.0f} effective samples)" if known else ""
        on = "with more time, the same command goes on from there"
        click.echo(f"left out for --max-time: {'; '.join(pending['left_out'])}{of}; {on}")


@click.command()
@click.argument("rig", type=PATH)
@options("train", "holdout", "out", "seed", "quiet")
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
    metavar="ANGLE,RATE",
    help="Initial state of --predict: rad and rad/s (80 degrees are 1.396), or m and m/s where the output is a "
    "length; static equilibrium otherwise.",
)
def loop(
    rig: Path, train, holdout, out: Path, seed: int, quiet: bool, target: Path | None, initial_state: str | None
) -> None:
    """Find what the declared model lacks, and write it with its page."""
    from discovery.foundation.errors import ComputationError
    from discovery.results.manifest import remove_unfinished
    from discovery.runs.stages import loop as close
    from discovery.runs.stages import unexplained

    initial = read_state(initial_state)
    if initial is not None and target is None:
        raise click.UsageError("--initial-state needs --predict: training and hold-out start where their fit says.")
    dataset = load(rig, train, holdout, quiet)
    check_state(initial, dataset)
    wanted = None
    if target is not None:
        from discovery.recordings.experiment import make_experiment
        from discovery.recordings.recording import read_recording

        wanted = make_experiment(read_recording(target, dataset.rig, with_output=False), dataset.rig)
        if initial is None and wanted.drive is None:
            note(
                f"{target}: without --initial-state the prediction starts at rest, and nothing drives this system: it "
                "stays there. Give the state at the first time with --initial-state ANGLE,RATE."
            )
    folder, why = results_folder(out, "loop.json", "prediction.csv", "report.html"), ""
    remove_unfinished(folder)
    failed: ComputationError | None = None
    with progress(quiet) as tell:
        result = close(dataset, seed=seed, tell=tell)
        missing = unexplained(result, dataset, tell=tell)
        from discovery.runs.pipeline import save_prediction, write_loop

        # Those of an earlier run would be another model's.
        for name in ("prediction.csv", "report.html"):
            (folder / name).unlink(missing_ok=True)
        write_loop(folder, result, missing=missing)
        if wanted is not None:
            tell("predicting")
            try:
                why = save_prediction(folder / "prediction.csv", wanted, result.before, result.foresight(), initial)
            except ComputationError as failure:
                failed = failure
    if why:
        note(f"{target}: the declared model does not predict it, its columns are left empty. {why}")
    _say_loop(result)
    _say_doubts(result, dataset)
    if missing is not None and missing.depends:
        of = " or ".join(", ".join(d.variables) for d in missing.depends)
        patch = "a patch is offered, see missing_force in loop.json" if missing.patch else "no patch is offered"
        click.echo(f"missing force: depends on {of}; {patch}")
    with progress(quiet) as tell:
        tell("writing the report")
        page = _loops_page(folder, dataset, result, missing, seed)
    files = [folder / "loop.json", page, *sorted(folder.glob("manoeuvre_*.csv"))]
    files += [folder / "prediction.csv"] if wanted is not None and failed is None else []
    click.echo(f"written: {', '.join(map(str, files))}")
    if failed is not None:
        # What was found has been said.
        raise failed


def _loops_page(folder: Path, dataset: Dataset, result: LoopResult, missing: MissingForce | None, seed: int) -> Path:
    """Write the page of a loop, one file beside its loop.json."""
    from tempfile import TemporaryDirectory

    from discovery.report import build_report
    from discovery.results.manifest import SAVING
    from discovery.runs.pipeline import gather_loop

    with TemporaryDirectory(dir=folder, prefix=SAVING) as beside:
        gather_loop(Path(beside), dataset, result, missing, seed)
        return build_report(beside).replace(folder / "report.html")


def _say_loop(result) -> None:
    """Say what the loop found: verdict, effects, what is left, and the errors before and after."""
    from discovery.selection.sentences import lead_sentence, model_error_words

    content = result.summary()
    click.echo(f"verdict: {content['verdict']}")
    for effect in content["effects"]:
        click.echo(_effect_line(effect))
    click.echo(f"model error: {model_error_words(content['model_error'])}")
    if content.get("lead"):
        click.echo(f"lead: {lead_sentence(content['lead'])}")
    for contradiction in result.contradiction.contradictions if result.contradiction else ():
        click.echo(f"contradiction: {contradiction.sentence}")
    for separation in result.separations:
        click.echo(separation.sentence)
    _say_errors(content["errors"])


def _say_doubts(result, dataset) -> None:
    for doubt in doubts(result, dataset):
        click.echo(f"doubt: {doubt}")


def _effect_line(effect: Mapping[str, Any]) -> str:
    """Return an added effect with its values, what serves as well, and how sure it is."""
    from discovery.runs.loop import UPGRADES
    from discovery.selection.sentences import effect_sentence

    role = "mechanics" if effect["id"] in {name for _, name in UPGRADES} else "added"
    values = ", ".join(
        f"{n} = {estimate_text(p['value'], p['sd'], p['unit'])}" for n, p in effect["parameters"].items()
    )
    rivals = f"; as well explained by {', '.join(effect['ambiguous_with'])}" if effect["ambiguous_with"] else ""
    sure = effect_sentence(effect)
    return f"{role}: {effect['id']}" + (f" ({values})" if values else "") + rivals + (f"; {sure}" if sure else "")


def _say_errors(errors: Mapping[str, Any]) -> None:
    """Say the errors before and after, and what was held out where no recording was."""
    from discovery.estimation.holdout import SEPARATE

    for when in ("before", "after"):
        found = errors[when]
        # All held-out recordings may lie inside the trained range, or all beyond it.
        shown = {k: v for k, v in found.items() if k == "holdout" or v != found["holdout"]}
        click.echo(
            f"{when:>6}: "
            + ", ".join(f"{k} rms {v['rms']:.4g} (mean {v['mean']:.4g})" for k, v in shown.items())
            + f" {errors['unit']}"
        )
    if errors["holdout_kind"] != SEPARATE:
        tells = f"its motion is {errors['holdout_motion']:.2g} times the noise"
        click.echo(f"holdout: the {errors['holdout_kind']}; {tells}; --holdout names a recording of its own")


@click.command()
@click.argument("rig", type=PATH)
@options("train", "out", "seed", "quiet")
def discover(rig: Path, train, out: Path, seed: int, quiet: bool) -> None:
    """Find the equation of motion by sparse regression."""
    from discovery.results.provenance import provenance, write_json
    from discovery.runs import stages

    dataset = load(rig, train, (), quiet, keep_third=False)
    folder = results_folder(out, "discovery.json")
    with progress(quiet) as tell:
        found = stages.discover(dataset, seed=seed, tell=tell)
    summary = found.summary()
    write_json(folder / "discovery.json", {"provenance": provenance(dataset, seed=seed), **summary})
    click.echo(summary["discovery"]["status"])
    if summary["radius"]:
        click.echo(summary["radius"]["status"])


@click.command()
@click.argument("rig", type=PATH)
@options("train", "out", "seed", "quiet")
def fit(rig: Path, train, out: Path, seed: int, quiet: bool) -> None:
    """Fit the linear and the declared model by output error."""
    from discovery.results.provenance import provenance, write_json
    from discovery.runs import stages

    dataset = load(rig, train, (), quiet, keep_third=False)
    folder = results_folder(out, "fit.json")
    with progress(quiet) as tell:
        fits = stages.estimate(dataset, tell=tell)
    write_json(folder / "fit.json", {"provenance": provenance(dataset, seed=seed), **fits.summary()})
    for label, found in fits.models.items():
        values = ", ".join(
            f"{n} = {estimate_text(found.values[n], None if n in found.reasons else found.sd[n], parameter.value_unit)}"
            for n in found.problem.free
            for parameter in (found.model.parameters[n],)
        )
        click.echo(f"{label}: {values}; {found.status}")


@click.command()
@click.argument("rig", type=PATH)
@options("train", "out", "seed", "quiet")
@click.option(
    "--noise",
    type=click.Choice(NOISES),
    default="gaussian",
    show_default=True,
    help="What the errors of the readings are like; auto: what the evidence prefers.",
)
def posterior(rig: Path, train, out: Path, seed: int, quiet: bool, noise: str) -> None:
    """Sample the posterior of the declared model; an interrupted run is resumed."""
    from discovery.results.provenance import provenance, write_json
    from discovery.runs import stages

    dataset = load(rig, train, (), quiet, keep_third=False)
    folder = results_folder(out, "posterior.json", "posterior.nc", "posterior_chains.h5")
    checkpoint = folder / "posterior_chains.h5"
    with progress(quiet) as tell:
        fitted = stages.estimate(dataset, tell=tell).models["declared"]
        choice = stages.weighed(fitted, seed=seed, tell=tell) if noise == "auto" else None
        chosen = noise if choice is None else choice.noise
        found = stages.sampled(fitted, seed=seed, tell=tell, backend=checkpoint, noise=chosen)
    found.to_netcdf(folder / "posterior.nc")
    rows = found.summary()
    summary = {
        "rows": rows,
        "status": found.status,
        "noise": {"chosen": chosen} if choice is None else choice.summary(),
    }
    write_json(folder / "posterior.json", {"provenance": provenance(dataset, seed=seed), **summary})
    checkpoint.unlink(missing_ok=True)
    if choice is not None:
        click.echo(f"noise: {chosen}, by its evidence{'' if choice.chosen.reliable else ', which cannot be trusted'}")
    for row in rows:
        click.echo(f"{row['name']}: {estimate_text(row['mean'], row['sd'], row['unit'])}")


@click.command()
@click.argument("rig", type=PATH)
@options("train")
@click.option("--out", type=PATH, help="Folder for elastica.json; without it the prediction is only printed.")
@options("seed", "quiet")
def elastica(rig: Path, train, out: Path | None, seed: int, quiet: bool) -> None:
    """Predict alpha, beta and gamma from the rig file alone; with posterior.nc in OUT, compare.

    With recordings, the elastica's law is also fitted over the deflections that they reach.
    """
    from discovery.foundation.errors import InputError
    from discovery.posterior.draws import Posterior
    from discovery.recordings.dataset import Dataset
    from discovery.results.provenance import provenance, write_json
    from discovery.rigs.rig_file import read_rig
    from discovery.runs import stages

    described = read_rig(rig)
    recorded = train or described.records
    dataset = load(rig, train, (), quiet, keep_third=False) if recorded else Dataset(described, (), ())
    saved = None if out is None else out / "posterior.nc"
    posterior = Posterior.from_netcdf(saved) if saved is not None and os.path.exists(saved) else None
    with progress(quiet) as tell:
        found = stages.predicted(dataset, posterior, seed=seed, tell=tell)
    if found is None:
        raise InputError(
            f"{rig}: the elastica needs an arm with length, tip_mass, beam_mass and flexural_rigidity in its rig file."
        )
    if out is not None:
        write_json(
            results_folder(out, "elastica.json") / "elastica.json",
            {"provenance": provenance(dataset, seed=seed), **found},
        )
    for row in found["prediction"]:
        value = estimate_text(row["mean"], row["sd"], row["unit"])
        click.echo(f"{row['mass']:12} {row['law']:22} {row['parameter']:10} {value}")


@click.command()
@click.argument("rig", type=PATH)
@options("train", "out", "seed", "quiet")
def residual(rig: Path, train, out: Path, seed: int, quiet: bool) -> None:
    """Examine what the declared model leaves."""
    from discovery.estimation.problem import natural_units
    from discovery.estimation.residual import examine
    from discovery.results.provenance import provenance, write_json
    from discovery.runs import stages

    dataset = load(rig, train, (), quiet, keep_third=False)
    folder = results_folder(out, "residual.json")
    with progress(quiet) as tell:
        fits = stages.estimate(dataset, tell=tell)
    report = examine(dataset.train, fits.predictions["declared"], 2 * math.pi * natural_units(dataset.train).time)
    write_json(folder / "residual.json", {"provenance": provenance(dataset, seed=seed), **report.summary()})
    click.echo(
        f"rms {report.rms:.3g} noise sds, systematic part {report.systematic:.3g}, "
        f"{'white' if report.white else 'not white'} (Ljung-Box p = {report.ljung_box_p:.2g})"
    )


@click.command()
@click.argument("folder", type=PATH)
def report(folder: Path) -> None:
    """Write the page of a finished run again from its result files."""
    from discovery.foundation.errors import InputError
    from discovery.foundation.io import shown
    from discovery.report import build_report

    if not os.path.exists(folder / "results.json"):
        raise InputError(f"{shown(folder)} holds no results.json; make one with `discovery run`.")
    click.echo(f"{build_report(held(folder))}")


COMMANDS: tuple[click.Command, ...] = (run, loop, discover, fit, posterior, elastica, residual, report)
