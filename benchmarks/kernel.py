"""What a simulation costs: the compiled kernel of each base, a loop in C beside it, and its peers at equal accuracy.

Usage: ``python benchmarks/kernel.py OUT.json [--runs 7] [--sets 256]``. Prints tables and writes the numbers as JSON.
Every time is the median of the runs; what is compared runs in turn.
"""

from __future__ import annotations

import argparse
import ctypes
import json
import os
import platform
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit
from scipy.integrate import solve_ivp

from discovery.declarations.registry import catalogue
from discovery.equations.model import Model
from discovery.estimation.bench import Bench
from discovery.recordings.dataset import load_dataset
from discovery.recordings.drive import Drive
from discovery.recordings.experiment import Experiment
from discovery.recordings.recording import Recording
from discovery.simulation import simulate
from discovery.simulation.simulate import Misses, Simulator, simulated
from discovery.testing.states import every_effect

ARM = Path(__file__).parents[1] / "datasets" / "arm"
VALUES = {"xi": 0.0458, "alpha": 8.7907, "beta": 0.5139, "gamma": 0.4462, "length": 1.0, "mu": 0.2845, "g": 1.0}
WHOLE = "whole catalogue"
#: The loop in C, and how it is compiled.
LOOP = Path(__file__).with_name("three_terms.c")
FLAGS = ("-O3", "-march=native", "-ffast-math", "-shared", "-fPIC")
PAPER = ("viscous_damping", "linear_stiffness", "cubic_stiffness", "radius_law")
#: Label, base, effects, step [s]: the steps leave about 1e-6 rad on this recording; the exact arm's is set by its third
#: mode. Of the whole catalogue, only what VALUES names is present; then one effect more a set, and all at once.
CASES: tuple[tuple[str, str, tuple[str, ...], float], ...] = (
    ("paper's model", "constant_radius", PAPER, 0.02),
    (WHOLE, "constant_radius", every_effect("constant_radius"), 0.02),
    ("paper's model", "reduced", PAPER, 0.02),
    (WHOLE, "reduced", every_effect("reduced"), 0.02),
    ("viscous, linear", "elastica", PAPER[:2], 0.004),
    (WHOLE, "elastica", every_effect("elastica"), 0.004),
    ("viscous, linear, cubic", "oscillator", PAPER[:3], 0.02),
    (WHOLE, "oscillator", every_effect("oscillator"), 0.02),
)


def median(work: Callable[[], object], runs: int) -> float:
    """Return the median time of a call [s], after one that is not counted."""
    work()
    found = []
    for _ in range(runs):
        start = time.perf_counter()
        work()
        found.append(time.perf_counter() - start)
    return float(np.median(found))


def in_turn(
    work: Mapping[str, Callable[[], object]], runs: int, clock: Callable[[], float] = time.perf_counter
) -> dict[str, np.ndarray]:
    """Return the times of several calls [s], each (runs,), measured one after another in every round."""
    for call in work.values():
        call()
    found: dict[str, list[float]] = {name: [] for name in work}
    for _ in range(runs):
        for name, call in work.items():
            start = clock()
            call()
            found[name].append(clock() - start)
    return {name: np.array(seconds) for name, seconds in found.items()}


def inputs(
    simulator: Simulator, model: Model, sets: int, scatter: float, present: str = ""
) -> tuple[np.ndarray, np.ndarray]:
    """Return parameter sets (p, k), relatively scattered, absent effects at their defaults; and initial zeros.

    With ``"one"`` of the other effects present each set has one more, in turn, with ``"all"`` each has all.
    """
    centre = np.array([VALUES.get(n, model.parameters[n].default) for n in simulator.names])
    values = np.repeat(centre[:, None], sets, axis=1)
    effects = [e for e in model.effects if e not in PAPER]
    for k in range(sets if present else 0):
        for effect in [effects[k % len(effects)]] if present == "one" else effects:
            for p in catalogue()[effect].parameters():
                if p.starts and not p.shape:
                    values[simulator.names.index(p.name), k] = p.starts[0]
    return values * (1 + scatter * np.random.default_rng(0).standard_normal(values.shape)), np.zeros(sets)


