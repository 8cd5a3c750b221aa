"""Write the cases of the blind benchmark: ``python -m benchmarks.blind.generate OUT --cases 300 [--seed 1]``.

``--world exact`` (the default) has arms whose mechanics are exact but for the hidden effect. ``--world rough`` has arms
and systems with one coordinate that have errors of the model beside it, see `benchmarks.blind.rough`.

``OUT/cases/<case>`` holds what an experimenter has (rig.toml, train.csv, some also train_2.csv, holdout.csv), and
``OUT/truth`` what nothing but the scorer reads: the effects, their sizes, and the noise-free hold-out. A finished case
is kept, so an interrupted run is continued by the same command. A case that cannot be written, because its motion blows
up, is said at the end with its reason; the next number takes its place.

The size of an effect is `unabsorbed_over_noise`: the exact arm (stiffness, friction and initial states free, nothing
else) is fitted to the noise-free readings of the training recordings; the rms of what it leaves over both axes and all
samples, less in quadrature what it leaves of the same arm without the effect, in units of the camera's noise.
"""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from discovery_datasets.arm import ArmRig, TwinError
from discovery_datasets.cases import CaseDraw, draw_case
from discovery_datasets.disturbances import Disturbance
from discovery_datasets.hidden import FAMILIES, Hidden
from discovery_datasets.instrument import record, write_csv
from discovery_datasets.quick import readings
from discovery_datasets.quick_effects import BaseBacklash

from benchmarks.blind.memory import limit_memory
from discovery.runs.spread import Outcome, spread

#: A strength is corrected so often towards its wanted size.
CORRECTIONS = 2
ANGLE_NOISE = 7e-5  # rad


@cache
def _exact_arm():
    from discovery.equations.model import Model
    from discovery.estimation.fit import fit
    from discovery.estimation.problem import known_values
    from discovery.recordings.dataset import load_dataset

    def left(rig: Path, train: Sequence[Path], start: dict[str, float], retardation: float) -> np.ndarray:
        """Residual over noise of the exact arm refitted, all samples and axes."""
        experiments = load_dataset(rig, train, keep_third=False).train
        known = {**known_values(experiments[0]), "tau_r": retardation}
        found = fit(
            Model("elastica", ("viscous_damping", "linear_stiffness"), known), experiments, start=start, tolerance=2e-5
        )
        pairs = zip(found.predict(), experiments, strict=True)
        return np.concatenate([((p - e.recording.output) / e.recording.noise).ravel() for p, e in pairs])

    return left


def rig_file(name: str, rig: ArmRig, noise: float) -> str:
    """Text of the rig file."""
    return (
        f'# one flexible arm\nname = "{name}"\nlength_m = {rig.length:.6f}\ntip_mass_kg = {rig.tip_mass:.6f}\n'
        f"beam_mass_kg = {rig.beam_mass:.6f}\nflexural_rigidity_N_m2 = {rig.flexural_rigidity:.6f}\n"
        f"position_noise_m = {noise:.6g}\nangle_noise_rad = {ANGLE_NOISE:g}\n"
    )


def rounded(rig: ArmRig) -> ArmRig:
    """The rig as its file states it: what is written is what was simulated."""
    return ArmRig(**{k: v if k in ("disc_friction", "retardation") else round(v, 6) for k, v in asdict(rig).items()})


def size_over_noise(draw: CaseDraw, rig: ArmRig, effects: Sequence[Disturbance], folder: Path) -> float:
    """Rms of what the exact arm leaves of the noise-free training readings, in units of the noise."""
    (folder / "rig.toml").write_text(rig_file("probe", rig, draw.noise), encoding="utf-8")
    paths = []
    for i, manoeuvre in enumerate(draw.train):
        motion = readings(rig, manoeuvre, draw.time, disturbances=effects)
        silent = record(motion, rng=np.random.default_rng(0), position_noise=0.0, angle_noise=0.0)
        paths.append(folder / f"train_{i}.csv")
        silent.to_csv(paths[-1], index=False, float_format="%.9f")
    mass, length = rig.effective_mass, rig.length
    start = {"alpha": 3 * rig.flexural_rigidity / (mass * length**3), "xi": rig.disc_friction / mass}
    return float(np.sqrt(np.mean(_exact_arm()(folder / "rig.toml", paths, start, rig.retardation) ** 2)))


def settle(draw: CaseDraw, rig: ArmRig, hidden: Hidden, target: float, clean: float, folder: Path) -> float:
    """Strength at which an effect has about the wanted size, at most what a laboratory would not notice otherwise."""
    strength = 1.0
    for _ in range(CORRECTIONS):
        try:
            size = size_over_noise(draw, rig, [hidden.make(strength)], folder)
        except TwinError:
            strength /= 3
            continue
        own = np.sqrt(max(size**2 - clean**2, (0.1 * clean) ** 2))
        strength = float(np.clip(strength * np.clip(target / own, 0.02, 50.0), 1e-3, hidden.most))
    return strength


def accepted(hidden: Hidden, effect: Disturbance, rig: ArmRig, noise: float) -> list[str]:
    """Return the right names of an effect: a play that moves the tip by less than the noise is its contact's spring."""
    unseen = isinstance(effect, BaseBacklash) and effect.half_width * rig.length < noise
    return [*hidden.accepted, *(["base_compliance"] if unseen else [])]


