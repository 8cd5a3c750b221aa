"""Recordings that begin at rest, as their rig file says, and starts that nothing reads."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from discovery.diagnosis.edges import far_start
from discovery.estimation.declared import first_fit
from discovery.estimation.fit import Fit
from discovery.estimation.natural_units import natural_units
from discovery.recordings.dataset import load_dataset
from discovery.recordings.drive import Drive
from discovery.report.doubt_sentences import caution_sentence
from discovery.simulation.simulate import Simulator

RIG = """
name = "two discs on a shaft"
[system]
coordinates = {{ drive = "rad", load = "rad" }}
input = {{ torque = "N m" }}
kinetic = "near*dot(drive)^2/2 + far*dot(load)^2/2"
potential = "stiffness*(drive - load)^2/2"
dissipation = "loss*dot(drive)^2/2 + shaft_loss*(dot(drive) - dot(load))^2/2"
forces = {{ drive = "torque" }}
output = "drive"
places = {{ drive = "drive", shaft = "drive - load" }}
[system.constants]
near = {{ guess = 1.5e-3, unit = "kg m^2" }}
far = {{ guess = 3e-3, unit = "kg m^2" }}
stiffness = {{ guess = 1.0, unit = "N m / rad" }}
loss = {{ guess = 5e-3, unit = "N m s" }}
shaft_loss = {{ guess = 2e-3, unit = "N m s" }}
[columns]
time = {{ name = "t", unit = "s" }}
input = {{ name = "u", unit = "N m", interpolation = "linear" }}
output = {{ name = "y", unit = "rad", noise = 2e-3 }}
[records]
train = [{{ file = "a.csv"{rest} }}]
"""


def fitted(folder: Path, begins: tuple[float, float], *, at_rest: bool) -> Fit:
    """Fit a recording, simulated by scipy, of which the load begins somewhere at some rate."""
    time, rng = np.arange(0.0, 3.0, 0.01), np.random.default_rng(4)
    levels = 0.1 * rng.choice([-1.0, 0.0, 1.0], size=13)
    torque = np.interp(time, np.arange(13) * 0.25, np.concatenate([[0.0], levels[1:]]))

    def slope(t: float, z: np.ndarray) -> list[float]:
        twist = 1.2 * (z[0] - z[1]) + 1.5e-3 * (z[2] - z[3])
        return [z[2], z[3], (np.interp(t, time, torque) - twist - 6e-3 * z[2]) / 1.2e-3, twist / 2.5e-3]

    motion = solve_ivp(slope, (0.0, 3.0), [0.0, begins[0], 0.0, begins[1]], "LSODA", time, rtol=1e-9, atol=1e-11)
    y = motion.y[0] + 2e-3 * rng.standard_normal(time.size)
    np.savetxt(folder / "a.csv", np.column_stack([time, torque, y]), delimiter=",", header="t,u,y", comments="")
    (folder / "rig.toml").write_text(RIG.format(rest=", at_rest = true" if at_rest else ""), encoding="utf-8")
    train = load_dataset(folder / "rig.toml").train
    return first_fit(train, natural_units(train))


def test_a_start_at_rest_is_believed_and_tells_the_constants_better(tmp_path: Path) -> None:
    free, still = (fitted(tmp_path, (0.0, 0.0), at_rest=rest) for rest in (False, True))
    for name, truth in {"near": 1.2e-3, "far": 2.5e-3, "stiffness": 1.2, "loss": 6e-3, "shaft_loss": 1.5e-3}.items():
        assert still.values[name] == pytest.approx(truth, abs=4 * still.sd[name])
        assert still.sd[name] <= 1.01 * free.sd[name]
    starts = [s for s in still.problem.states if s.row > 0]
    assert len(starts) == 3
    assert all(abs(still.values[s.name]) < 4 * s.width for s in starts)
    assert still.chi2 < 1.2 * still.problem.bench.n_data


def test_what_begins_elsewhere_is_found_where_nothing_is_said(tmp_path: Path) -> None:
    free, still = (fitted(tmp_path, (0.3, 2.0), at_rest=rest) for rest in (False, True))
    assert free.values["load_start_0_init[a]"] == pytest.approx(0.3, abs=0.05)
    assert still.chi2 > 2 * free.chi2


def test_only_the_part_that_begins_a_recording_begins_at_rest(tmp_path: Path) -> None:
    fitted(tmp_path, (0.0, 0.0), at_rest=True)
    recording = load_dataset(tmp_path / "rig.toml").train[0].recording
    assert recording.at_rest
    assert recording.part(slice(50)).at_rest
    assert not recording.part(slice(50, None)).at_rest


@pytest.mark.parametrize(("times", "doubted"), [(1.0, False), (5.0, True)])
def test_a_start_that_nothing_reads_and_that_lies_far_off_is_doubted(
    tmp_path: Path, times: float, doubted: bool
) -> None:
    found = fitted(tmp_path, (0.0, 0.0), at_rest=False)
    (start,) = (s for s in found.problem.states if s.name == "load_start_0_init[a]")
    x = found.minimum.x.copy()
    x[found.problem.names.index(start.name)] = times * start.width
    caution = far_start(replace(found, minimum=replace(found.minimum, x=x)))
    assert (caution is not None) == doubted
    if caution is not None:
        words = caution_sentence(caution.summary())
        assert words.startswith(f"{start.name} = ")
        assert "5 times as far off" in words
        assert "at_rest = true" in words


SWING = """
name = "a body on a spring"
kind = "oscillator"
[columns]
time = { name = "t", unit = "s" }
output = { name = "y", unit = "UNIT", noise = 1e-3READS }
[records]
train = [{ file = "a.csv", at_rest = true }]
"""


def swinging(folder: Path, *, acceleration: bool = False, hold: float = 0.0) -> Path:
    """Write a swing that is let go at one metre, after a while in which it is held there, and its rig file."""
    time = np.arange(0.0, 12.0, 0.02)
    decay, frequency = 0.2, np.sqrt(16.0 - 0.04)
    phase = np.maximum(time - hold, 0.0)
    swing = np.exp(-decay * phase) * (np.cos(frequency * phase) + decay / frequency * np.sin(frequency * phase))
    speed = -16.0 / frequency * np.exp(-decay * phase) * np.sin(frequency * phase)
    read = -16.0 * swing - 2 * decay * speed if acceleration else swing
    y = read + 1e-3 * np.random.default_rng(2).standard_normal(time.size)
    np.savetxt(folder / "a.csv", np.column_stack([time, y]), delimiter=",", header="t,y", comments="")
    text = SWING.replace("UNIT", "m/s^2" if acceleration else "m")
    text = text.replace("READS", ', reads = "acceleration"' if acceleration else "")
    (folder / "rig.toml").write_text(text, encoding="utf-8")
    return folder / "rig.toml"


@pytest.mark.parametrize("kind", [{}, {"acceleration": True}, {"hold": 2.0}], ids=["place", "acceleration", "held"])
def test_what_is_let_go_begins_where_it_is_held(tmp_path: Path, kind: dict[str, Any]) -> None:
    """Its rate alone is zero; a release is seen a little after it, on the way."""
    train = load_dataset(swinging(tmp_path, **kind)).train
    found = first_fit(train, natural_units(train))
    assert found.values["delta_0_init[a]"] == pytest.approx(1.0, abs=0.05)
    assert found.chi2 < 1.3 * found.problem.bench.n_data
    assert train[0].recording.at_rest == ("hold" not in kind)


def test_a_file_that_the_command_line_names_begins_as_the_rig_file_says(tmp_path: Path) -> None:
    rig = swinging(tmp_path)
    assert load_dataset(rig, [tmp_path / "a.csv"]).train[0].recording.at_rest
    np.savetxt(tmp_path / "b.csv", np.genfromtxt(tmp_path / "a.csv", delimiter=",", skip_header=9), delimiter=",")
    (tmp_path / "b.csv").write_text("t,y\n" + (tmp_path / "b.csv").read_text())
    assert not load_dataset(rig, [tmp_path / "b.csv"]).train[0].recording.at_rest


@pytest.mark.parametrize(("at_rest", "past"), [(True, 0.0), (False, 1.0)])
def test_a_late_instrument_reads_rest_before_the_first_step(at_rest: bool, past: float) -> None:
    """A body that a force of 3 pushes from its first moment on: who says that it rested reads no motion from before."""
    time = np.linspace(0.0, 1.0, 11)
    force = Drive(np.array([0.0, 1.0]), np.array([[3.0]]), np.empty(0))
    simulate = Simulator("oscillator", ("sensor_delay",), time, force, step=0.01, at_rest=at_rest)
    given = {"g": 1.0, "tau": 0.25}
    values = np.array([[given.get(name, 0.0)] for name in simulate.names])
    read = simulate(values, np.zeros(1), np.zeros(1))[:, 0, 0]
    late = time - 0.25
    assert read == pytest.approx(np.where(late < 0, past, 1.0) * 1.5 * late**2, abs=1e-9)
