"""A limit of a drive is found from where it acts, and tied with what does the same where one recording cannot tell."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import solve_ivp

from discovery import close_loop, load_dataset

MOTOR = """name = "motor"
kind = "system"

[system]
coordinates = { angle = "rad" }
input = { drive = "1" }
kinetic = "inertia*dot(angle)^2/2"
dissipation = "damping*dot(angle)^2/2"
forces = { angle = "gain*drive" }
output = "dot(angle)"
places = { body = "angle" }

[system.constants]
inertia = { value = 1.0, unit = "kg m^2" }
damping = { guess = 1.0, unit = "N m s / rad" }
gain = { guess = 0.1, unit = "N m" }

[columns]
time = { name = "t", unit = "s" }
input = { name = "pwm", unit = "1", interpolation = "hold" }
output = { name = "speed", unit = "rad/s", noise = 0.1 }

[records]
train = [{ file = "a.csv" }]
"""
PAN = """name = "pan"
kind = "drive"

[columns]
time = { name = "t", unit = "s" }
input = { name = "effort", unit = "V", interpolation = "hold" }
output = { name = "angle", unit = "rad", noise = 3e-4 }

[model]
effects = ["viscous_damping"]

[records]
train = [{ file = "3.csv" }]
holdout = [{ file = "2.csv" }]
"""


def test_two_levels_of_an_input_do_not_tell_a_limit_from_a_constant_force(tmp_path: Path) -> None:
    """With a limit between them the motor is slower than in proportion at the higher one, as with a push."""
    time, rng = np.arange(0.0, 5.0, 0.033), np.random.default_rng(1)
    pwm = np.where(time < 1.0, 150.0, 120.0)
    limit, gain, damping = 132.0, 0.64, 3.2
    fast, slow = gain * limit / damping, gain * 120.0 / damping
    speed = np.where(time < 1.0, fast, slow + (fast - slow) * np.exp(-damping * (time - 1.0)))
    read = speed + rng.normal(0.0, 0.1, time.size)
    pd.DataFrame({"t": time, "pwm": pwm, "speed": read}).to_csv(tmp_path / "a.csv", index=False)
    (tmp_path / "rig.toml").write_text(MOTOR, encoding="utf-8")
    found = close_loop(load_dataset(tmp_path / "rig.toml"))
    (named,) = found.summary()["effects"]
    assert {named["id"], *named["ambiguous_with"]} >= {"constant_force_at_body", "input_saturation"}
    assert named["probability"] < 0.7


def _turned(target: float, seed: int) -> pd.DataFrame:
    """Return what a controller reads of a motor with dry friction whose amplifier gives no more than 4.5 V."""
    step, gain, damping, friction, most = 0.04, 9.0, 9.0, 2.7, 4.5
    rows, state, rng = [], np.array([0.2, 0.0]), np.random.default_rng(seed)
    for k in range(95):
        asked = 5.0 * (target - state[0]) + 0.3
        push = gain * min(max(asked, -most), most)
        rows.append((k * step, asked, state[0] + rng.normal(0.0, 3e-4)))

        def motion(_, q, push=push):
            return [q[1], push - damping * q[1] - friction * np.tanh(q[1] / 2e-3)]

        state = solve_ivp(motion, (0.0, step), state, method="LSODA", rtol=1e-8, atol=1e-10, max_step=1e-3).y[:, -1]
    return pd.DataFrame(rows, columns=["t", "effort", "angle"])


def test_a_limit_is_found_beside_friction_that_hides_it(tmp_path: Path) -> None:
    """Next to no limit nothing tells of one, and from there the gain and the losses that go with it are far away."""
    for target in (3.0, 2.0):
        _turned(target, int(target)).to_csv(tmp_path / f"{target:.0f}.csv", index=False)
    (tmp_path / "rig.toml").write_text(PAN, encoding="utf-8")
    found = close_loop(load_dataset(tmp_path / "rig.toml"))
    assert {*found.added} == {"coulomb_friction", "input_saturation"}
    assert 1 / found.after.values["s_u"] == pytest.approx(4.5, rel=0.02)
    assert found.errors["after"]["holdout"]["rms"] < 1.5e-3
