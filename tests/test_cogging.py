"""A motor whose magnets hold on to its teeth: where that is sought, and whether it is found in another's simulation."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from discovery.declarations.registry import get_effect
from discovery.equations.lacking import candidates
from discovery.equations.model import Model
from discovery.recordings.dataset import load_dataset
from discovery.runs.loop import close_loop

RIG = """name = "motor"
kind = "drive"
[columns]
time = { name = "t", unit = "s" }
input = { name = "torque", unit = "N m" }
output = { name = "angle", unit = "rad", noise = 2e-4 }
"""
INERTIA, LOSS, SIZE, PERIODS = 2e-3, 4e-3, 5e-4, 12


def turned(path: Path, seed: int, size: float = SIZE) -> Path:
    """Write the angle of a motor under a torque of five tones, 8 s at 200 Hz."""
    time, rng = np.arange(0.0, 8.0, 0.005), np.random.default_rng(seed)
    tones, phases = 2 * np.pi * np.array([0.2, 0.37, 0.61, 0.9, 1.3]), rng.uniform(0, 2 * np.pi, 5)

    def torque(t: float) -> float:
        return float(0.03 * np.sin(tones * t + phases).sum())

    def slopes(t: float, state: np.ndarray) -> list[float]:
        pull = torque(t) - LOSS * state[1] - size * np.sin(PERIODS * state[0] + 0.4)
        return [state[1], pull / INERTIA]

    angle = solve_ivp(slopes, (0.0, time[-1]), [0.0, 0.0], "DOP853", time, rtol=1e-8, atol=1e-10, max_step=0.01).y[0]
    seen = angle + 2e-4 * rng.standard_normal(time.size)
    table = np.column_stack([time, [torque(t) for t in time], seen])
    np.savetxt(path, table, delimiter=",", header="t,torque,angle", comments="", fmt="%.9g")
    return path


def test_it_is_sought_at_an_angle_that_nothing_ties() -> None:
    bases = ("oscillator", "servo", "inverse_dynamics", "base_excited", "moving_pivot", "falling_body")
    assert {b for b in bases if "cogging" in candidates(Model(b, ("viscous_damping",)))} == {*bases[:3]}
    assert "cogging" not in candidates(Model("oscillator", ("viscous_damping",)), "m")
    for tie in ("linear_stiffness", "gravity_torque"):
        tied = Model("oscillator", ("viscous_damping", tie))
        assert "cogging" not in candidates(tied)
        # What the loop has added is a guess of it.
        assert "cogging" in candidates(tied, declared=("viscous_damping",))


def test_what_repeats_once_a_turn_is_left_to_gravity() -> None:
    (periods,) = (p for p in get_effect("cogging").parameters() if p.shape)
    assert 1 < periods.bounds[0] < 2 == min(periods.starts)


def test_it_imitates_springs_within_few_of_its_periods() -> None:
    effect, at_place = get_effect("cogging"), get_effect("cogging_at_shaft")
    for reach, alike in ((1.0, False), (0.5, True)):
        assert effect.imitates({"N_c": 12.0}, 0.1, 10.0, 0.01, reach, 1.0) is alike
        assert at_place.imitates({"N_c_shaft": 12.0}, 0.1, 10.0, 0.01, reach, 1.0) is alike


def test_it_is_nothing_that_goes_by_in_less_than_two_readings() -> None:
    effect = get_effect("cogging")
    # 30 rad in 10 s, read every 0.1 s: 0.3 rad from one reading to the next.
    assert [effect.imitates({"N_c": n}, 1.0, 10.0, 0.1, 15.0, 1.0) for n in (10.0, 11.0)] == [False, np.inf]
    # To and fro, it goes by as often as that.
    assert [effect.imitates({"N_c": n}, 1.0, 10.0, 0.1, 15.0, 5.0) for n in (2.0, 2.2)] == [False, np.inf]


@pytest.mark.slow
def test_it_is_named_in_a_drive(tmp_path: Path) -> None:
    (tmp_path / "rig.toml").write_text(RIG, encoding="utf-8")
    train, held = [turned(tmp_path / f"train_{k}.csv", k) for k in (11, 12)], turned(tmp_path / "held.csv", 13)
    found = close_loop(load_dataset(tmp_path / "rig.toml", train, held))
    assert (found.verdict, found.added) == ("explained", ("cogging",))
    values, sd = found.after.values, found.after.sd
    assert values["N_c"] == pytest.approx(PERIODS, abs=4 * sd["N_c"])
    assert np.hypot(values["n_a"], values["n_b"]) == pytest.approx(SIZE / INERTIA, rel=0.01)
    assert found.errors["after"]["holdout"]["rms"] < 2.2e-4 < 5e-3 < found.errors["before"]["holdout"]["rms"]


def test_teeth_that_hold_the_rotor_are_counted_from_the_beginning_of_the_recordings(tmp_path: Path) -> None:
    """A free run is soon at another tooth, of the hold-out too, and a fit without teeth pushes the inertia far off."""
    stated, size = 'kind = "drive"\ninertia_kg_m2 = { value = 2.1e-3, sd = 1e-4 }', 24 * SIZE
    (tmp_path / "rig.toml").write_text(RIG.replace('kind = "drive"', stated), encoding="utf-8")
    train = [turned(tmp_path / f"train_{k}.csv", k, size) for k in (21, 22)]
    found = close_loop(load_dataset(tmp_path / "rig.toml", train, [turned(tmp_path / "held.csv", 23, size)]))
    assert (found.verdict, found.added) == ("explained", ("cogging",))
    values = found.after.values
    assert values["N_c"] == pytest.approx(PERIODS, abs=1e-3)
    assert np.hypot(values["n_a"], values["n_b"]) == pytest.approx(size / INERTIA, rel=0.01)
