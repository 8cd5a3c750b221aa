"""What spreading cases costs: two workers against one, and the parent's memory against the number of cases.

Usage: ``python benchmarks/campaign.py OUT.json [--seconds 0.2] [--cases 60]``. A case is some fixed work on one core.
Throughput counts from the first outcome on, when the workers have started; the parent's memory is its peak in a process
of its own. Prints tables and writes the numbers as JSON.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import resource
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

from discovery.runs.spread import spread

COUNTS = (50, 200, 800, 3200)
ROUND = 2_000


def work(rounds: int, seed: Any) -> dict[str, float]:
    """Do so many rounds of arithmetic; the result has the size of a usual one."""
    rng = np.random.default_rng(seed)
    x = rng.standard_normal(ROUND)
    for _ in range(rounds):
        x = np.sin(x) + 0.1
    return {f"quantity_{i}": float(v) for i, v in enumerate(x[:50])}


def rounds_for(seconds: float) -> int:
    """Return how many rounds take so long on this core."""
    start = time.perf_counter()
    work(2000, 0)
    return max(1, round(2000 * seconds / (time.perf_counter() - start)))


def throughput(workers: int, rounds: int, cases: int) -> float:
    """Return cases a second once the workers have started."""
    first = None
    for _ in spread(work, ((str(i), rounds) for i in range(cases)), workers=workers):
        first = first or time.perf_counter()
    return (cases - 1) / (time.perf_counter() - first)


def memory(cases: int) -> float:
    """Return the peak memory of this process [MiB] after so many cases of no work."""
    for _ in spread(work, ((str(i), 1) for i in range(cases)), workers=2):
        pass
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def apart(cases: int) -> float:
    """Return `memory` in a fresh process."""
    command = [sys.executable, __file__, "-", "--memory", str(cases)]
    return float(subprocess.run(command, capture_output=True, text=True, check=True).stdout)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("--seconds", type=float, default=0.2, help="of work in a case")
    parser.add_argument("--cases", type=int, default=60)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--memory", type=int, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.memory:
        print(memory(options.memory))
        return
    rounds = rounds_for(options.seconds)
    # Side by side: what else the machine does then slows both.
    rates = np.array([[throughput(w, rounds, options.cases) for w in (1, 2)] for _ in range(options.repeats)])
    one, two = np.median(rates, axis=0)
    efficiency = float(np.median(rates[:, 1] / rates[:, 0] / 2))
    peaks = {n: apart(n) for n in COUNTS}
    print(f"cases of {options.seconds:g} s: {one:.2f} /s in this process, {two:.2f} /s on two workers")
    load = os.getloadavg()[0]
    print(f"efficiency of two workers: {100 * efficiency:.0f} % (load {load:.1f} on {os.cpu_count()} cores)")
    for n, peak in peaks.items():
        print(f"{n:5d} cases: peak memory of the parent {peak:.0f} MiB")
    content = {
        "platform": platform.platform(),
        "load": load,
        "cases": options.cases,
        "seconds": options.seconds,
        "rate_1": float(one),
        "rate_2": float(two),
        "efficiency": efficiency,
        "peak_mib": peaks,
    }
    options.out.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
