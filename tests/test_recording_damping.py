"""Recordings of one system whose friction changed between them: a bearing that warms up."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from discovery import close_loop, load_dataset
from discovery.runs.loop_result import LoopResult

_NOISE = 1e-3
_RIG = """
name = "pendulum"
kind = "pendulum"
[columns]
time = { name = "t", unit = "s" }
output = { name = "angle", unit = "rad", noise = 1e-3 }
[model]
effects = ["viscous_damping", "gravity_torque"]
[records]
train = [{ file = "0.csv" }, { file = "1.csv" }]
holdout = [{ file = "2.csv" }]
"""


def found_of(folder: Path, damping: tuple[float, float, float]) -> LoopResult:
    """Return the loop's answer to swings with these dampings [1/s], the last one held out."""
    time, rng = np.arange(0.0, 30.0, 0.02), np.random.default_rng(5)
    for i, xi in enumerate(damping):

        def fall(_: float, y: np.ndarray, xi: float = xi) -> list[float]:
            return [y[1], -xi * y[1] - 36.0 * np.sin(y[0])]

        swing = solve_ivp(fall, (0.0, 30.0), [1.2, 0.0], method="LSODA", t_eval=time, rtol=1e-9, atol=1e-9).y[0]
        table = np.column_stack([time, swing + rng.normal(0.0, _NOISE, time.size)])
        np.savetxt(folder / f"{i}.csv", table, "%.7g", ",", header="t,angle", comments="")
    (folder / "rig.toml").write_text(_RIG)
    return close_loop(load_dataset(folder / "rig.toml"))


def test_a_damping_that_differs_between_recordings_is_named_and_told_in_each(tmp_path: Path) -> None:
    found = found_of(tmp_path, (0.05, 0.065, 0.058))
    assert found.added == ("recording_damping",)
    assert found.verdict == "explained"
    after, of_second = found.after, "xi_r_0_init[1]"
    assert after.values["xi_1"] == pytest.approx(0.05, abs=4 * after.sd["xi_1"])
    assert after.values[of_second] == pytest.approx(0.015, abs=4 * after.sd[of_second])


def test_recordings_of_one_damping_are_not_told_apart(tmp_path: Path) -> None:
    assert found_of(tmp_path, (0.05, 0.05, 0.05)).added == ()
