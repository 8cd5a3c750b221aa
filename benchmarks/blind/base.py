"""What the bare exact arm leaves of clean recordings: ``python -m benchmarks.blind.base OUT [--cases 50] [--seed 1]``.

Random arms and manoeuvres as in the blind cases, nothing hidden, camera noise of 0.3 mm. The exact arm is fitted to one
recording with nothing added; its prediction of another manoeuvre, from the drive alone, is compared with the noise-free
tip. Whatever is left here would be explained by effects that are not there.

Each arm is a file in ``OUT/base/cases``: finished ones are kept, failed ones are tried again. One that cannot be fitted
counts as missed.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from discovery_datasets.cases import draw_case
from discovery_datasets.instrument import record, write_csv
from discovery_datasets.quick import readings

from benchmarks.blind.generate import ANGLE_NOISE, rig_file, rounded
from benchmarks.blind.memory import limit_memory
from benchmarks.blind.score import proportion, root_mean_square
from discovery.cli.options import progress
from discovery.results.provenance import write_json
from discovery.runs.campaign import campaign, rows, unfinished, watched

NOISE = 3e-4  # m, per axis
LIMIT = 1200.0  # s that an arm may take


def error(seed: int, index: int) -> dict[str, float]:
    """Fit a clean arm and return the rms distance of its prediction to the noise-free hold-out [m]."""
    from discovery.estimation.declared import declared_model, rig_uncertainty
    from discovery.estimation.fit import fit
    from discovery.estimation.predict import predict
    from discovery.recordings.dataset import load_dataset
    from discovery.recordings.experiment import make_experiment
    from discovery.recordings.recording import read_recording

    draw = draw_case([seed, index])
    rig = rounded(draw.scene.rig)
    rng = np.random.default_rng([seed, index, 1])
    with TemporaryDirectory() as scratch:
        folder = Path(scratch)
        (folder / "rig.toml").write_text(rig_file("clean", rig, NOISE), encoding="utf-8")
        for name, manoeuvre in (("train", draw.train[0]), ("holdout", draw.holdout)):
            motion = readings(rig, manoeuvre, draw.time)
            noisy = record(motion, rng=rng, position_noise=NOISE, angle_noise=ANGLE_NOISE)
            write_csv(noisy, folder / f"{name}.csv")
        dataset = load_dataset(folder / "rig.toml", [folder / "train.csv"], keep_third=False)
        experiment = dataset.train[0]
        model = declared_model(experiment).on_base("elastica_4")
        found = fit(model, [experiment], gaussian=rig_uncertainty(experiment), tolerance=2e-5)
        # At every reading: recordings of a data set may be averages.
        every = make_experiment(read_recording(folder / "holdout.csv", dataset.rig), dataset.rig)
        predicted = predict(found, every)[0]
    distance = np.hypot(*(predicted - np.column_stack([motion.tip.real, motion.tip.imag])).T)
    return {
        "case": index,
        "rod_over_tip": rig.beam_mass / rig.tip_mass,
        "deflection": draw.scene.deflection,
        "deflection_holdout": float(np.abs(motion.deflection).max()),
        "rms_m": root_mean_square(distance),
    }


def attempt(job: tuple[int, int], _seed: Any) -> dict[str, float]:
    """Do one arm."""
    limit_memory()
    return error(*job)


def line(arm: Mapping[str, Any]) -> str:
    """What became of an arm."""
    return (
        f"rod/tip {arm['rod_over_tip']:.3f}, deflection {arm['deflection']:.2f} then "
        f"{arm['deflection_holdout']:.2f} rad: {1e3 * arm['rms_m']:.3f} mm"
    )


def study(out: Path, seed: int, cases: int, workers: int) -> list[dict[str, Any]]:
    """Do the arms that are not done yet, and return all of them."""
    folder = out / "base"
    jobs = {f"clean_{seed:03d}_{i:04d}": (seed, i) for i in range(cases)}
    left = sum(1 for _ in unfinished(jobs.items(), folder))
    outcomes = campaign(attempt, jobs.items(), folder, workers=workers, limit=LIMIT)
    with progress(quiet=False) as tell:
        for i, outcome in enumerate(watched(outcomes, left, "clean arms", tell), 1):
            said = line(outcome.result) if outcome.result else f"missed: {outcome.error}"
            print(f"{i}/{left} {outcome.name}: {said}", flush=True)
    return list(rows(folder, jobs))


def summary(arms: Iterable[Mapping[str, Any]]) -> dict[str, Any]:
    """Share within the noise, and quantiles of the distance [m]; an arm without one is infinitely far."""
    rms = np.array([np.inf if arm["error"] else arm["rms_m"] for arm in arms])
    median, nine = np.quantile(rms, (0.5, 0.9), method="inverted_cdf")
    return {
        "within the noise": proportion(rms <= NOISE),
        "failed": int(np.isinf(rms).sum()),
        "median_m": float(median),
        "90 %_m": float(nine),
        "largest_m": float(rms.max()),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("--cases", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    arms = study(options.out, options.seed, options.cases, options.workers)
    found = summary(arms)
    p = found["within the noise"]
    print(
        f"at most {1e3 * NOISE:g} mm: {p['k']} of {p['n']} ({100 * p['low']:.0f} to {100 * p['high']:.0f} %), "
        f"{found['failed']} failed or blew up; median {1e3 * found['median_m']:.3f} mm, 90 % below "
        f"{1e3 * found['90 %_m']:.3f} mm, largest {1e3 * found['largest_m']:.3f} mm"
    )
    write_json(options.out / "base.json", {**found, "arms": arms})


if __name__ == "__main__":
    main()
