"""The campaign on processes and on a cluster, beside some of its rigs alone: what is lost, and what it costs."""

from __future__ import annotations

import statistics
import time
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, nullcontext
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.scale.rig import write
from benchmarks.scale.watch import Watch
from discovery.cli.campaign_cases import Case, found_cases, rig_files
from discovery.cli.campaigns import close
from discovery.report.campaign import build_campaign
from discovery.runs.campaign import campaign, collect, pooled_parameters, rows, unfinished

#: Rigs that are done alone, before and after.
ALONE = 40


def logged(log: str, case: Case, seed: Any) -> Mapping[str, Any]:
    """Close the loop of a case, and note when it begins and ends; one short line is written at once or not at all."""
    with open(log, "a", encoding="utf-8") as file:
        file.write(f"begun {case.out.name}\n")
    began = time.process_time()
    found = close(case, seed)
    with open(log, "a", encoding="utf-8") as file:
        file.write(f"ended {case.out.name}\n")
    return {**found, "cpu": time.process_time() - began}


def alone(cases: list[tuple[str, Case]], folder: Path) -> tuple[float, dict[str, Any]]:
    """Return rigs a second of this process alone, its first left out, and what was found."""
    log = str(folder / "log")
    began, found = None, {}
    for outcome in campaign(partial(logged, log), cases, folder, workers=1):
        began = began or time.perf_counter()
        found[outcome.name] = values(outcome.result or {})
    assert began is not None
    return (len(found) - 1) / (time.perf_counter() - began), found


def values(result: Mapping[str, Any]) -> dict[str, Any]:
    """Return what of a result does not depend on the clock."""
    return {key: value for key, value in result.items() if key != "cpu"}


def crowd(cases: list[tuple[str, Case]], folder: Path, watch: Watch, **where: Any) -> dict[str, Any]:
    """Do all cases on several workers that are killed, and return what became of them."""
    log, calls, yielded = folder / "log", 0, Counter[str]()
    began = time.perf_counter()
    own = time.process_time()
    with watch:
        # Who gave up a case that died three times does it again, as a user would with the same command.
        while any(True for _ in unfinished(cases, folder)):
            calls += 1
            for outcome in campaign(partial(logged, str(log)), cases, folder, **where):
                yielded[outcome.name] += not outcome.error
    seconds, own = time.perf_counter() - began, time.process_time() - own
    lines = Counter(log.read_text(encoding="utf-8").splitlines())
    kept = {row["name"]: row for row in rows(folder)}
    memory = watch.memory
    tenth = max(1, len(memory) // 10)
    return {
        "rigs": len(cases),
        "seconds": seconds,
        "kills": watch.kills,
        "calls": calls,
        "lost": len([name for name, _ in cases if name not in kept or kept[name]["error"]]),
        "kept_twice": sum(count > 1 for count in yielded.values()),
        "begun": sum(count for line, count in lines.items() if line.startswith("begun")),
        "work_cpu_s": sum(row.get("cpu") or 0.0 for row in kept.values()),
        "own_cpu_s": own,
        "memory_mib": {"second_tenth": statistics.median(memory[tenth : 2 * tenth]),
                       "last_tenth": statistics.median(memory[-tenth:]), "peak": max(memory)},
        "worker_peak_mib": watch.of_worker,
        "found": {name: values({k: v for k, v in row.items() if k not in ("name", "seconds", "error")})
                  for name, row in kept.items()},
    }  # fmt: skip


@contextmanager
def cluster(workers: int) -> Iterator[dict[str, Any]]:
    """Yield where a Dask cluster works that listens on loopback alone, its dashboard included."""
    from distributed import LocalCluster

    with LocalCluster(
        workers, threads_per_worker=1, host="127.0.0.1", dashboard_address="127.0.0.1:0", silence_logs=50
    ) as local:
        # One that is killed while it starts is given up by its nanny: another takes its place.
        local.adapt(minimum=workers, maximum=workers)
        yield {"scheduler": local.scheduler_address}


def study(rigs: int, workers: int, every: float, made: Path) -> dict[str, Any]:
    """Return the numbers of both ways, beside those of a process alone."""
    for i in range(rigs):
        write(made / "rigs" / f"rig_{i:04d}", i)
    found = rig_files(made / "rigs")[0]
    ways: dict[str, AbstractContextManager[dict[str, Any]]] = {
        "processes": nullcontext({"workers": workers}),
        "dask": cluster(workers),
    }
    content: dict[str, Any] = {}
    for name, where in ways.items():
        folder = made / name
        folder.mkdir()
        (folder / "log").touch()
        cases = found_cases(found, made / "rigs", folder)
        some = cases[:: max(1, rigs // ALONE)]
        rates = []
        (made / f"{name}_alone").mkdir()
        before, expected = alone(some, made / f"{name}_alone")
        rates.append(before)
        with where as given:
            content[name] = crowd(cases, folder, Watch(folder / "log", every, seed=1), **given)
        (made / f"{name}_again").mkdir()
        rates.append(alone(some, made / f"{name}_again")[0])
        one = content[name]
        one["alone_per_s"] = rates
        one["efficiency"] = one["rigs"] / one["seconds"] / np.mean(rates) / workers
        kept = one.pop("found")
        one["differing"] = sum(kept[case] != value for case, value in expected.items())
    began = time.perf_counter()
    collect(folder, apart=["parameters"])
    pooled = pooled_parameters(rows(folder))
    build_campaign(folder, [{k: v for k, v in row.items() if k != "parameters"} for row in rows(folder)], pooled)
    content["page_s"] = time.perf_counter() - began
    content["pooled"] = [{key: p[key] for key in ("parameter", "mean", "spread", "unit")} for p in pooled]
    return content