def case_name(seed: int, index: int, world: str = "exact") -> str:
    """Name of a case."""
    return f"{'case' if world == 'exact' else world}_{seed:03d}_{index:04d}"


def write_case(out: Path, seed: int, index: int) -> dict[str, Any]:
    """Write one case and return its truth."""
    name = case_name(seed, index)
    sealed = out / "truth" / f"{name}.json"
    if sealed.exists():
        return json.loads(sealed.read_text())
    draw = draw_case([seed, index])
    rig = rounded(draw.scene.rig)
    with TemporaryDirectory() as scratch:
        clean = size_over_noise(draw, rig, [], Path(scratch))
        strengths = [
            settle(draw, rig, h, t, clean, Path(scratch)) for h, t in zip(draw.hidden, draw.targets, strict=True)
        ]
        effects = [h.make(s) for h, s in zip(draw.hidden, strengths, strict=True)]
        sizes = [
            float(np.sqrt(max(size_over_noise(draw, rig, [e], Path(scratch)) ** 2 - clean**2, 0.0))) for e in effects
        ]
        both = sizes[0] if len(effects) == 1 else size_over_noise(draw, rig, effects, Path(scratch)) if effects else 0.0
    folder = out / "cases" / name
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng([seed, index, 1])
    stems = ["train", *(f"train_{i}" for i in range(2, len(draw.train) + 1)), "holdout"]
    reached = {}
    for stem, manoeuvre in zip(stems, (*draw.train, draw.holdout), strict=True):
        motion = readings(rig, manoeuvre, draw.time, disturbances=effects)
        reached[stem] = float(np.abs(motion.deflection).max())
        frame = record(motion, rng=rng, position_noise=draw.noise, angle_noise=ANGLE_NOISE)
        write_csv(frame, folder / f"{stem}.csv")
    silent = record(motion, rng=rng, position_noise=0.0, angle_noise=0.0)
    (folder / "rig.toml").write_text(rig_file(name, rig, draw.noise), encoding="utf-8")
    (out / "truth").mkdir(exist_ok=True)
    silent.to_csv(out / "truth" / f"{name}_holdout_clean.csv", index=False, float_format="%.8f")
    family = {e: f for f, members in FAMILIES.items() for e in members}
    truth = {
        "case": name,
        "kind": draw.kind,
        "effects": [
            {
                "id": h.id,
                "family": family[h.id],
                "accepted": accepted(h, e, rig, draw.noise),
                "strength": s,
                "parameters": asdict(e),
                "unabsorbed_over_noise": u,
            }
            for h, s, e, u in zip(draw.hidden, strengths, effects, sizes, strict=True)
        ],
        "unabsorbed_over_noise": both,
        "geometry_over_noise": clean,
        "noise": draw.noise,
        "rate_hz": round(1 / float(draw.time[1]), 6),
        "duration": float(draw.time[-1]),
        "deflection": reached,
        "rig": asdict(rig),
    }
    draft = sealed.with_suffix(".part")
    draft.write_text(json.dumps(truth, indent=1) + "\n", encoding="utf-8")
    os.replace(draft, sealed)
    return truth


def write_rough_case(out: Path, seed: int, index: int) -> dict[str, Any]:
    """Write one case of the rough world and return its truth."""
    from benchmarks.blind.rough.cases import write_case as write

    return write(out, case_name(seed, index, "rough"), seed, index)


def attempt(job: tuple[Path, int, int, str], _seed: Any) -> dict[str, str]:
    """Write a case and say what is in it."""
    limit_memory()
    *case, world = job
    truth = write_case(*case) if world == "exact" else write_rough_case(*case)
    said = ", ".join(f"{e['id']} {e['unabsorbed_over_noise']:.2g}" for e in truth["effects"]) or "nothing"
    if world == "rough":
        said = f"{truth['system']}: {said}, errors of the model {truth['model_error_over_noise']:.2g}"
    return {"found": said}


def generate(out: Path, seed: int, indices: range, workers: int, world: str = "exact") -> Iterator[Outcome]:
    """Write so many cases on several processes; one that fails is replaced by the next after the last."""
    while indices:
        failed = 0
        jobs = ((case_name(seed, i, world), (out, seed, i, world)) for i in indices)
        for outcome in spread(attempt, jobs, workers=workers):
            failed += bool(outcome.error)
            yield outcome
        # Where all fail, so would the next.
        indices = range(indices.stop, indices.stop + failed) if failed < len(indices) else range(0)


def tally(outcomes: Sequence[Outcome], wanted: int) -> str:
    """How many cases there are, and which are not and why."""
    failed = [o for o in outcomes if o.error]
    written = len(outcomes) - len(failed)
    lines = [f"{written} cases are written, {max(0, wanted - written)} are missing; {len(failed)} could not be written"]
    return "\n".join(lines + [f"  {o.name}: {o.error}" for o in failed])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("--cases", type=int, default=300)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--world", choices=("exact", "rough"), default="exact")
    options = parser.parse_args()
    indices = range(options.first, options.first + options.cases)
    outcomes = []
    for outcome in generate(options.out, options.seed, indices, options.workers, options.world):
        outcomes.append(outcome)
        said = outcome.result["found"] if outcome.result else f"left out: {outcome.error}"
        print(f"{len(outcomes)}/{options.cases} {outcome.name}: {said}", flush=True)
    print(tally(outcomes, options.cases))


if __name__ == "__main__":
    main()
