"""What the bare exact arm leaves of clean recordings: ``python -m benchmarks.blind.base OUT [--cases 50] [--seed 7]``.

Random arms and manoeuvres as in the blind cases, nothing hidden, camera noise of 0.3 mm. The exact arm is fitted to one
recording with nothing added; its prediction of another manoeuvre, from the drive alone, is compared with the noise-free
tip. Whatever is left here would be explained by effects that are not there.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from discovery_datasets.cases import draw_case
from discovery_datasets.instrument import record, write_csv
from discovery_datasets.quick import readings

from benchmarks.blind.generate import ANGLE_NOISE, rig_file, rounded
from benchmarks.blind.spread import spread

NOISE = 3e-4  # m, per axis


def error(seed: int, index: int) -> dict[str, float]:
    """Fit a clean arm and return the rms distance of its prediction to the noise-free hold-out [m]."""
    from discovery.dataset import load_dataset
    from discovery.fit import declared_model, fit, rig_uncertainty
    from discovery.predict import predict

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
        dataset = load_dataset(folder / "rig.toml", [folder / "train.csv"], [folder / "holdout.csv"], keep_third=False)
        experiment = dataset.train[0]
        model = declared_model(experiment).on_base("elastica_4")
        found = fit(model, [experiment], gaussian=rig_uncertainty(experiment), tolerance=2e-5)
        predicted = predict(found, dataset.holdout[0])[0]
    distance = np.hypot(*(predicted - np.column_stack([motion.tip.real, motion.tip.imag])).T)
    return {
        "case": index,
        "rod_over_tip": rig.beam_mass / rig.tip_mass,
        "deflection": draw.scene.deflection,
        "deflection_holdout": float(np.abs(motion.deflection).max()),
        "rms_m": float(np.sqrt(np.mean(distance**2))),
    }


def _attempt(job: tuple[int, int]) -> dict[str, float]:
    return error(*job)


def main() -> None:
    from scipy.stats import binomtest

    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("--cases", type=int, default=50)
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    rows = []
    for row in spread(_attempt, [(options.seed, i) for i in range(options.cases)], options.workers):
        rows.append(row)
        print(
            f"{len(rows)}/{options.cases} rod/tip {row['rod_over_tip']:.3f}, deflection {row['deflection']:.2f} then "
            f"{row['deflection_holdout']:.2f} rad: {1e3 * row['rms_m']:.3f} mm",
            flush=True,
        )
    rows.sort(key=lambda row: row["case"])
    rms = np.array([row["rms_m"] for row in rows])
    good = int((rms <= NOISE).sum())
    low, high = binomtest(good, len(rows)).proportion_ci(0.95)
    print(
        f"at most {1e3 * NOISE:g} mm: {good} of {len(rows)} ({100 * low:.0f} to {100 * high:.0f} %); "
        f"median {1e3 * np.median(rms):.3f} mm, 90 % below {1e3 * np.quantile(rms, 0.9):.3f} mm, largest "
        f"{1e3 * rms.max():.3f} mm"
    )
    options.out.mkdir(parents=True, exist_ok=True)
    (options.out / "base.json").write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
