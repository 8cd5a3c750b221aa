"""Run the loop and its peers on the cases: ``python -m benchmarks.blind.run OUT [--cases N] [--workers 2] [--peers]``.

Reads nothing below ``OUT/truth``; cases may be of either world. Each case writes ``OUT/results/<case>/`` with loop.json
and prediction.csv, as the command line does, and done.json with its time or what went wrong; finished cases are kept,
failed ones are tried again.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from benchmarks.blind.memory import limit_memory
from discovery.foundation.io import atomic_write
from discovery.runs.spread import spread


def trainings(case: Path) -> list[Path]:
    """Training recordings of a case."""
    return sorted(case.glob("train*.csv"))


def exact_arm(declared, dataset):
    """Fit the exact arm with nothing added: what every effect must improve upon."""
    from dataclasses import replace

    from discovery.estimation.declared import rig_uncertainty
    from discovery.estimation.fit import fit

    start = {n: v for n, v in declared.values.items() if n in ("alpha", "xi")}
    gaussian = rig_uncertainty(dataset.train[0])
    model = declared.model.on_base("elastica_4")
    whole = [replace(e, fitted_samples=None) for e in dataset.train]
    return fit(model, whole, start=start, gaussian=gaussian, tolerance=2e-5)


def close(case: Path, out: Path, *, with_holdout: bool) -> dict[str, Any]:
    """Run the loop on one case, predict its hold-out, and return what is summarised."""
    from discovery.recordings.dataset import load_dataset
    from discovery.runs.loop_files import write_loop
    from discovery.runs.stages import loop

    out.mkdir(parents=True, exist_ok=True)
    held = [case / "holdout.csv"] if with_holdout else []
    dataset = load_dataset(case / "rig.toml", trainings(case), held)
    # Of a processor: other work on the machine does not count.
    start = time.process_time()
    result = loop(dataset, follow_up=False, progress=lambda _: None)
    seconds = time.process_time() - start
    content = write_loop(out, result)
    predict_arm(case, out, dataset, result) if dataset.train[0].system.has_rod else predict_body(case, out, result)
    return {"seconds": seconds, "verdict": content["verdict"], "effects": [e["id"] for e in content["effects"]]}


def predict_arm(case: Path, out: Path, dataset, result) -> None:
    """Write what the camera reads in the hold-out, from the drive alone: declared, exact arm, after the loop."""
    import pandas as pd

    from discovery.estimation.predict import predict
    from discovery.recordings.experiment import make_experiment
    from discovery.recordings.recording import read_recording
    from discovery.runs.loop_files import save_prediction

    drive = out / "drive.csv"
    pd.read_csv(case / "holdout.csv", usecols=["time_s", "motor_angle_rad"], dtype=str).to_csv(drive, index=False)
    wanted = make_experiment(read_recording(drive, dataset.rig, with_output=False), dataset.rig)
    save_prediction(out / "prediction.csv", wanted, result.before, result.foresight())
    bare = exact_arm(result.before, dataset)
    table = pd.read_csv(out / "prediction.csv")
    table[["tip_x_bare_m", "tip_y_bare_m"]] = predict(bare, wanted)[0]
    table.to_csv(out / "prediction.csv", index=False, float_format="%.9g")


def predict_body(case: Path, out: Path, result) -> None:
    """Write the same for a system with one coordinate, its initial state fitted to the hold-out.

    Its declared mechanics are exact, so nothing is barer than the declared model.
    """
    import pandas as pd

    from benchmarks.blind.rough.refit import free_run
    from discovery.recordings.dataset import load_dataset

    (held,) = load_dataset(case / "rig.toml", trainings(case), [case / "holdout.csv"]).holdout
    before, after = (free_run(found, held)[:, 0] for found in (result.before, result.foresight()))
    columns = {"output_before": before, "output_bare": before, "output_after": after}
    table = pd.DataFrame({"time_s": held.recording.time, **columns})
    table.to_csv(out / "prediction.csv", index=False, float_format="%.9g")


def compare(case: Path, out: Path) -> dict[str, Any]:
    """Run the peers on one case."""
    from benchmarks.blind.peers import peers

    found = peers(case)
    (out / "peers.json").write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    return found


def attempt(job: tuple[Path, Path, bool, bool], _seed: Any) -> dict[str, Any]:
    """Do one case."""
    case, out, with_holdout, with_peers = job
    limit_memory()
    done = close(case, out, with_holdout=with_holdout)
    if with_peers:
        compare(case, out)
    return done


def finished(out: Path) -> bool:
    """Whether a case is done and need not be done again."""
    return out.exists() and "error" not in json.loads(out.read_text())


def run(
    folder: Path,
    cases: Sequence[Path],
    *,
    workers: int,
    with_holdout: bool = False,
    with_peers: bool = False,
    limit: float = 1200,
    scheduler: str | None = None,
) -> Iterator[tuple[str, dict[str, Any]]]:
    """Run cases on processes or a Dask cluster, each in at most `limit` seconds; name and result of each when done."""
    results = folder / "results"
    jobs = (
        (case.name, (case, results / case.name, with_holdout, with_peers))
        for case in cases
        if not finished(results / case.name / "done.json")
    )
    for outcome in spread(attempt, jobs, workers=workers, scheduler=scheduler, limit=limit):
        done = outcome.result or {"error": outcome.error, "trace": outcome.trace}
        with atomic_write(results / outcome.name / "done.json") as draft:
            draft.write_text(json.dumps(done, indent=1) + "\n", encoding="utf-8")
        yield outcome.name, dict(done)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("--cases", type=int, help="only so many, from the first")
    parser.add_argument("--only", nargs="*", help="only these")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--scheduler", help="address of a Dask scheduler whose workers are used instead")
    parser.add_argument("--limit", type=int, default=1200, help="seconds that one case may take")
    parser.add_argument("--holdout", action="store_true", help="let the loop judge on the hold-out recording")
    parser.add_argument("--peers", action="store_true", help="run the peers, too")
    options = parser.parse_args()
    cases = sorted(p for p in (options.out / "cases").iterdir() if (options.out / "truth" / f"{p.name}.json").exists())
    if options.only:
        cases = [c for c in cases if c.name in options.only]
    cases = cases[: options.cases]
    progress = run(
        options.out,
        cases,
        workers=options.workers,
        with_holdout=options.holdout,
        with_peers=options.peers,
        limit=options.limit,
        scheduler=options.scheduler,
    )
    for i, (name, done) in enumerate(progress, 1):
        said = done.get("error") or f"{done['verdict']} {', '.join(done['effects'])} ({done['seconds']:.1f} s)"
        print(f"{i} {name}: {said}", flush=True)


if __name__ == "__main__":
    main()
