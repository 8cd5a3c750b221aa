"""The loop on many rigs and recordings, spread over processes or a cluster, as a command."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from discovery.cli.campaign_cases import Case, beside, found_cases, listed, origins, rig_files
from discovery.cli.folders import results_folder
from discovery.cli.loop_page import write_page
from discovery.cli.options import PATH, note, options, print_json, progress

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from numpy.random import SeedSequence

    from discovery.recordings.dataset import Dataset
    from discovery.runs.processes import Outcome


def close(case: Case, _seed: SeedSequence) -> Mapping[str, Any]:
    """Run the loop of one case, write its loop.json, and return what the tables of the campaign hold."""
    from discovery.report.sentences import verdict_sentence
    from discovery.results.provenance import write_json
    from discovery.runs.failed_loop import LoopFailure
    from discovery.runs.loop_files import write_loop
    from discovery.runs.stages import loop, unexplained

    # A case that is done again and fails leaves nothing of before.
    for stale in (case.out / "loop.json", case.out / "report.html", *case.out.glob("manoeuvre_*.csv")):
        stale.unlink(missing_ok=True)
    dataset = _dataset(case)
    try:
        result = loop(dataset, seed=case.seed, progress=lambda _: None)
    except LoopFailure as failure:
        write_json(case.out / "loop.json", failure.loop.summary())
        raise
    missing = unexplained(result, dataset, progress=lambda _: None)
    content = write_loop(case.out, result, missing=missing)
    if case.page:
        write_page(case.out, dataset, result, missing, case.seed)
    errors = {
        f"{role}_rms_{when}": content["errors"][when][role]["rms"]
        for when in ("before", "after")
        for role in ("train", "holdout")
    }
    of = {name: effect["id"] for effect in content["effects"] for name in effect["parameters"]}
    return {
        "verdict": content["verdict"],
        "effects": ", ".join(effect["id"] for effect in content["effects"]),
        "because": verdict_sentence(content),
        "unit": content["errors"]["unit"],
        **errors,
        "noise_floor": content["errors"]["noise_floor"],
        "rig": dataset.rig.name,
        "kind": dataset.rig.kind,
        "coordinate_unit": dataset.train[0].coordinate_unit,
        "recordings": "[records]" if case.own else "beside the rig file",
        "parameters": [
            {"parameter": name, "effect": of.get(name, ""), **entry, "reason": entry.get("reason", "")}
            for name, entry in content["model"]["after"]["parameters"].items()
        ],
    }


def _dataset(case: Case) -> Dataset:
    """Read what a case is made of."""
    from discovery.estimation.input_choice import choose_interpolation
    from discovery.foundation.errors import InputError
    from discovery.recordings.dataset import load_dataset
    from discovery.rigs.rig_file import read_rig

    if not case.train:
        read_rig(case.rig)
        raise InputError(
            f"{case.rig}: there is nothing to fit. Give the rig file a train list under [records], or put a recording "
            "train*.csv beside it."
        )
    dataset = load_dataset(case.rig) if case.own else load_dataset(case.rig, case.train, case.holdout)
    if case.only is not None:
        dataset = replace(dataset, train=(dataset.train[case.only],))
    return choose_interpolation(dataset)


def _say_found(where: Path, rigs: Sequence[Path], skipped: Sequence[Path], cases: Sequence[tuple[str, Case]]) -> None:
    """Say which rigs were found, and which recordings are used."""
    found = f"{_count(len(rigs), 'rig')} found at {where}, {_count(len(cases), 'case')}"
    note(found + listed(skipped))
    own = {case.rig: case.own for _, case in cases if case.train}
    told = {True: "the rig file's own [records]", False: "train*.csv and holdout*.csv beside the rig file"}
    for kind in sorted(set(own.values()), reverse=True):
        note(f"recordings of {_count(list(own.values()).count(kind), 'rig')}: {told[kind]}")
    used = {path for _, case in cases for path in (*case.train, *case.holdout)}
    for rig in (rig for rig, named in own.items() if named):
        unused = [path.name for role in ("train", "holdout") for path in beside(rig, role) if path not in used]
        if unused:
            note(f"{rig}: not in its [records], not used: {', '.join(unused)}")


def _page(folder: Path, names: Sequence[str], dashboard: str = "") -> Path:
    """Pool the parameters of some cases, and write the page over all of them."""
    from discovery.report.campaign import build_campaign
    from discovery.results.provenance import write_json
    from discovery.runs.campaign import pooled_parameters, rows

    pooled = pooled_parameters(rows(folder, names))
    write_json(folder / "pooled.json", {"pooled": pooled})
    # The page holds many outcomes at once: without their parameters, which are pooled.
    slim = [{key: value for key, value in row.items() if key != "parameters"} for row in rows(folder, names)]
    return build_campaign(folder, slim, pooled, dashboard)


def _count_failed(outcomes: Iterable[Outcome], *, quiet: bool) -> int:
    """Say how each case ended, and return how many failed."""
    failed = 0
    for outcome in outcomes:
        failed += outcome.result is None
        said = outcome.error if outcome.result is None else f"{outcome.result['verdict']}: {outcome.result['effects']}"
        if not quiet:
            click.echo(f"{outcome.name}: {said.rstrip(': ')}")
    return failed


def _say_left(left: Sequence[tuple[str, Case, str]], cases: Sequence[tuple[str, Case]]) -> None:
    """Say how many cases were done before, and which of them are done again."""
    if len(left) < len(cases):
        note(f"{len(cases) - len(left)} of {_count(len(cases), 'case')} were done before")
    for name, _, reason in left:
        if reason:
            note(f"{name} is done again: {reason}")


def _count(number: int, word: str) -> str:
    return f"{number} {word}{'s' * (number != 1)}"


@click.command(short_help="Run the loop on every rig file below a folder.")
@click.argument("where", metavar="RIG_OR_FOLDER", type=PATH)
@options("out", "seed", "quiet", "json")
@click.option("--each", is_flag=True, help="Every training recording is a case of its own.")
@click.option("--pages", is_flag=True, help="A page for every case that is done now, CASE/report.html.")
@click.option("--workers", default=2, show_default=True, type=click.IntRange(1), help="Processes on this machine.")
@click.option(
    "--scheduler",
    envvar="DISCOVERY_SCHEDULER",
    show_envvar=True,
    help="Address of a Dask scheduler whose workers are used instead, for example tcp://host:8786.",
)
@click.option(
    "--insecure",
    is_flag=True,
    help="Accept a scheduler of another machine without TLS: others of its network can run code through it.",
)
@click.option("--limit", type=click.FloatRange(0, min_open=True), help="Seconds that one case may take.")
def campaign(
    where: Path, out: Path, seed: int, quiet: bool, as_json: bool, each: bool, pages: bool, workers: int,
    scheduler: str | None, insecure: bool, limit: float | None,
) -> None:  # fmt: skip
    """Run the loop on every rig file below a folder, or on one: find what the declared model lacks.

    A rig file is rig*.toml, at any depth, or any other TOML file that describes a rig. Its recordings are those of its
    [records]; where it names none to train on, the files train*.csv and holdout*.csv beside it are taken, but not
    *_clean.csv. With --each every training recording is a case of its own, with the same hold-outs.

    Into the folder of --out go CASE/loop.json for every case, cases/CASE.json with its outcome or its error, and two
    tables of the cases of this call, as Parquet and as CSV: results (verdict and why, effects added, errors before
    and after) and parameters (a row for every parameter of every final model: value, sd, unit, effect). The page
    campaign.html shows them all, and pooled.json holds each parameter's mean over at least three specimens, the spread
    between them, and what each specimen's value is with the others' help. With --pages every case has a page, too.

    The same command again does what is left after an interruption, what failed, and every case whose rig file,
    recordings or version of discovery have changed.

    With --scheduler, or the address in DISCOVERY_SCHEDULER, a Dask cluster works instead of this machine. Its workers
    must have this package installed and see rig files, recordings and --out under the same paths. A scheduler of
    another machine needs a tls:// address; the address of its dashboard is said, and linked on the page. Without a
    scheduler nothing listens on any port.
    """
    from discovery.foundation.errors import ComputationError
    from discovery.results.provenance import read_json
    from discovery.runs.campaign import campaign as run
    from discovery.runs.campaign import collect, unfinished, watched

    rigs, skipped = rig_files(where)
    cases = found_cases(rigs, where if where.is_dir() else where.parent, out, seed=seed, each=each, page=pages)
    made = origins(cases)
    folder = results_folder(out, "campaign.json", "results.parquet", "results.csv", "campaign.html")
    how: dict[str, Any] = {"workers": workers, "scheduler": scheduler, "insecure": insecure, "limit": limit}
    dashboards: list[str] = []

    def heard(link: str) -> None:
        dashboards.append(link)
        if not quiet:
            note(f"dashboard of the cluster: {link}")

    outcomes = run(close, cases, folder, settings={"seed": seed}, origins=made, heard=heard, **how)
    left = list(unfinished(cases, folder, made))
    if not quiet:
        _say_found(where, rigs, skipped, cases)
        _say_left(left, cases)
    with progress(quiet) as tell:
        failed = _count_failed(watched(outcomes, len(left), "cases", tell), quiet=as_json)
    table = collect(folder, [name for name, _ in cases], apart=["parameters"])
    page = _page(folder, [name for name, _ in cases], *dashboards)
    if as_json:
        kept = {name: read_json(folder / "cases" / f"{name}.json") for name, _ in cases}
        print_json({"cases": kept, "files": [table, page]})
    else:
        click.echo(f"{table}\n{page}")
    if failed:
        raise ComputationError(f"{failed} of {len(cases)} cases failed; their errors are in {folder / 'cases'}.")


COMMANDS: tuple[click.Command, ...] = (campaign,)
