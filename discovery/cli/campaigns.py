"""The loop on many rigs and recordings, spread over processes or a cluster, as a command."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from discovery.cli.options import PATH, options, results_folder

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.random import SeedSequence

__all__ = ["COMMANDS", "close", "found_cases"]

#: A rig file, its training recordings, its hold-outs, where the results go, the seed.
Case = tuple[Path, tuple[Path, ...], tuple[Path, ...], Path, int]


def found_cases(where: Path, out: Path, *, seed: int = 1, each: bool = False) -> list[tuple[str, Case]]:
    """Return the cases below a folder, or that of one rig file.

    Parameters
    ----------
    where : Path
        A rig file, or a folder: every ``rig*.toml`` in it, at any depth, is one. Its recordings are the files
        ``train*.csv`` and ``holdout*.csv`` beside it, and where there are none, those that it names itself.
    out : Path
        Folder of the campaign.
    seed : int
        Seed of every loop.
    each : bool
        Every training recording is a case of its own.

    Raises
    ------
    InputError
        If there is no rig file.
    """
    from discovery.errors import InputError

    rigs = sorted(where.rglob("rig*.toml")) if where.is_dir() else [where]
    if not rigs or not rigs[0].exists():
        raise InputError(f"There is no rig file at {where}: give one, or a folder with files rig*.toml at any depth.")
    root = where if where.is_dir() else where.parent
    cases = []
    for rig in rigs:
        beside = [p for p in sorted(rig.parent.glob("*.csv")) if not p.stem.endswith("_clean")]
        train = tuple(p.resolve() for p in beside if p.name.startswith("train"))
        holdout = tuple(p.resolve() for p in beside if p.name.startswith("holdout"))
        named = (rig.parent if rig.name == "rig.toml" else rig.with_suffix("")).resolve().relative_to(root.resolve())
        name = "_".join(named.parts) or rig.stem
        for part in [(p,) for p in train] if each and train else [train]:
            case = name if part == train else f"{name}_{part[0].stem}"
            cases.append((case, (rig.resolve(), part, holdout, out.resolve() / case, seed)))
    return cases


def close(case: Case, _seed: SeedSequence) -> Mapping[str, Any]:
    """Run the loop of one case, write its loop.json, and return what the table of the campaign holds."""
    from discovery.dataset import load_dataset
    from discovery.pipeline import write_loop
    from discovery.stages import loop, unexplained

    rig, train, holdout, out, seed = case
    dataset = load_dataset(rig, train, holdout)
    result = loop(dataset, seed=seed, tell=lambda _: None)
    content = write_loop(out, result, missing=unexplained(result, dataset, tell=lambda _: None))
    errors = {
        f"{role}_rms_{when}": content["errors"][when][role]["rms"]
        for when in ("before", "after")
        for role in ("train", "holdout")
    }
    added = ", ".join(effect["id"] for effect in content["effects"])
    return {"verdict": content["verdict"], "effects": added, "unit": content["errors"]["unit"], **errors}


@click.command()
@click.argument("where", metavar="RIG_OR_FOLDER", type=PATH)
@options("out", "seed", "quiet")
@click.option("--each", is_flag=True, help="Every training recording is a case of its own.")
@click.option("--workers", default=2, show_default=True, help="Processes on this machine.")
@click.option("--scheduler", help="Address of a Dask scheduler whose workers are used instead.")
@click.option("--limit", type=float, help="Seconds that one case may take.")
def campaign(
    where: Path, out: Path, seed: int, quiet: bool, each: bool, workers: int, scheduler: str | None, limit: float | None
) -> None:
    """Find what the declared model lacks in every rig below a folder; finished cases are kept."""
    from discovery.campaign import campaign as run
    from discovery.campaign import collect, watched
    from discovery.errors import ComputationError

    cases = found_cases(where, out, seed=seed, each=each)
    folder = results_folder(out)
    settings = {"each": each, "seed": seed}
    outcomes = run(close, cases, folder, settings=settings, workers=workers, scheduler=scheduler, limit=limit)
    failed = 0
    for outcome in outcomes if quiet else watched(outcomes, None, "cases"):
        failed += outcome.result is None
        said = outcome.error if outcome.result is None else f"{outcome.result['verdict']}: {outcome.result['effects']}"
        click.echo(f"{outcome.name}: {said.rstrip(': ')}")
    click.echo(f"{collect(folder)}")
    if failed:
        raise ComputationError(f"{failed} of {len(cases)} cases failed; their errors are in {folder / 'cases'}.")


COMMANDS: tuple[click.Command, ...] = (campaign,)
