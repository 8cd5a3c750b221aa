"""A motor that turns one way in each recording: its dry friction looks like another force in each."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from discovery import close_loop, load_dataset

GAIN, LAG, DRY, BIAS = 4.0, 0.4, 14.0, -2.0  # rad/s a volt, s, rad/s^2, rad/s^2
RIG = """
name = "motor"
kind = "system"
[system]
like = "dc_motor"
[system.constants]
torque_constant = { guess = 0.3, unit = "N m / A" }
resistance = { value = 1.0, unit = "ohm" }
inertia = { guess = 0.03, unit = "kg m^2" }
loss = { value = 0.0, unit = "N m s" }
[columns]
time = { name = "t", unit = "s" }
input = { name = "u", unit = "V", interpolation = "linear" }
output = { name = "speed", unit = "rad/s" }
[records]
train = [{ file = "up.csv" }, { file = "back.csv" }]
holdout = [{ file = "on.csv" }]
"""


def record(path: Path, seed: int, volts: tuple[float, ...]) -> None:
    """Write a run through levels of the voltage, each reached within 0.3 s and held for 1.2 s."""
    ends = np.cumsum([0.0, *[e for _ in volts for e in (0.3, 1.2)]])
    levels = np.repeat(volts, 2)
    time = np.arange(0.0, ends[-1], 0.01)

    def given(t: float) -> float:
        return float(np.interp(t, ends, [volts[0], *levels]))

    def slope(t: float, speed: np.ndarray) -> list[float]:
        return [(GAIN * given(t) - speed[0]) / LAG - DRY * np.tanh(speed[0] / 0.05) + BIAS]

    still = GAIN * volts[0] - LAG * (DRY * np.sign(volts[0]) - BIAS)
    found = solve_ivp(slope, (0.0, time[-1]), [still], "LSODA", time, rtol=1e-8, atol=1e-9, max_step=0.01).y[0]
    noisy = found + np.random.default_rng(seed).normal(0, 0.05, time.size)
    read = np.column_stack([time, [given(t) for t in time], noisy])
    np.savetxt(path, read, "%.6g", ",", header="t,u,speed", comments="")


@pytest.mark.slow
def test_friction_and_bias_are_told_and_no_force_of_each_run(tmp_path: Path) -> None:
    record(tmp_path / "up.csv", 1, (4.0, 6.0, 5.0, 8.0))
    record(tmp_path / "back.csv", 2, (-4.0, -7.0, -5.0))
    record(tmp_path / "on.csv", 3, (5.0, 7.0, 4.0))
    (tmp_path / "rig.toml").write_text(RIG)
    found = close_loop(load_dataset(tmp_path / "rig.toml"))
    # What never stops does not tell a dead zone of its amplifier from dry friction.
    (friction,) = {*found.added} - {"constant_force_at_shaft"}
    assert "coulomb_friction_at_shaft" in (friction, *found.ambiguous[friction])
    values = found.after.values
    assert values["f_0_shaft"] / values["inertia"] == pytest.approx(BIAS, rel=0.05)
    assert found.errors["after"]["holdout"]["rms"] < 1.1 * 0.05
