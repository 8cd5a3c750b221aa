"""The command line: one verb a stage; exit status 0 done, 2 bad input or usage, 3 a computation that failed."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from discovery.dataset import Dataset

__all__ = ["main"]

# Linear algebra here is small: a second BLAS thread only spins beside the kernel's own. Set before numpy is imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
_PATH = click.Path(path_type=Path)


def _options(*names: str) -> Callable[[Any], Any]:
    """Return a decorator with the options that several commands share."""
    known = {
        "train": click.option("--train", multiple=True, type=_PATH, help="Recording to fit; repeat for several."),
        "holdout": click.option(
            "--holdout", multiple=True, type=_PATH, help="Recording that is never fitted; repeat for several."
        ),
        "out": click.option("--out", required=True, type=_PATH, help="Folder for the results."),
        "seed": click.option("--seed", default=1, show_default=True, help="Seed of everything random."),
        "quiet": click.option("--quiet", is_flag=True, help="No progress on standard error."),
    }

    def decorate(function: Any) -> Any:
        for name in reversed(names):
            function = known[name](function)
        return function

    return decorate


@contextmanager
def _progress(quiet: bool):
    """Yield a function that shows what is being done on standard error."""
    if quiet or not sys.stderr.isatty():
        last = ""

        def tell(message: str) -> None:
            nonlocal last
            kind = message.partition(":")[0]
            if not quiet and kind != last:
                click.echo(message, err=True)
            last = kind

        yield tell
        return
    from rich.console import Console

    with Console(stderr=True).status("starting") as status:
        yield status.update


def _load(rig: Path, train: tuple[Path, ...], holdout: tuple[Path, ...], *, keep_third: bool = True) -> Dataset:
    from discovery.dataset import load_dataset

    return load_dataset(rig, train, holdout, keep_third=keep_third)


def _folder(out: Path) -> Path:
    from discovery.errors import InputError

    if out.exists() and not out.is_dir():
        raise InputError(f"{out} is a file; give a folder with --out.")
    return out


@click.group(context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110})
@click.version_option(package_name="discovery")
def cli() -> None:
    """Discover the equation of motion of a mechanical system, and find the effect that its model lacks."""


@cli.command()
@click.argument("rig", type=_PATH)
@_options("train", "holdout", "out", "seed", "quiet")
@click.option("--note", default="", help="Plain words on the data for the top of the report.")
def run(rig: Path, train, holdout, out: Path, seed: int, quiet: bool, note: str) -> None:
    """Run the whole pipeline and write its report."""
    from discovery.pipeline import run as run_pipeline

    dataset = _load(rig, train, holdout)
    with _progress(quiet) as tell:
        run_pipeline(dataset, _folder(out), seed=seed, tell=tell, note=note)
        tell("writing the report")
        from discovery.report import build_report

        page = build_report(out)
    click.echo(f"{page}")


@cli.command()
@click.argument("rig", type=_PATH)
@_options("train", "holdout", "out", "seed", "quiet")
@click.option("--predict", "target", type=_PATH, help="File with times and input only: write prediction.csv for it.")
@click.option(
    "--initial-state", metavar="ANGLE,RATE", help="Initial state of --predict [SI]; static equilibrium otherwise."
)
def loop(
    rig: Path, train, holdout, out: Path, seed: int, quiet: bool, target: Path | None, initial_state: str | None
) -> None:
    """Find what the declared model lacks."""
    from discovery.stages import loop as close

    initial = _initial(initial_state)
    dataset = _load(rig, train, holdout)
    wanted = None
    if target is not None:
        from discovery.experiment import make_experiment
        from discovery.recording import read_recording

        wanted = make_experiment(read_recording(target, dataset.rig, require_output=False), dataset.rig)
    folder = _folder(out)
    with _progress(quiet) as tell:
        result = close(dataset, tell=tell)
        from discovery.pipeline import save_prediction, write_loop

        if wanted is not None:
            tell("predicting")
            save_prediction(folder / "prediction.csv", wanted, result.before, result.after, initial)
        write_loop(folder, result)
    _say_loop(result)


def _initial(text: str | None) -> tuple[float, float] | None:
    if text is None:
        return None
    from discovery.errors import InputError

    try:
        angle, rate = (float(part) for part in text.split(","))
    except ValueError:
        raise InputError(
            f"--initial-state {text!r} is not ANGLE,RATE: give two numbers in rad and rad/s, such as 0.1,0."
        ) from None
    return angle, rate


def _say_loop(result) -> None:
    click.echo(f"verdict: {result.verdict}")
    for effect in result.summary()["effects"]:
        values = ", ".join(
            f"{n} = {p['value']:.6g}" + (f" +- {p['sd']:.2g}" if p["sd"] is not None else "") + f" {p['unit']}"
            for n, p in effect["parameters"].items()
        )
        click.echo(f"added: {effect['id']}" + (f" ({values})" if values else ""))
    for when in ("before", "after"):
        found = result.errors[when]
        click.echo(
            f"{when:>6}: "
            + ", ".join(f"{k} rms {v['rms']:.4g}" for k, v in found.items())
            + f" {result.errors['unit']}"
        )


@cli.command()
@click.argument("rig", type=_PATH)
@_options("train", "out", "seed", "quiet")
def discover(rig: Path, train, out: Path, seed: int, quiet: bool) -> None:
    """Find the equation of motion by sparse regression."""
    from discovery import stages
    from discovery.provenance import provenance, write_json

    dataset = _load(rig, train, (), keep_third=False)
    with _progress(quiet) as tell:
        found = stages.discover(dataset, seed=seed, tell=tell)
    summary = found.summary()
    write_json(_folder(out) / "discovery.json", {"provenance": provenance(dataset, seed=seed), **summary})
    click.echo(summary["discovery"]["status"])
    if summary["radius"]:
        click.echo(summary["radius"]["status"])


@cli.command()
@click.argument("rig", type=_PATH)
@_options("train", "out", "seed", "quiet")
def fit(rig: Path, train, out: Path, seed: int, quiet: bool) -> None:
    """Fit the linear and the declared model by output error."""
    from discovery import stages
    from discovery.provenance import provenance, write_json

    dataset = _load(rig, train, (), keep_third=False)
    with _progress(quiet) as tell:
        fits = stages.estimate(dataset, tell=tell)
    write_json(_folder(out) / "fit.json", {"provenance": provenance(dataset, seed=seed), **fits.summary()})
    for label, found in fits.models.items():
        values = ", ".join(f"{n} = {found.values[n]:.6g} +- {found.sd[n]:.2g}" for n in found.problem.free)
        click.echo(f"{label}: {values}; {found.status}")


@cli.command()
@click.argument("rig", type=_PATH)
@_options("train", "out", "seed", "quiet")
def posterior(rig: Path, train, out: Path, seed: int, quiet: bool) -> None:
    """Sample the posterior of the declared model; an interrupted run is resumed."""
    from discovery import stages
    from discovery.provenance import provenance, write_json

    dataset = _load(rig, train, (), keep_third=False)
    folder = _folder(out)
    folder.mkdir(parents=True, exist_ok=True)
    checkpoint = folder / "posterior_chains.h5"
    with _progress(quiet) as tell:
        fitted = stages.estimate(dataset, tell=tell).models["declared"]
        found = stages.sampled(fitted, seed=seed, tell=tell, backend=checkpoint)
    found.to_netcdf(folder / "posterior.nc")
    rows = found.summary()
    write_json(
        folder / "posterior.json", {"provenance": provenance(dataset, seed=seed), "rows": rows, "status": found.status}
    )
    checkpoint.unlink(missing_ok=True)
    for row in rows:
        click.echo(f"{row['name']}: {row['mean']:.6g} +- {row['sd']:.2g} {row['unit']}")


@cli.command()
@click.argument("rig", type=_PATH)
@_options("train", "out", "seed", "quiet")
def elastica(rig: Path, train, out: Path, seed: int, quiet: bool) -> None:
    """Predict alpha, beta and gamma from the rig file alone; with posterior.nc in OUT, compare."""
    from discovery import stages
    from discovery.draws import Posterior
    from discovery.errors import InputError
    from discovery.provenance import provenance, write_json

    dataset = _load(rig, train, (), keep_third=False)
    folder = _folder(out)
    saved = folder / "posterior.nc"
    with _progress(quiet) as tell:
        found = stages.predicted(
            dataset, Posterior.from_netcdf(saved) if saved.exists() else None, seed=seed, tell=tell
        )
    if found is None:
        raise InputError(
            f"{rig}: the elastica needs an arm with length, tip_mass, beam_mass and flexural_rigidity in its rig file."
        )
    write_json(folder / "elastica.json", {"provenance": provenance(dataset, seed=seed), **found})
    for row in found["prediction"]:
        click.echo(
            f"{row['mass']:12} {row['law']:22} {row['parameter']:10} {row['mean']:.5g} +- {row['sd']:.2g} {row['unit']}"
        )


@cli.command()
@click.argument("rig", type=_PATH)
@_options("train", "out", "seed", "quiet")
def residual(rig: Path, train, out: Path, seed: int, quiet: bool) -> None:
    """Examine what the declared model leaves."""
    import math

    from discovery import stages
    from discovery.problem import natural_units
    from discovery.provenance import provenance, write_json
    from discovery.residual import examine

    dataset = _load(rig, train, (), keep_third=False)
    with _progress(quiet) as tell:
        fits = stages.estimate(dataset, tell=tell)
    report = examine(dataset.train, fits.predictions["declared"], 2 * math.pi * natural_units(dataset.train).time)
    write_json(_folder(out) / "residual.json", {"provenance": provenance(dataset, seed=seed), **report.summary()})
    click.echo(
        f"rms {report.rms:.3g} noise sds, systematic part {report.systematic:.3g}, "
        f"{'white' if report.white else 'not white'} (Ljung-Box p = {report.ljung_box_p:.2g})"
    )


@cli.command()
@click.argument("folder", type=_PATH)
def report(folder: Path) -> None:
    """Write the page of a finished run again from its result files."""
    from discovery.errors import InputError
    from discovery.report import build_report

    if not (folder / "results.json").exists():
        raise InputError(f"{folder} holds no results.json; make one with `discovery run`.")
    click.echo(f"{build_report(folder)}")


@cli.command()
@click.argument("name", required=False)
def effects(name: str | None) -> None:
    """List the catalogue of effects, or show one effect's card."""
    from discovery.registry import catalogue, get_effect

    if name is None:
        for effect_id, effect in catalogue().items():
            click.echo(f"{effect_id:28} {effect.kind:12} {effect.title()}")
        return
    import inspect

    effect = get_effect(name)
    click.echo(f"{name} ({effect.kind}; {', '.join(sorted(effect.systems))})\n")
    click.echo(inspect.getdoc(type(effect)))
    click.echo(f"\nSource: {effect.cite}\n")
    for p in effect.parameters():
        click.echo(f"  {p.name:10} [{p.unit}]  {p.meaning}, bounds {p.bounds[0]:g} to {p.bounds[1]:g} in natural units")


