"""A force that never changes: where it is sought, and that an imbalance of a free drive is found."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from discovery.equations.lacking import candidates
from discovery.equations.model import Model
from discovery.recordings.dataset import load_dataset
from discovery.runs.loop import close_loop

RIG = """
name = "spindle with an imbalance"
kind = "drive"
inertia_kg_m2 = { value = 0.002, sd = 4e-5 }
[columns]
time = { name = "t", unit = "s" }
input = { name = "torque", unit = "N m" }
output = { name = "angle", unit = "rad", noise = 5e-4 }
[model]
effects = ["viscous_damping"]
"""


def test_it_is_sought_where_nothing_ties_the_body() -> None:
    bases = ("oscillator", "servo", "inverse_dynamics", "base_excited", "moving_pivot", "falling_body")
    assert {b for b in bases if "constant_force" in candidates(Model(b, ("viscous_damping",)))} == {*bases[:3]}
    for tie in ("linear_stiffness", "gravity_torque"):
        tied = Model("oscillator", ("viscous_damping", tie))
        assert "constant_force" not in candidates(tied)
        # What the loop has added is a guess of it.
        assert "constant_force" in candidates(tied, declared=("viscous_damping",))
        # With a controller's command, or a force that is read, it is no other rest position.
        assert "constant_force" in candidates(tied.on_base("servo"))


@pytest.mark.slow
def test_an_imbalance_is_found_by_its_torque(tmp_path: Path) -> None:
    rng = np.random.default_rng(4)
    time = np.arange(0.0, 10.0, 0.01)
    for name, sizes in (("a", (0.02, 0.013)), ("b", (0.015, 0.02)), ("h", (0.017, 0.016))):

        def torque(t, sizes=sizes):
            return sizes[0] * np.sin(2.1 * t) + sizes[1] * np.sin(5.3 * t + 0.4)

        def slopes(t, y, torque=torque):
            return [y[1], (torque(t) + 0.004 - 1e-3 * y[1]) / 0.002]

        angle = solve_ivp(slopes, (0.0, 10.0), (0.0, 0.0), t_eval=time, rtol=1e-9, atol=1e-11).y[0]
        rows = np.column_stack([time, torque(time), angle + 5e-4 * rng.standard_normal(time.size)])
        np.savetxt(tmp_path / f"{name}.csv", rows, delimiter=",", header="t,torque,angle", comments="", fmt="%.9g")
    (tmp_path / "rig.toml").write_text(RIG)
    found = close_loop(
        load_dataset(tmp_path / "rig.toml", [tmp_path / "a.csv", tmp_path / "b.csv"], tmp_path / "h.csv")
    )
    assert (found.verdict, found.added) == ("explained", ("constant_force",))
    assert found.after.values["f_0"] * 0.002 == pytest.approx(0.004, rel=2e-3)
