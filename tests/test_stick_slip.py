"""Dry friction that sticks, simulated from event to event: no smooth law does what it does."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks.growth.recordings import DRY, MASS, stuck
from discovery import close_loop, load_dataset

RIG = """
name = "spring bench"
kind = "oscillator"
[columns]
time = { name = "t", unit = "s" }
input = { name = "u", unit = "N" }
output = { name = "y", unit = "mm", noise = 0.016 }
[model]
effects = ["viscous_damping", "linear_stiffness"]
[records]
train = [{ file = "train.csv" }]
holdout = [{ file = "holdout.csv" }]
"""


@pytest.mark.slow
def test_friction_that_is_the_same_at_rest_is_told_as_coulombs(tmp_path: Path) -> None:
    """A body that rests creeps in the law of Coulomb, by less than laws idealise; Stribeck's bump creeps less."""
    time = np.arange(0.0, 20.0, 0.01)
    for seed, name in enumerate(("train", "holdout")):
        rng = np.random.default_rng(seed)
        force, moved = stuck(time, rng)
        table = np.column_stack([time, force, 1e3 * moved + rng.normal(0.0, 0.016, time.size)])
        np.savetxt(tmp_path / f"{name}.csv", table, "%.7g", ",", header="t,u,y", comments="")
    (tmp_path / "rig.toml").write_text(RIG)
    found = close_loop(load_dataset(tmp_path / "rig.toml"))
    assert found.added == ("coulomb_friction",)
    assert found.verdict == "explained"
    assert found.after.values["f_c"] == pytest.approx(DRY / MASS, rel=2e-3)