@cli.command()
@click.argument("manoeuvre")
@click.option(
    "--effect",
    "effects_",
    multiple=True,
    metavar="ID:NAME=VALUE[,NAME=VALUE]",
    help="Hidden effect of the twin; repeat for several.",
)
@click.option("--out", required=True, type=_PATH, help="CSV file to write.")
@click.option("--seed", default=1, show_default=True, help="Seed of the noise.")
def simulate(manoeuvre: str, effects_: tuple[str, ...], out: Path, seed: int) -> None:
    """Record the twin in one of its MANOEUVREs, with any of its hidden effects."""
    from discovery_datasets.disturbances import DISTURBANCES
    from discovery_datasets.recordings import MANOEUVRES, make_recording
    from discovery_datasets.twin import write_csv

    from discovery.errors import InputError

    if manoeuvre not in MANOEUVRES:
        raise InputError(f"The twin knows no manoeuvre {manoeuvre!r}; it knows {', '.join(MANOEUVRES)}.")
    hidden = []
    for text in effects_:
        effect_id, _, rest = text.partition(":")
        if effect_id not in DISTURBANCES:
            raise InputError(f"The twin has no effect {effect_id!r}; it has {', '.join(DISTURBANCES)}.")
        try:
            values = {k.strip(): float(v) for k, v in (part.split("=") for part in rest.split(",") if part)}
            hidden.append(DISTURBANCES[effect_id](**values))
        except (TypeError, ValueError) as error:
            raise InputError(
                f"--effect {text!r} cannot be read: {error}. Write it as {effect_id}:name=value,name=value."
            ) from None
    write_csv(make_recording(manoeuvre, seed, disturbances=tuple(hidden)), out)
    click.echo(f"{out}")


