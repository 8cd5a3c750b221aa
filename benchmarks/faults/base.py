"""The sound case that every other one changes: films of a pendulum, the drag of which the rig file does not declare."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.integrate import solve_ivp

LENGTH, GRAVITY, DRAG, NOISE = 0.8, 9.80665, 0.0425, 0.2
RIG = f"""name = "a pendulum on film"
kind = "pendulum"
length_m = {{ value = {LENGTH}, sd = 0.002 }}

[columns]
time = {{ name = "t_s", unit = "s" }}
output = {{ name = "angle_deg", unit = "deg", noise = {NOISE} }}

[records]
train = [{{ file = "high.csv" }}, {{ file = "low.csv" }}]
holdout = [{{ file = "middle.csv" }}]
"""


def film(start: float, seed: int, rate: float = 30.0, seconds: float = 20.0) -> pd.DataFrame:
    """Return a film of the pendulum let go at an angle [deg]: times [s], and angles [deg] with noise."""
    time = np.arange(round(rate * seconds)) / rate
    motion = solve_ivp(
        lambda _, y: (y[1], -GRAVITY / LENGTH * np.sin(y[0]) - DRAG * y[1] * abs(y[1]) - 0.02 * y[1]),
        (0.0, time[-1]), (np.radians(start), 0.0), t_eval=time, rtol=1e-9, atol=1e-10,
    )  # fmt: skip
    angle = np.degrees(motion.y[0]) + NOISE * np.random.default_rng(seed).standard_normal(time.size)
    return pd.DataFrame({"t_s": time.round(4), "angle_deg": angle.round(4)})


@cache
def _text(start: float, seed: int) -> str:
    return film(start, seed).to_csv(index=False)


def write(folder: Path, seed: int = 0) -> Path:
    """Write the sound case into a folder, and return its rig file; another seed is other noise."""
    for name, start in (("high", 60.0), ("low", 15.0), ("middle", 35.0)):
        (folder / f"{name}.csv").write_text(_text(start, 100 * seed + round(start)), encoding="utf-8")
    (folder / "rig.toml").write_text(RIG, encoding="utf-8")
    return folder / "rig.toml"