def kernels(drive: Drive, times: np.ndarray, runs: int, sets: int) -> list[dict[str, Any]]:
    """Measure every case with one and with two threads."""
    rows = []
    for label, base, effects, step in CASES:
        simulator = Simulator(base, effects, times, drive, step=step)
        steps = simulator.grid.steps.size
        for present in ("", "one", "all") if label == WHOLE else ("",):
            parameters, zeros = inputs(simulator, Model(base, effects), sets, 0.01, present)
            row: dict[str, Any] = {"base": base, "effects": label, "present": present or "core"}
            row |= {"parameters": len(simulator.names), "steps": steps}
            for threads in (1, 2):
                simulate.THREADS = threads
                seconds = median(lambda run=simulator, p=parameters, z=zeros: run(p, z, z), runs)
                row[f"ns_per_step_and_set_{threads}"] = 1e9 * seconds / (steps * sets)
            row["ms_per_set"] = 1e-6 * row["ns_per_step_and_set_2"] * steps
            rows.append(row)
    return rows


def growth(drive: Drive, times: np.ndarray, runs: int, sets: int) -> list[dict[str, Any]]:
    """Measure what more and more effects cost, in a kernel of the whole catalogue."""
    rows = []
    for base in ("constant_radius", "oscillator"):
        effects = every_effect(base)
        simulator = Simulator(base, effects, times, drive, step=0.02)
        model = Model(base, effects)
        core = inputs(simulator, model, sets, 0.01)[0]
        extra = [e for e in effects if e not in PAPER]
        work = {}
        for count in (0, 1, 2, 4, 8, 16, len(extra)):
            parameters = core.copy()
            for effect in extra[:count]:
                for p in catalogue()[effect].parameters():
                    if p.starts and not p.shape:
                        parameters[simulator.names.index(p.name)] = p.starts[0]
            work[str(3 + count)] = sums_of(simulator, parameters)
        simulate.THREADS = 1
        found = in_turn(work, runs, time.process_time)
        for count, seconds in found.items():
            rows.append(
                {
                    "base": base,
                    "effects present": int(count),
                    "ns_per_step_and_set": 1e9 * float(np.median(seconds)) / (simulator.grid.steps.size * sets),
                    "times_three_terms": float(np.median(seconds / found["3"])),
                }
            )
    return rows


def sums_of(simulator: Simulator, parameters: np.ndarray) -> Callable[[], object]:
    """Return a call that sums squares over all outputs; nothing is stored."""
    zeros = np.zeros(parameters.shape[1])
    asked = simulator.asked(parameters, zeros, zeros)
    return lambda: simulated([asked], stored=False)


def compiled(folder: str) -> ctypes.CDLL | str:
    """Return the loop in C, or why there is none."""
    compiler = shutil.which("cc")
    if compiler is None:
        return "no C compiler `cc` on this machine"
    library = Path(folder) / "three_terms.so"
    made = subprocess.run([compiler, *FLAGS, "-o", library, LOOP], capture_output=True, text=True, check=False)
    return made.stderr.strip() if made.returncode else ctypes.CDLL(str(library))


