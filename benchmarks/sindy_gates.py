"""How often SINDy finds the right structure: the paper's own model, and the twin.

Usage: ``python benchmarks/sindy_gates.py OUT.json [--seeds 100]``. Prints a table and writes the numbers as JSON.
"""

from __future__ import annotations

import argparse
import json
import time
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pysindy
from discovery_datasets.manoeuvres import trapezoid
from discovery_datasets.recordings import make_motion
from discovery_datasets.twin import record
from scipy.integrate import solve_ivp

from discovery.foundation.arrays import FloatArray
from discovery.recordings.recording import Recording
from discovery.recordings.smooth_input import build_drive
from discovery.rigs.rig import Rig
from discovery.rigs.rig_file import read_rig
from discovery.signals.motion import Motion, motion_of
from discovery.sindy.radius import discover_radius
from discovery.sindy.sindy import discover

PAPER = {"xi": 0.0458, "alpha": 8.7907, "beta": 0.5139, "gamma": 0.4462}
STRUCTURE = frozenset({"theta_t'", "delta", "delta^3"})
ELASTICA_GAMMA = 0.4428  # least squares of the static elastica to 0.85 rad
RIG = Path(__file__).parents[1] / "datasets" / "arm" / "rig.toml"


def paper_motion(rate: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Time, motor angle and tip angle of the paper's model in a move of 1 rad, from an integrator of its own."""
    manoeuvre, t = trapezoid(1.0, rate), np.arange(2501) / 100.0

    def right(time: float, z: FloatArray) -> list[float]:
        delta = z[0] - float(manoeuvre(time)[0])
        return [z[1], -PAPER["xi"] * z[1] - PAPER["alpha"] * delta - PAPER["beta"] * delta**3]

    z = solve_ivp(right, (0.0, 25.0), [0.0, 0.0], t_eval=t, rtol=1e-10, atol=1e-12, max_step=0.02).y
    return t, manoeuvre(t)[0], z[0]


def recording(t: FloatArray, motor: FloatArray, x: FloatArray, y: FloatArray, noise: float) -> Recording:
    return Recording(
        name="simulated",
        time=t,
        input=motor,
        output=np.column_stack([x, y]),
        channels=("tip_x", "tip_y"),
        units=("m", "m"),
        noise=np.array([noise, noise]),
        sha256="",
        source="simulated",
    )


def paper_maker(noise: float, rig: Rig) -> Callable[[np.random.Generator], list[Motion]]:
    clean = [paper_motion(rate) for rate in (1.0, 1.4)]

    def make(rng: np.random.Generator) -> list[Motion]:
        motions = []
        for t, motor, theta in clean:
            rho = np.cos(PAPER["gamma"] * (theta - motor))
            x, y = (rho * f(theta) + noise * rng.standard_normal(t.size) for f in (np.cos, np.sin))
            seen = recording(t, motor + rng.uniform(-7e-5, 7e-5, t.size), x, y, noise)
            motions.append(motion_of(seen, rig, build_drive(seen, rig)))
        return motions

    return make


def twin_maker(rig: Rig) -> Callable[[np.random.Generator], list[Motion]]:
    clean = [make_motion(name) for name in ("train_paper", "train_large")]

    def make(rng: np.random.Generator) -> list[Motion]:
        motions = []
        for motion in clean:
            frame = record(motion, rng=rng)
            t, motor, x, y = (frame[name].to_numpy(float) for name in frame.columns[:4])
            seen = recording(t, motor, x, y, 3e-4)
            motions.append(motion_of(seen, rig, build_drive(seen, rig)))
        return motions

    return make


def default_pysindy(motions: Sequence[Motion]) -> tuple[tuple[str, ...], ...]:
    """Terms that pysindy finds at its defaults, for comparison: STLSQ with threshold 0.1 and finite differences.

    Returns
    -------
    tuple of tuple of str
        Terms of theta_t'' (of q'') on each recording, with a cubic library in the deflection and the rate.
    """
    found = []
    for motion in motions:
        track = motion.coordinate
        names = ["delta", "theta_t'"] if motion.system.has_rod else ["q", "q'"]
        difference = pysindy.FiniteDifference()
        rate = difference(track.observed[:, None], track.time)
        base = track.q - motion.state(track.time).delta
        x = np.column_stack([track.observed - base, rate])
        x_dot = np.column_stack([rate, difference(np.asarray(rate), track.time)])
        model = pysindy.SINDy(feature_library=pysindy.PolynomialLibrary(degree=3))
        model.fit(x, t=track.time, x_dot=x_dot, feature_names=names)
        terms = zip(model.get_feature_names(), model.coefficients()[1], strict=True)
        found.append(tuple(name for name, coefficient in terms if coefficient != 0.0))
    return tuple(found)


def study(make: Callable[[np.random.Generator], list[Motion]], seeds: int) -> dict[str, object]:
    chosen: Counter[str] = Counter()
    three: Counter[str] = Counter()
    probability, gammas, plain, seconds = [], [], 0, 0.0
    for seed in range(seeds):
        rng = np.random.default_rng([2024, seed])
        motions = make(rng)
        start = time.perf_counter()
        found = discover(motions, rng=rng)
        seconds += time.perf_counter() - start
        chosen[", ".join(found.equation.terms)] += 1
        best = found.best(3)
        three[", ".join(best.terms)] += 1
        probability.append(best.probability)
        radius = discover_radius(motions, rng=rng)
        gammas.append((radius.gamma, *radius.interval))
        plain += any(frozenset(terms) == STRUCTURE for terms in default_pysindy(motions))
    exact = sum(n for terms, n in chosen.items() if frozenset(terms.split(", ")) == STRUCTURE)
    best_three = sum(n for terms, n in three.items() if frozenset(terms.split(", ")) == STRUCTURE)
    return {
        "seeds": seeds,
        "exact_structure": exact,
        "best_three_terms": best_three,
        "median_probability_of_three_terms": float(np.median(probability)),
        "plain_pysindy_exact": plain,
        "gamma_median": float(np.median([g[0] for g in gammas])),
        "gamma_interval_median": [float(np.median([g[i] for g in gammas])) for i in (1, 2)],
        "elastica_gamma_inside": sum(g[1] <= ELASTICA_GAMMA <= g[2] for g in gammas),
        "paper_gamma_inside": sum(g[1] <= PAPER["gamma"] <= g[2] for g in gammas),
        "seconds_each": seconds / seeds,
        "chosen": dict(chosen.most_common(5)),
        "three_terms": dict(three.most_common(5)),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--seeds", type=int, default=100)
    arguments = parser.parse_args()
    rig = read_rig(RIG)
    cases = {f"paper's model, {1e3 * s:g} mm": paper_maker(s, rig) for s in (3e-4, 1e-3, 3e-3)}
    cases["twin, 0.3 mm"] = twin_maker(rig)
    results = {}
    print(f"{'case':24} {'exact':>6} {'best 3':>7} {'plain pysindy':>14} {'gamma (95 %)':>28} {'s each':>7}")
    for name, make in cases.items():
        r = results[name] = study(make, arguments.seeds)
        low, high = r["gamma_interval_median"]  # type: ignore[misc]
        gamma = f"{r['gamma_median']:.4f} ({low:.4f} to {high:.4f})"
        print(
            f"{name:24} {r['exact_structure']:>6} {r['best_three_terms']:>7} {r['plain_pysindy_exact']:>14} "
            f"{gamma:>28} {r['seconds_each']:>7.2f}"
        )
    beside = arguments.out.with_suffix(".partial")
    beside.write_text(json.dumps(results, indent=2) + "\n")
    beside.replace(arguments.out)


if __name__ == "__main__":
    main()
