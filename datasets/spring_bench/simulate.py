"""Simulate the recordings of this folder: ``python datasets/spring_bench/simulate.py FOLDER``.

The equation is written out and solved by scipy; nothing here is shared with what identifies it.
"""

import sys
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

MASS, STIFFNESS, DAMPING, FRICTION = 0.5, 200.0, 0.08, 0.06  # kg, N/m, N s/m, N
STANDSTILL = 1e-5  # m/s: below it the friction is not at its full size
RELEASES = {"train_high.csv": 40.0, "train_low.csv": 15.0, "holdout.csv": 28.0}  # mm
NOISE = 0.05  # mm


def motion(_: float, state: np.ndarray) -> tuple[float, float]:
    """Return rate and acceleration of the slider."""
    x, rate = state
    force = -STIFFNESS * x - DAMPING * rate - FRICTION * np.tanh(rate / STANDSTILL)
    return rate, force / MASS


def main(folder: Path) -> None:
    """Write the recordings."""
    random = np.random.default_rng(20250)
    time = np.arange(800) / 200
    for name, release in RELEASES.items():
        start = (1e-3 * release, 0.0)
        exact = solve_ivp(motion, (0, time[-1]), start, "LSODA", time, rtol=1e-9, atol=1e-12).y[0]
        read = 1e3 * exact + random.normal(0, NOISE, time.size)
        np.savetxt(folder / name, np.column_stack([time, read]), "%.3f", ",", header="time_s,position_mm", comments="")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