def beside_c(drive: Drive, times: np.ndarray, runs: int, sets: int) -> list[dict[str, Any]]:
    """Compare the three terms with a loop in C: one thread by processor time, two by the clock.

    ``steps``: the kernel reads only at the first and the last time; C adds up squares after every step, which is more.
    ``sums``: both add up squares at the ends of all steps; the kernel interpolates, which C need not. ``stored``: both
    store the angle there. The angle is what the oscillator reads; the arm reads x and y, so only its steps compare.
    """
    with tempfile.TemporaryDirectory() as folder:
        library = compiled(folder)
        if isinstance(library, str):
            return [{"left out": library}]
        grid = Simulator("oscillator", PAPER[:3], times, drive, step=0.02).grid
        ends, n = np.append(grid.times, times[-1]), grid.steps.size
        centre = np.array([[VALUES[name]] for name in ("xi", "alpha", "beta")])
        own = np.ascontiguousarray(centre * (1 + 0.01 * np.random.default_rng(0).standard_normal((3, sets))))
        motor, goal, sums = np.ascontiguousarray(grid.drive[:, :, 0]), np.zeros(n), np.empty(sets)
        out = np.empty((n, sets))
        blocks = sets // 32

        def c_loop(function: str, threads: int, *last: np.ndarray) -> Callable[[], object]:
            arrays = [a.ctypes.data_as(ctypes.c_void_p) for a in (grid.steps, motor, own, *last)]
            edges = np.linspace(0, blocks, threads + 1).astype(int)

            def part(first: int, end: int) -> None:
                getattr(library, function)(*map(ctypes.c_long, (first, end, sets, n)), *arrays)

            if threads == 1:
                return lambda: part(0, blocks)
            pool = ThreadPoolExecutor(threads - 1)

            def together() -> None:
                other = pool.submit(part, int(edges[1]), int(edges[2]))
                part(int(edges[0]), int(edges[1]))
                other.result()

            return together

        def stored(simulator: Simulator, parameters: np.ndarray) -> Callable[[], object]:
            zeros, shape = np.zeros(sets), (n + 1, 1)
            batch, misses = simulator.batch(parameters, zeros, zeros), Misses(0, np.zeros(shape), np.ones(shape))
            kept, added = np.empty((n + 1, 1, sets)), np.empty((2, sets))
            return lambda: simulator.run(batch, misses, kept, added, range(blocks))

        rows = []
        for what, base, at in (
            ("steps", "oscillator", times[[0, -1]]),
            ("steps", "constant_radius", times[[0, -1]]),
            ("sums", "oscillator", ends),
            ("stored", "oscillator", ends),
        ):
            simulator = Simulator(base, PAPER[:3], at, drive, step=0.02)
            parameters = inputs(simulator, Model(base, PAPER[:3]), sets, 0.01)[0]
            row: dict[str, Any] = {"what": what, "base": base}
            for threads in (1, 2):
                if what == "stored" and threads == 2:
                    row |= dict.fromkeys(("ns_2", "ns_c_2", "ratio_2"))
                    continue
                simulate.THREADS = threads
                ours = stored(simulator, parameters) if what == "stored" else sums_of(simulator, parameters)
                theirs = c_loop("stored", 1, out) if what == "stored" else c_loop("summed", threads, goal, sums)
                found = in_turn({"ours": ours, "c": theirs}, runs, (time.process_time, time.perf_counter)[threads - 1])
                row[f"ns_{threads}"] = 1e9 * float(np.median(found["ours"])) / (n * sets)
                row[f"ns_c_{threads}"] = 1e9 * float(np.median(found["c"])) / (n * sets)
                row[f"ratio_{threads}"] = float(np.median(found["ours"] / found["c"]))
            rows.append(row)
    return rows


def likelihoods(experiment: Experiment, runs: int, sets: int) -> list[dict[str, Any]]:
    """Measure chi-square of 3001 samples, both methods at about 1e-6 rad: evaluations a second."""
    drive, rig = experiment.drive, experiment.rig
    at = np.linspace(*experiment.recording.time[[0, -1]], 3001)
    motor = drive.evaluate(at)[0]
    rows = []
    for base, effects, channels in (
        ("oscillator", PAPER[:3], ("output",)),
        ("constant_radius", PAPER, ("tip_angle",)),
        ("constant_radius", PAPER, ("tip_x", "tip_y")),
    ):
        output = motor[:, None] if len(channels) == 1 else np.column_stack([np.cos(motor), np.sin(motor)])
        noise, units = np.full(len(channels), 3e-4), ("m",) * len(channels)
        recorded = Experiment(Recording("bench", at, motor, output, channels, units, noise, "", ""), drive, rig)
        work = {}
        for label, leap in (("order 4", None), ("order 8", 0.15)):
            bench = Bench(base, effects, [recorded], 0.0145, leap)
            parameters, _ = inputs(bench.simulators[0], Model(base, effects), sets, 0.01)
            work[label] = lambda b=bench, p=parameters: b.chi2(p, np.zeros((1, 2, sets)))
        found = {}
        for threads in (1, 2):
            simulate.THREADS = threads
            found[threads] = in_turn(work, runs, (time.process_time, time.perf_counter)[threads - 1])
        for label in work:
            row: dict[str, Any] = {"base": base, "channels": "+".join(channels), "steps": label}
            row |= {f"per_s_{t}_threads": sets / float(np.median(seconds[label])) for t, seconds in found.items()}
            rows.append(row)
    return rows


