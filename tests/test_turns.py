"""What only a motion that turns back tells is sought where it does."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from discovery.equations.lacking import candidates
from discovery.equations.model import Model
from discovery.estimation.declared import declared_model
from discovery.recordings.dataset import load_dataset
from discovery.recordings.parts import course, spins, turns_back

RIG = """
name = "sledge"
[system]
coordinates = {{ x = "m" }}
kinetic = "mass*dot(x)^2/2"
dissipation = "loss*dot(x)^2/2"
output = "{output}"
places = {{ body = "x" }}
[system.constants]
mass = {{ value = 2.0, unit = "kg" }}
loss = {{ guess = 0.5, unit = "N s/m" }}
[columns]
time = {{ name = "t", unit = "s" }}
output = {{ name = "read", unit = "{unit}", noise = 0.01 }}
"""
TIME = np.arange(0.0, 10.0, 0.02)
#: Positions, and whether they turn back twice, by more than noise and a small part of the way.
WAYS = {
    "on and on": (0.5 * TIME - 0.02 * TIME**2, False),
    "there and back": (TIME * (10.0 - TIME) / 10.0, False),
    "to and fro": (np.sin(2 * TIME), True),
    "on, with a tremor": (TIME / 4.0 + 0.02 * np.sin(9 * TIME), False),
}


@pytest.mark.parametrize("output", ["x", "dot(x)"])
@pytest.mark.parametrize("name", WAYS)
def test_laws_of_memory_are_sought_where_the_motion_turns_back_twice(tmp_path: Path, name: str, output: str) -> None:
    way, turns = WAYS[name]
    read = way if output == "x" else np.gradient(way, TIME)
    read = read + 0.01 * np.random.default_rng(2).standard_normal(TIME.size)
    np.savetxt(tmp_path / "a.csv", np.column_stack([TIME, read]), delimiter=",", header="t,read", comments="")
    (tmp_path / "rig.toml").write_text(RIG.format(output=output, unit="m" if output == "x" else "m/s"))
    assert turns_back(load_dataset(tmp_path / "rig.toml", [tmp_path / "a.csv"]).train) is turns


@pytest.mark.parametrize("output", ["x", "dot(x)"])
@pytest.mark.parametrize(("name", "goes_on"), [("on and on", True), ("there and back", False), ("to and fro", False)])
def test_a_shaft_that_goes_on_through_full_turns_has_no_place_of_rest(
    tmp_path: Path, output: str, name: str, *, goes_on: bool
) -> None:
    way = 20.0 * WAYS[name][0]
    read = way if output == "x" else np.gradient(way, TIME)
    read = read + 0.01 * np.random.default_rng(2).standard_normal(TIME.size)
    np.savetxt(tmp_path / "a.csv", np.column_stack([TIME, read]), delimiter=",", header="t,read", comments="")
    rig = RIG.format(output=output, unit="rad" if output == "x" else "rad/s").replace("N s/m", "N m s")
    rig = rig.replace('x = "m"', 'x = "rad"').replace('"kg"', '"kg m^2"')
    (tmp_path / "rig.toml").write_text(rig)
    train = load_dataset(tmp_path / "rig.toml", [tmp_path / "a.csv"]).train
    assert spins(train) is goes_on
    found = {*candidates(declared_model(train[0]), train[0].coordinate_unit, **course(train))}
    springs = {e for e in found if e.startswith(("linear_stiffness", "negative_stiffness"))}
    assert bool(springs) is not goes_on
    # No camera reads a speed, nor full turns.
    assert "perspective" not in found
    # What is the same in each turn is shown by it.
    assert any(e.startswith("cogging") for e in found)


@pytest.mark.parametrize(("largest", "shown"), [(0.9, True), (1.1, False)])
def test_a_picture_shows_an_angle_up_to_half_a_turn_from_its_zero(
    tmp_path: Path, largest: float, *, shown: bool
) -> None:
    read = largest * np.pi * np.sin(3.0 * TIME)
    np.savetxt(tmp_path / "a.csv", np.column_stack([TIME, read]), delimiter=",", header="t,read", comments="")
    rig = RIG.format(output="x", unit="rad").replace("N s/m", "N m s").replace('x = "m"', 'x = "rad"')
    (tmp_path / "rig.toml").write_text(rig.replace('"kg"', '"kg m^2"'))
    train = load_dataset(tmp_path / "rig.toml", [tmp_path / "a.csv"]).train
    found = candidates(declared_model(train[0]), train[0].coordinate_unit, **course(train))
    assert ("perspective" in found) is shown


@pytest.mark.parametrize(("unit", "offered"), [("m", True), ("pixel", True), ("V", True), ("N", False), ("N m", False)])
def test_no_camera_reads_a_force(unit: str, offered: bool) -> None:
    assert ("perspective" in candidates(Model("oscillator", ("viscous_damping",)), unit)) is offered


def test_without_reversals_no_law_of_memory_is_missing() -> None:
    model = Model("oscillator", ("viscous_damping", "linear_stiffness"))
    assert {*candidates(model)} - {*candidates(model, turns=False)} == {"hysteresis", "presliding_friction"}
    free = Model("inverse_dynamics", ("viscous_damping",))
    lost = {*candidates(free)} - {*candidates(free, turns=False)}
    assert {"friction_through_play", "presliding_friction"} <= lost
    assert "coulomb_friction" not in lost
