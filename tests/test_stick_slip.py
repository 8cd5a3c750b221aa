"""Dry friction that sticks, simulated from event to event: no smooth law does what it does."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pytest

from benchmarks.growth.recordings import swelling
from benchmarks.growth.stick_slip import stick_slip
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
MASS, DRY = 1.7, 0.6


@pytest.mark.slow
def test_friction_that_is_the_same_at_rest_is_told_as_coulombs(tmp_path: Path) -> None:
    """A body that rests creeps in the law of Coulomb, by less than laws idealise; Stribeck's bump creeps less."""
    time = np.arange(0.0, 20.0, 0.01)
    for seed, name in enumerate(("train", "holdout")):
        rng = np.random.default_rng(seed)
        frequency, phase = 2 * np.pi * rng.uniform(0.3, 6.0, 9), rng.uniform(0.0, 2 * np.pi, 9)
        size = 6.0 * rng.uniform(0.3, 1.0, 9) * np.sqrt(2 / 9)
        force = partial(swelling, size=size, frequency=frequency, phase=phase)
        moved = stick_slip(force, time, mass=MASS, stiffness=410.0, loss=0.35, dry=DRY)
        table = np.column_stack([time, force(time), 1e3 * moved + rng.normal(0.0, 0.016, time.size)])
        np.savetxt(tmp_path / f"{name}.csv", table, "%.7g", ",", header="t,u,y", comments="")
    (tmp_path / "rig.toml").write_text(RIG)
    found = close_loop(load_dataset(tmp_path / "rig.toml"))
    assert found.added == ("coulomb_friction",)
    assert found.verdict == "explained"
    assert found.after.values["f_c"] == pytest.approx(DRY / MASS, rel=2e-3)