_FIRST_CALL = """
import sys, time
start = time.perf_counter()
import numpy as np
from discovery.simulation.simulate import Misses, Simulator
imported = time.perf_counter()
simulator = Simulator({base!r}, {effects!r}, np.linspace(0.0, 1.0, 11), None, step=0.05)
simulator(np.ones((len(simulator.names), 1)), np.zeros(1), np.zeros(1))
print(imported - start, time.perf_counter() - imported)
"""


def first_calls() -> list[dict[str, Any]]:
    """Time the first simulation in a fresh process, with an empty and with a filled cache of compiled code."""
    rows = []
    for label, base, effects, _ in CASES:
        with tempfile.TemporaryDirectory() as cache:
            code = _FIRST_CALL.format(base=base, effects=tuple(effects))
            seconds = []
            for _ in range(2):
                run = subprocess.run(
                    [sys.executable, "-c", code],
                    env={**os.environ, "DISCOVERY_CACHE": cache},
                    capture_output=True,
                    text=True,
                    check=True,
                )
                seconds.append(float(run.stdout.split()[1]))
        rows.append({"base": base, "effects": label, "cold_s": seconds[0], "warm_s": seconds[1]})
    return rows


# Peers: the paper's equation of the angle, integrated by others.


@njit
def scalar_rk4(steps, drive, xi, alpha, beta):
    """Integrate by classical Runge-Kutta, one parameter set, plain loop; drive (n, 3) at start, middle, end."""
    out = np.empty(steps.size + 1)
    theta, omega = drive[0, 0], 0.0
    out[0] = theta
    for n in range(steps.size):
        h = steps[n]
        d = theta - drive[n, 0]
        k1 = -xi * omega - alpha * d - beta * d * d * d
        w2 = omega + 0.5 * h * k1
        d = theta + 0.5 * h * omega - drive[n, 1]
        k2 = -xi * w2 - alpha * d - beta * d * d * d
        w3 = omega + 0.5 * h * k2
        d = theta + 0.5 * h * w2 - drive[n, 1]
        k3 = -xi * w3 - alpha * d - beta * d * d * d
        w4 = omega + h * k3
        d = theta + h * w3 - drive[n, 2]
        k4 = -xi * w4 - alpha * d - beta * d * d * d
        theta += h / 6 * (omega + 2 * w2 + 2 * w3 + w4)
        omega += h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        out[n + 1] = theta
    return out


def solved(drive: Drive, times: np.ndarray, method: str, rtol: float) -> np.ndarray:
    """Return theta_t [rad] from scipy, restarted where the drive changes its polynomial."""
    xi, alpha, beta = (VALUES[n] for n in ("xi", "alpha", "beta"))
    inner = drive.breakpoints[(drive.breakpoints > times[0]) & (drive.breakpoints < times[-1])]
    edges = np.concatenate([times[:1], inner, times[-1:]])
    state, out = tuple(drive.evaluate(times[:1])[:2, 0]), np.empty(times.size)
    for first, last in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
        piece = int(np.clip(np.searchsorted(drive.breakpoints, first, "right") - 1, 0, drive.coefficients.shape[1] - 1))
        powers, origin = drive.coefficients[:, piece].tolist(), float(drive.breakpoints[piece])

        def slope(t, z, powers=powers, origin=origin):
            motor = 0.0
            for c in powers:
                motor = motor * (t - origin) + c
            d = z[0] - motor
            return z[1], -xi * z[1] - alpha * d - beta * d * d * d

        inside = (times >= first) & (times <= last)
        at = np.unique(np.append(times[inside], last))
        path = solve_ivp(slope, (first, last), state, method=method, t_eval=at, rtol=rtol, atol=rtol)
        out[inside] = path.y[0][np.isin(at, times[inside])]
        state = tuple(path.y[:, -1])
    return out


