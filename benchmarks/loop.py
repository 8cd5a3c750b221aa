"""What closing the loop costs: one 25 s, 100 Hz arm recording alone, and the four sets of the twin.

Usage: ``python benchmarks/loop.py OUT.json [--runs 3]``. Prints each row as it is measured and writes the numbers as
JSON. Times are medians of runs with compiled code warm; "first" is the first run of the process, which loads it.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import time
from pathlib import Path
from typing import Any

import numpy as np

from discovery.equations.lacking import candidates
from discovery.equations.model import Model
from discovery.estimation.bench import Bench
from discovery.estimation.fit import fit
from discovery.estimation.natural_units import natural_units
from discovery.estimation.problem import known_values
from discovery.estimation.step import choose_step
from discovery.recordings.dataset import Dataset, load_dataset
from discovery.results.judging import held_group
from discovery.runs.loop import close_loop
from discovery.screening.attribution import screen
from discovery.screening.refits import refit
from discovery.selection.settings import LoopSettings

DATASETS = Path(__file__).parents[1] / "datasets"
BASES = ("constant_radius", "reduced", "elastica_calm", "elastica")
SETS = ("arm", "arm_coulomb", "arm_delay", "arm_tilt")


def alone(name: str) -> Dataset:
    """One recording, its last third held out."""
    return load_dataset(DATASETS / name / "rig.toml", [DATASETS / name / "train_large.csv"])


def entire(name: str) -> Dataset:
    """One recording, all of it fitted."""
    return load_dataset(DATASETS / name / "rig.toml", [DATASETS / name / "train_large.csv"], keep_third=False)


def whole(name: str) -> Dataset:
    """Both training recordings, judged by the hold-outs."""
    folder = DATASETS / name
    held = sorted(p for p in folder.glob("holdout_*.csv") if not p.stem.endswith("clean"))
    return load_dataset(folder / "rig.toml", [folder / "train_paper.csv", folder / "train_large.csv"], held)


def closing(label: str, dataset: Dataset, runs: int) -> dict[str, Any]:
    """Time the loop on a data set."""
    seconds = []
    for _ in range(runs + 1):
        start = time.perf_counter()
        result = close_loop(dataset.train, dataset.holdout)
        seconds.append(time.perf_counter() - start)
    held = result.errors["after"][held_group(result.errors)]
    return {
        "recordings": label,
        "first_s": seconds[0],
        "median_s": float(np.median(seconds[1:])),
        "slowest_s": max(seconds[1:]),
        "verdict": result.verdict,
        "added": ", ".join(result.added),
        "held_out_mean_mm": 1e3 * held["mean"],
    }


def screening(dataset: Dataset, base: str, runs: int) -> dict[str, Any]:
    """Time one screening of the catalogue, and the bounded refits of every candidate, around a fit on a base."""
    train = dataset.train
    units = natural_units(train)
    known = known_values(train[0]) | ({"tau_r": 1.5e-4} if base.startswith("elastica") else {})
    model = Model(base, ("viscous_damping", "linear_stiffness"), known)
    names = candidates(model)
    effects = tuple(sorted({*model.effects, *names}))
    start = {"xi": 0.0458, "alpha": 8.1}
    step = choose_step(model, train, units, start, LoopSettings().tolerance, effects)
    found = fit(model, train, start=start, units=units, bench=Bench(base, effects, train, step))
    screened, busy, refitted = [], [], []
    for _ in range(runs + 1):
        begin, worked = time.perf_counter(), time.process_time()
        scored = screen(found.minimum, found.problem, names)
        middle = time.perf_counter()
        busy.append(time.process_time() - worked)
        refit(found.minimum, found.problem, scored)
        screened.append(middle - begin)
        refitted.append(time.perf_counter() - middle)
    return {
        "base": base,
        "samples": int(sum(e.fitted.stop or e.recording.time.size for e in train)),
        "candidates": len(names),
        "step_s": step,
        "screen_ms": 1e3 * float(np.median(screened[1:])),
        "screen_cpu_ms": 1e3 * float(np.median(busy[1:])),
        "refit_ms": 1e3 * float(np.median(refitted[1:])),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("--runs", type=int, default=3)
    options = parser.parse_args()
    sets = {f"{name}/train_large alone": alone(name) for name in ("arm", "arm_delay")}
    sets |= {f"{name}, two and hold-outs": whole(name) for name in SETS}
    rows = []
    for label, dataset in sets.items():
        rows.append(closing(label, dataset, options.runs))
        told = {k: f"{v:.3g}" if isinstance(v, float) else v for k, v in rows[-1].items() if k != "recordings"}
        print(f"{label}:", ", ".join(f"{k} {v}" for k, v in told.items()), flush=True)
    catalogue = [screening(entire("arm_delay"), base, options.runs) for base in BASES]
    for c in catalogue:
        print(
            f"one recording of {c['samples']} samples on {c['base']}: screening {c['candidates']} effects takes "
            f"{c['screen_ms']:.0f} ms ({c['screen_cpu_ms']:.0f} ms of processor time), "
            f"refitting them {c['refit_ms']:.0f} ms"
        )
    machine = {"cpus": os.cpu_count(), "load": os.getloadavg()[0], "python": platform.python_version()}
    found = {"machine": machine, "loops": rows, "screening": catalogue}
    options.out.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
