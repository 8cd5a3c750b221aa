"""Small rigs of one population: oscillators that are fully described by what their rig file declares."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

RIG = """name = "oscillator"
kind = "oscillator"
[columns]
time = { name = "t", unit = "s" }
output = { name = "x", unit = "mm", noise = 0.02 }
[model]
effects = ["viscous_damping", "linear_stiffness"]
[records]
train = [{ file = "high.csv" }]
holdout = [{ file = "low.csv" }]
"""
#: Angular frequency [rad/s], and part by which it differs between the rigs; decay [1/s]; noise [mm].
FREQUENCY, SPREAD, DECAY, NOISE = 6.0, 0.02, 0.1, 0.02


def write(folder: Path, seed: int) -> None:
    """Write a rig of the population, a free decay to train on and one that is held out."""
    rng = np.random.default_rng(seed)
    folder.mkdir(parents=True, exist_ok=True)
    frequency = FREQUENCY * np.exp(SPREAD * rng.standard_normal())
    for name, size in (("high", 3.0), ("low", 2.0)):
        t = np.arange(150) / 25
        x = size * np.exp(-DECAY * t) * np.cos(frequency * t) + NOISE * rng.standard_normal(t.size)
        pd.DataFrame({"t": t, "x": x}).to_csv(folder / f"{name}.csv", index=False)
    (folder / "rig.toml").write_text(RIG, encoding="utf-8")