def peers(drive: Drive, times: np.ndarray, runs: int, sets: int) -> list[dict[str, Any]]:
    """Compare the time of one trajectory at equal accuracy: at most the kernel's own error at a step of 0.02 s."""
    reference = solved(drive, times, "DOP853", 1e-12)
    simulator = Simulator("constant_radius", PAPER, times, drive, step=0.02)
    parameters, zeros = inputs(simulator, Model("constant_radius", PAPER), sets, 0.0)
    tip = simulator(parameters[:, :1], zeros[:1], zeros[:1])[:, :, 0]
    error = float(np.abs(np.unwrap(np.arctan2(tip[:, 1], tip[:, 0])) - reference).max())
    rows = []
    for threads in (1, 2):
        simulate.THREADS = threads
        seconds = median(lambda: simulator(parameters, zeros, zeros), runs) / sets
        rows.append({"solver": f"kernel, {sets} sets, {threads} threads", "ms": 1e3 * seconds, "error": error})
    grid = simulator.grid
    middle = np.ascontiguousarray(grid.drive[:, :, 0])
    edges = np.append(grid.times, grid.times[-1] + grid.steps[-1])
    arguments = (grid.steps, middle, VALUES["xi"], VALUES["alpha"], VALUES["beta"])
    own = scalar_rk4(*arguments)
    own_error = float(np.abs(own - solved(drive, edges, "DOP853", 1e-12)).max())
    rows.append(
        {
            "solver": "scalar loop, numba, same steps, no output between",
            "ms": 1e3 * median(lambda: scalar_rk4(*arguments), runs),
            "error": own_error,
        }
    )
    for method in ("DOP853", "LSODA"):
        for rtol in 10.0 ** -np.arange(5, 13, 0.5):
            found = float(np.abs(solved(drive, times, method, rtol) - reference).max())
            if found <= error:
                break
        seconds = median(lambda m=method, r=rtol: solved(drive, times, m, r), max(3, runs // 2))
        rows.append({"solver": f"scipy {method}, tolerance {rtol:.0e}", "ms": 1e3 * seconds, "error": found})
    return rows


def table(rows: list[dict[str, Any]]) -> None:
    """Print rows as a table."""
    cells = [[f"{v:.3g}" if isinstance(v, float) else str(v) for v in row.values()] for row in rows]
    head = list(rows[0])
    widths = [max(len(line[k]) for line in [head, *cells]) for k in range(len(head))]
    for line in [head, *cells]:
        print("  ".join(text.ljust(width) for text, width in zip(line, widths, strict=True)))
    print()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("--runs", type=int, default=7)
    parser.add_argument("--sets", type=int, default=256)
    options = parser.parse_args()
    (experiment,) = load_dataset(ARM / "rig.toml", [ARM / "train_large.csv"]).train
    drive, times = experiment.drive, experiment.recording.time
    found = {
        "machine": {"cpus": os.cpu_count(), "load": os.getloadavg()[0], "python": platform.python_version()},
        "kernels": kernels(drive, times, options.runs, options.sets),
        "beside_c": beside_c(drive, times, 3 * options.runs, 16 * options.sets),
        "growth": growth(drive, times, options.runs, options.sets),
        "likelihoods": likelihoods(experiment, options.runs, 16 * options.sets),
        "first_calls": first_calls(),
        "peers": peers(drive, times, options.runs, options.sets),
    }
    for name in ("kernels", "beside_c", "growth", "likelihoods", "first_calls", "peers"):
        print(name)
        table(found[name])
    options.out.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
