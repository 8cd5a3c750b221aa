"""What a solution of the elastica costs, in both directions, and what it is worth beside a boundary-value solver.

Usage: ``python benchmarks/elastica.py OUT.json [--runs 9] [--points 100000]``. Prints tables and writes the numbers as
JSON. Every time is the median of the runs, on one core; the solver's shapes are made in the same run.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from scipy.integrate import solve_bvp

from benchmarks.paper.theory.elastica.beam import shape_under_load, tip_under_load
from benchmarks.paper.theory.elastica.force_map import force_components, load_at_tip
from benchmarks.paper.theory.elastica.loads import FORCE_MAX
from benchmarks.paper.theory.elastica.polar import polar_compliance
from discovery.theory.elastica.static_law import perpendicular_law

#: Normalised forces of each domain, of every direction: those of an arm in motion, and all.
DOMAINS = {"arm": (0.1, 50.0), "whole": (0.01, FORCE_MAX)}
SOLVED = 40


def median(work: Callable[[], object], runs: int) -> float:
    """Return the median time of a call [s], after one that is not counted."""
    work()
    found = []
    for _ in range(runs):
        start = time.perf_counter()
        work()
        found.append(time.perf_counter() - start)
    return float(np.median(found))


def loads(domain: str, points: int) -> tuple[np.ndarray, np.ndarray]:
    """Return forces, equally spread in their logarithm, and directions."""
    rng = np.random.default_rng(0)
    low, high = np.log(DOMAINS[domain])
    return np.exp(rng.uniform(low, high, points)), rng.uniform(-np.pi, np.pi, points)


def maps(domain: str, points: int, runs: int) -> list[dict[str, Any]]:
    """Time the maps, and send positions through the inverse and back."""
    force, direction = loads(domain, points)
    tip = tip_under_load(force, direction)
    bent = np.abs(tip.angle) > 1e-3
    force, direction, rho, delta = force[bent], direction[bent], tip.radius[bent], tip.angle[bent]
    across = delta[np.abs(delta) < np.pi / 2]
    held = tip_under_load(*load_at_tip(rho, delta))
    found, angle = force_components(rho, delta), direction - delta
    radial, tangential = np.abs(found.radial - force * np.cos(angle)), np.abs(found.tangential - force * np.sin(angle))
    errors = {
        "force to tip": {},
        "tip to force": {
            "rho": np.max(np.abs(held.radius - rho)),
            "delta": np.max(np.abs(held.angle - delta)),
            "F_r, median": np.median(radial / force),
            "F_t, median": np.median(tangential / force),
            # Over what rounding of the radius leaves undetermined.
            "F_r, worst over rounding": np.max(radial / (8.0 + np.abs(found.radial)) * (1.0 - rho)) / 2.0**-53,
        },
    }
    rows = []
    for label, size, work in (
        ("force to tip", force.size, lambda: tip_under_load(force, direction)),
        ("tip to force", rho.size, lambda: load_at_tip(rho, delta)),
        ("tip to components", rho.size, lambda: force_components(rho, delta)),
        ("force to compliance", force.size, lambda: polar_compliance(force, direction)),
        ("deflection to force across", across.size, lambda: perpendicular_law(across)),
    ):
        error = {name: float(value) for name, value in errors.get(label, {}).items()}
        rows.append(
            {"map": label, "domain": domain, "per_second": size / median(work, runs), "errors": error or "reference"}
        )
    return rows


def solved(force: np.ndarray, direction: np.ndarray, tol: float) -> list[dict[str, Any]]:
    """Time the boundary-value solver on eq. (5), forward and with the force as unknown, from a neighbouring shape."""
    s = np.linspace(0.0, 1.0, 21)

    def equation(_: np.ndarray, u: np.ndarray, load: np.ndarray) -> np.ndarray:
        return np.vstack([u[1], load[0] * np.sin(u[0]) - load[1] * np.cos(u[0]), np.cos(u[0]), np.sin(u[0])])

    seconds, errors = {"force to tip": 0.0, "tip to force": 0.0}, {"force to tip": 0.0, "tip to force": 0.0}
    tips = tip_under_load(force, direction)
    for k in range(force.size):
        load = force[k] * np.array([np.cos(direction[k]), np.sin(direction[k])])
        tip = np.array([tips.x[k], tips.y[k]])
        near = shape_under_load(0.9 * force[k], 0.98 * direction[k], s)
        guess = np.vstack([near.slope, np.gradient(near.slope, s), near.x, near.y])
        start = time.perf_counter()
        forward = solve_bvp(
            lambda t, u, load=load: equation(t, u, load),
            lambda a, b: np.array([a[0], b[1], a[2], a[3]]),
            s,
            guess,
            tol=tol,
        )
        seconds["force to tip"] += time.perf_counter() - start
        errors["force to tip"] = max(errors["force to tip"], float(np.max(np.abs(forward.y[2:, -1] - tip))))
        start = time.perf_counter()
        inverse = solve_bvp(
            equation,
            lambda a, b, _, tip=tip: np.array([a[0], b[1], a[2], a[3], b[2] - tip[0], b[3] - tip[1]]),
            s,
            guess,
            p=0.9 * load,
            tol=tol,
        )
        seconds["tip to force"] += time.perf_counter() - start
        missed = float(np.max(np.abs(inverse.p - load))) / force[k]
        errors["tip to force"] = max(errors["tip to force"], missed)
    return [
        {"map": label, "tolerance": tol, "per_second": force.size / seconds[label], "largest_error": errors[label]}
        for label in seconds
    ]


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
    parser.add_argument("--runs", type=int, default=9)
    parser.add_argument("--points", type=int, default=100_000)
    options = parser.parse_args()
    own = [row for domain in DOMAINS for row in maps(domain, options.points, options.runs)]
    force, direction = loads("arm", 3 * SOLVED)
    # The solver needs a start that is near: directions next to compression are left out.
    easy = np.flatnonzero(np.abs(direction) < 2.8)[:SOLVED]
    peers = [row for tol in (1e-3, 1e-8) for row in solved(force[easy], direction[easy], tol)]
    speed = {row["map"]: row["per_second"] for row in own if row["domain"] == "arm"}
    for row in peers:
        row["elastica_is_faster_by"] = speed[row["map"]] / row["per_second"]
    found = {
        "machine": {"cpus": os.cpu_count(), "load": os.getloadavg()[0], "python": platform.python_version()},
        "maps": own,
        "boundary_value_solver": peers,
    }
    table([{k: v for k, v in row.items() if k != "errors"} for row in own])
    table(
        [
            {"map": row["map"], "domain": row["domain"], **row["errors"]}
            for row in own
            if isinstance(row["errors"], dict)
        ]
    )
    table(peers)
    options.out.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
