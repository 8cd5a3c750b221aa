"""A zero that drifts far beyond what is usual, beside a force that comes and goes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from discovery import close_loop, load_dataset

#: Of the amplitude, in a natural time: 27 times the scale of the prior.
DRIFT = 0.008
RIG = """name = "balance"
kind = "oscillator"

[columns]
time = { name = "t", unit = "s" }
output = { name = "x", unit = "m", noise = 0.01 }

[model]
effects = ["viscous_damping", "linear_stiffness", "zero_drift"]

[records]
train = [{ file = "a.csv" }]
"""


def test_a_declared_drift_is_not_held_at_what_is_usual(tmp_path: Path) -> None:
    """What drifts was left to the model error, under which nothing else was found either."""
    time, rng = np.arange(0.0, 40.0, 0.2), np.random.default_rng(5)
    swing = np.exp(-0.02 * time) * np.cos(time) + 0.02 * np.sin(2.37 * time + 1.0)
    read = swing + DRIFT * time + rng.normal(0.0, 0.01, time.size)
    pd.DataFrame({"t": time, "x": read}).to_csv(tmp_path / "a.csv", index=False)
    (tmp_path / "rig.toml").write_text(RIG, encoding="utf-8")
    found = close_loop(load_dataset(tmp_path / "rig.toml"))
    assert found.before.values["z_t"] == pytest.approx(DRIFT, rel=0.05)
    assert list(found.added) == ["periodic_disturbance"]
    assert found.verdict == "explained"
    assert found.errors["after"]["holdout"]["rms"] < 0.015