@cli.group()
def data() -> None:
    """Public measured data: list, fetch, check."""


@data.command("list")
def data_list() -> None:
    """List the registered files with origin and licence."""
    from discovery_datasets import registry

    for name, entry in registry.FILES.items():
        click.echo(f"{name:50} {entry.licence}\n    {entry.url}")


@data.command("fetch")
@click.argument("name")
def data_fetch(name: str) -> None:
    """Fetch one file from its public origin."""
    from discovery_datasets import registry

    from discovery.errors import InputError

    try:
        click.echo(f"{registry.fetch(name)}")
    except (registry.DataUnavailable, KeyError) as error:
        raise InputError(str(error.args[0])) from None


@data.command("check")
def data_check() -> None:
    """Check which registered files are present and unaltered."""
    from discovery_datasets import registry

    for state in registry.check():
        click.echo(f"{state.state:8} {state.name}")


def main(arguments: list[str] | None = None) -> None:
    """Run the command line and exit with its status."""
    from discovery.errors import ComputationError, InputError

    try:
        cli.main(arguments, prog_name="discovery", standalone_mode=False)
    except click.exceptions.Abort:
        click.echo("interrupted", err=True)
        sys.exit(130)
    except click.ClickException as error:
        error.show()
        sys.exit(2)
    except InputError as error:
        click.echo(f"discovery: {error}", err=True)
        sys.exit(2)
    except ComputationError as error:
        click.echo(f"discovery: {error}", err=True)
        sys.exit(3)


if __name__ == "__main__":
    main()
