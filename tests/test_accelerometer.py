"""An accelerometer on a free swing: where a fit begins, the size of its zero offset, and the units of what is found."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from discovery.equations.model import Model
from discovery.estimation.natural_units import natural_units
from discovery.recordings.dataset import load_dataset
from discovery.runs.loop import close_loop

RIG = """
name = "a phone between two springs"
kind = "oscillator"
[columns]
time = { name = "t", unit = "s" }
output = { name = "a", unit = "m/s^2", reads = "acceleration", noise = 0.01 }
"""
ALPHA, BETA, XI, OFFSET = 1600.0, 4e7, 1.0, 0.06


def recorded(folder: Path, stop: float) -> None:
    (folder / "rig.toml").write_text(RIG)
    time = np.arange(0.0, stop, 0.002)
    for seed, (name, start) in enumerate((("a", 0.008), ("b", 0.004), ("h", 0.006))):

        def slopes(_, y):
            return y[1], -XI * y[1] - ALPHA * y[0] - BETA * y[0] ** 3

        y = solve_ivp(slopes, (0.0, stop), (start, 0.05), "DOP853", time, rtol=1e-10, atol=1e-13).y
        read = -XI * y[1] - ALPHA * y[0] - BETA * y[0] ** 3 + OFFSET
        read = read + 0.01 * np.random.default_rng(seed).standard_normal(time.size)
        np.savetxt(folder / f"{name}.csv", np.column_stack([time, read]), delimiter=",", header="t,a", comments="")


def test_a_fit_begins_where_a_swing_of_such_an_acceleration_is(tmp_path: Path) -> None:
    recorded(tmp_path, 1.0)
    (experiment,) = load_dataset(tmp_path / "rig.toml", [tmp_path / "b.csv"]).train
    units = natural_units([experiment])
    place, rate = experiment.initial_state(units.time)
    # The springs are harder at this amplitude than the frequency of the whole decay tells.
    assert place == pytest.approx(0.004, rel=0.3)
    assert 0.0 < rate < 0.1
    assert experiment.initial_guess == (0.0, 0.0)


def test_without_readings_it_begins_at_rest(tmp_path: Path) -> None:
    recorded(tmp_path, 1.0)
    (experiment,) = load_dataset(tmp_path / "rig.toml", [tmp_path / "a.csv"]).train
    blank = replace(experiment, recording=replace(experiment.recording, output=np.full((500, 1), np.nan)))
    assert (blank.initial_guess, blank.initial_state(0.02)) == ((0.0, 0.0), (0.0, 0.0))


def test_the_coordinate_is_a_length_and_the_offset_an_acceleration(tmp_path: Path) -> None:
    recorded(tmp_path, 1.0)
    (experiment,) = load_dataset(tmp_path / "rig.toml", [tmp_path / "a.csv"]).train
    units, model = (
        natural_units([experiment]),
        Model("accelerometer", ("cubic_stiffness", "angle_offset", "zero_drift")),
    )
    told = {n: experiment.unit_of(model.parameters[n]) for n in ("beta", "theta_0", "z_t")}
    assert told == {"beta": "s^-2 m^-2", "theta_0": "m s^-2", "z_t": "m s^-3"}
    largest = float(np.abs(experiment.deflection).max())
    assert units.scale(model.parameters["theta_0"]) == pytest.approx(largest, rel=0.1)
    assert units.coordinate == pytest.approx(largest * units.time**2, rel=0.1)


@pytest.mark.slow
def test_a_hard_spring_and_the_zero_of_the_instrument_are_found(tmp_path: Path) -> None:
    recorded(tmp_path, 4.0)
    train = [tmp_path / "a.csv", tmp_path / "b.csv"]
    found = close_loop(load_dataset(tmp_path / "rig.toml", train, [tmp_path / "h.csv"]))
    assert set(found.added) == {"cubic_stiffness", "angle_offset"}
    assert found.after.values["theta_0"] == pytest.approx(OFFSET, abs=0.003)
    assert found.after.values["beta"] == pytest.approx(BETA, rel=0.01)
    assert found.errors["after"]["holdout"]["rms"] < 0.011
