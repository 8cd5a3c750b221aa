"""Calibrate the posteriors: ``python -m benchmarks.calibration.run OUT [--workers 2]``.

First on the models' own data (ranks and coverage of truths from the prior), then on the twin (coverage over random
manoeuvres). Finished cases are kept, so an interrupted run goes on where it was. Writes tables as JSON and Parquet and
pictures as SVG.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.random import SeedSequence

from benchmarks.calibration import figures, manoeuvre_table, ranks
from benchmarks.calibration.manoeuvres import GROUP, MODELS, group, noise_free
from benchmarks.calibration.replicate import RANKED, replication
from benchmarks.calibration.studies import KINDS, study
from discovery.cli.options import progress
from discovery.foundation.errors import ComputationError
from discovery.results.provenance import surroundings, write_json
from discovery.runs.campaign import campaign, collect, rows, unfinished, watched

BLOCK = 20  # replications of one case


def replicated(name: str, seed: SeedSequence) -> dict[str, Any]:
    """Do a block of replications of a study; one whose posterior is not found is counted, and no other is lost."""
    found, failed = [], []
    for s in seed.spawn(BLOCK):
        try:
            found.append(replication(study(name), np.random.default_rng(s)))
        except ComputationError as error:
            failed.append(str(error))
    return {"study": name, "rows": found, "failed": failed}


def grouped(model: str, seed: SeedSequence) -> dict[str, Any]:
    """Fit a group of manoeuvres."""
    return group(model, np.random.default_rng(seed))


def targeted(case: tuple[str, list[list[float]]], _seed: SeedSequence) -> dict[str, Any]:
    """Find the pooled target of a model."""
    return {"target": noise_free(*case)}


def done(folder: Path, work: Any, cases: list[tuple[str, Any]], title: str, options: argparse.Namespace) -> Path:
    """Do what is not done yet of a campaign, and say what failed."""
    spread = {"seed": options.seed, "workers": options.workers, "scheduler": options.scheduler}
    left = sum(1 for _ in unfinished(cases, folder))
    with progress(quiet=False) as tell:
        for outcome in watched(campaign(work, cases, folder, **spread), left, title, tell):
            if outcome.error:
                print(f"{outcome.name}: {outcome.error}", flush=True)
    return collect(folder)


def found_in(folder: Path, names: Iterable[str]) -> dict[str, dict[str, Any]]:
    """Return the results of cases by name."""
    wanted = set(names)
    return {row["name"]: row for row in rows(folder) if row["name"] in wanted and not row["error"]}


def own_data(options: argparse.Namespace) -> None:
    """Rank truths of every study in their posteriors."""
    counts = {name: options.replications if name == "gaussian" else options.variants for name in KINDS}
    cases = [(f"{name}_{i:04d}", name) for name, n in counts.items() for i in range(-(-n // BLOCK))]
    folder = options.out / "ranks"
    done(folder, replicated, cases, "replications", options)
    blocks = found_in(folder, (name for name, _ in cases)).values()
    tables = {}
    for name in KINDS:
        own = [block for block in blocks if block["study"] == name]
        if found := [row for block in own for row in block["rows"]]:
            failed = sum(len(block["failed"]) for block in own)
            tables[name] = {**ranks.summary(found, RANKED), "failed": failed}
    titles = {name: KINDS[name][0] for name in tables}
    for name, table in tables.items():
        print(
            f"{titles[name]}: {table['replications']} replications, {table['unreliable']} with unreliable weights, "
            f"{table['failed']} more without a posterior"
        )
        for quantity, found in table["quantities"].items():
            c, h = found["coverage"]["0.9"], found["histogram"]
            wrong = "  NOT within 88 to 92 %" * (c["high"] < ranks.GOAL[0] or c["low"] > ranks.GOAL[1])
            print(
                f"  {quantity:16} 90 % intervals hold {100 * c['share']:5.1f} % ({100 * c['low']:.1f} to "
                f"{100 * c['high']:.1f}); ranks uniform: p = {h['p']:.2g}{wrong}"
            )
        figures.ranks(table, titles[name], options.out / f"ranks_{name}.svg")
    figures.coverages(tables, titles, options.out / "coverage.svg")
    write_json(
        options.out / "ranks.json", {**surroundings(), "seed": options.seed, "titles": titles, "studies": tables}
    )


def on_the_twin(options: argparse.Namespace) -> None:
    """Bound the parameters of random manoeuvres, and see how often the targets are inside."""
    counts = {"paper": options.manoeuvres, "exact": options.exact}
    cases = [(f"{model}_{i:04d}", model) for model, n in counts.items() for i in range(-(-n // GROUP))]
    folder = options.out / "manoeuvres"
    done(folder, grouped, cases, "groups of manoeuvres", options)
    groups = found_in(folder, (name for name, _ in cases))
    by_model = {model: [row for row in groups.values() if row["model"] == model] for model in MODELS}
    wanted = {
        f"{model}_{len(found):04d}": (model, [move for row in found for move in row["moves"]])
        for model, found in by_model.items()
        if found
    }
    done(options.out / "targets", targeted, list(wanted.items()), "pooled targets", options)
    targets = {wanted[name][0]: row["target"] for name, row in found_in(options.out / "targets", wanted).items()}
    tables = {model: manoeuvre_table.table(model, by_model[model], target) for model, target in targets.items()}
    for model, table in tables.items():
        print(f"\n{manoeuvre_table.text(table)}")
        for target in manoeuvre_table.TARGETS:
            figures.manoeuvres(table, target, options.out / f"manoeuvres_{model}_{target.replace(' ', '_')}.svg")
    write_json(options.out / "manoeuvres.json", {**surroundings(), "seed": options.seed, "models": tables})


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("--replications", type=int, default=2000, help="of the paper's model")
    parser.add_argument("--variants", type=int, default=1000, help="replications of every other study")
    parser.add_argument("--manoeuvres", type=int, default=600, help="fitted by the paper's model")
    parser.add_argument("--exact", type=int, default=120, help="manoeuvres fitted by the exact arm")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--scheduler", help="address of a Dask scheduler whose workers are used instead")
    options = parser.parse_args()
    if min(options.manoeuvres, options.exact) < 2 * GROUP:
        parser.error(f"at least {2 * GROUP} manoeuvres are needed, to see how groups of {GROUP} scatter")
    own_data(options)
    on_the_twin(options)


if __name__ == "__main__":
    main()
