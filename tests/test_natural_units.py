"""Sizes of forces: those of the motion, or of a recorded force that is larger."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from discovery.declarations.registry import get_effect
from discovery.estimation.natural_units import NaturalUnits, natural_units
from discovery.recordings.dataset import load_dataset
from discovery.runs.loop import close_loop

UNITS = NaturalUnits(time=0.5, coordinate=0.1, length=1.0, drive=4.0)
FORCE = get_effect("coulomb_friction").parameters()[0]
SPEED = get_effect("coulomb_friction").parameters()[1]
RIG = """
name = "a carriage in oil"
kind = "drive"
[columns]
time = { name = "t", unit = "s" }
input = { name = "force", unit = "N" }
output = { name = "x", unit = "mm", noise = 0.3 }
[model]
effects = ["viscous_damping"]
"""


def test_forces_are_as_large_as_a_recorded_one_where_that_is_larger() -> None:
    # The motion asks for accelerations of 0.1 / 0.5^2; a gain of two makes 8 of a force of 4.
    assert UNITS.scale(FORCE) == pytest.approx(0.4)
    assert UNITS.pushed(2.0).scale(FORCE) == pytest.approx(8.0)
    assert UNITS.pushed(-2.0) == UNITS.pushed(2.0)
    # Speeds stay those of the motion, and so does all where the force is smaller or there is none.
    assert UNITS.pushed(2.0).scale(SPEED) == UNITS.scale(SPEED)
    assert UNITS.pushed(0.05) is UNITS
    assert UNITS.pushed(0.0) is UNITS


@pytest.mark.parametrize(("low", "reach"), [(-0.2, 0.2), (0.0, 0.1), (-0.1, 0.15)])
def test_a_motion_to_one_side_travels_half_as_far(tmp_path: Path, low: float, reach: float) -> None:
    time = np.arange(0.0, 9.0, 0.01)
    way = low + (0.2 - low) * (1 - np.cos(time)) / 2
    table = np.column_stack([time, np.cos(time), 1e3 * way])
    np.savetxt(tmp_path / "a.csv", table, delimiter=",", header="t,force,x", comments="")
    (tmp_path / "rig.toml").write_text(RIG, encoding="utf-8")
    train = load_dataset(tmp_path / "rig.toml", [tmp_path / "a.csv"]).train
    assert natural_units(train).reach("") == pytest.approx(reach, rel=0.01)


@pytest.mark.slow
def test_a_hum_of_a_quarter_of_the_drive_is_found_on_a_damped_one(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    time = np.arange(0.0, 9.0, 0.0113)
    for name, seed in (("a", 1), ("b", 2), ("h", 3)):
        jumps = np.random.default_rng(seed).uniform(-4.4, 4.4, 12)

        def force(t, jumps=jumps):
            return np.interp(t, np.linspace(0.0, 9.0, 12), jumps)

        def slopes(t, y, force=force, phase=seed):
            return [y[1], 2.4 * force(t) - 11.5 * y[1] + 2.46 * np.sin(21.9 * t + phase)]

        x = solve_ivp(slopes, (0.0, 9.0), (0.0, 0.0), t_eval=time, rtol=1e-8, atol=1e-10, max_step=0.05).y[0]
        rows = np.column_stack([time, force(time), 1e3 * x + 0.3 * rng.standard_normal(time.size)])
        np.savetxt(tmp_path / f"{name}.csv", rows, delimiter=",", header="t,force,x", comments="", fmt="%.9g")
    (tmp_path / "rig.toml").write_text(RIG)
    train, holdout = [tmp_path / "a.csv", tmp_path / "b.csv"], tmp_path / "h.csv"
    found = close_loop(load_dataset(tmp_path / "rig.toml", train, holdout))
    assert found.added == ("periodic_disturbance",)
    values = found.after.values
    assert np.hypot(values["a_s"], values["a_c"]) == pytest.approx(2.46, rel=0.05)
    assert values["Omega"] == pytest.approx(21.9, rel=1e-3)
