"""Recordings from which nothing can be learned."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from discovery.drafting.overview import overview, overview_lines
from discovery.foundation.errors import InputError
from discovery.recordings.dataset import Dataset, load_dataset
from discovery.recordings.unusable import refuse_unusable

RIG = Path(__file__).parents[1] / "datasets" / "arm" / "rig.toml"
TIME = np.arange(0.0, 12.0, 0.01)


def recorded(path: Path, bent: float, seed: int) -> Path:
    """Write a move of an arm whose tip swings by so much about the motor's line [rad]."""
    rng = np.random.default_rng(seed)
    motor = 0.6 * np.sin(0.9 * TIME + seed)
    tip = motor + bent * np.sin(5.0 * TIME)
    columns = np.column_stack([TIME, motor + 7e-5 * rng.standard_normal(TIME.size), np.cos(tip), np.sin(tip)])
    columns[:, 2:] += 3e-4 * rng.standard_normal((TIME.size, 2))
    names = "time_s,motor_angle_rad,tip_x_m,tip_y_m"
    np.savetxt(path, columns, delimiter=",", header=names, comments="", fmt="%.7g")
    return path


def test_an_arm_that_nowhere_bends_is_refused(tmp_path: Path) -> None:
    still = [recorded(tmp_path / f"{name}.csv", 0.0, seed) for name, seed in (("a", 1), ("b", 2))]
    with pytest.raises(InputError, match=r"a\.csv, .*b\.csv: the tip never leaves the motor's line.*Record faster"):
        load_dataset(RIG, still)


@pytest.mark.parametrize("bent", [1e-3, 0.1])
def test_one_recording_that_bends_a_little_is_enough(tmp_path: Path, bent: float) -> None:
    files = [recorded(tmp_path / "a.csv", 0.0, 1), recorded(tmp_path / "b.csv", bent, 2)]
    assert len(load_dataset(RIG, files).train) == 2


MOTOR = """name = "motor"
[system]
coordinates = { phi = "rad" }
input = { duty = "1" }
kinetic = "inertia*dot(phi)^2/2"
dissipation = "loss*dot(phi)^2/2"
forces = { phi = "gain*duty" }
output = "dot(phi)"
places = { shaft = "phi" }
[system.constants]
inertia = { value = 1.0, unit = "kg m^2" }
loss = { guess = 5.0, unit = "N m s" }
gain = { guess = 1.0, unit = "N m" }
"""
DRIVE = 'name = "d"\nkind = "drive"\n'
OSCILLATOR = 'name = "o"\nkind = "oscillator"\n'
COLUMNS = """[columns]
time = { name = "t", unit = "s" }
input = { name = "u", unit = "INPUT" }
output = { name = "y", unit = "UNIT" }
"""


def under(folder: Path, rig: str, inputs: list[float], start: tuple[float, float], spring: float) -> Dataset:
    """Read motions from a start (position, rate) under constant inputs."""
    files, (units, order) = [], (("rad/s", "1"), 1) if rig == MOTOR else (("m", "N"), 0)
    for i, u in enumerate(inputs):
        t = np.arange(0.0, 4.0, 0.02)
        slope = lambda _, s, u=u: [s[1], u - 1.0 * s[1] - spring * s[0]]  # noqa: E731
        y = solve_ivp(slope, (0.0, 4.0), start, t_eval=t, rtol=1e-8).y[order]
        y = y + 2e-3 * np.random.default_rng(i).standard_normal(t.size)
        files.append(folder / f"{i}.csv")
        np.savetxt(files[-1], np.column_stack([t, 0 * t + u, y]), delimiter=",", header="t,u,y", comments="")
    (folder / "rig.toml").write_text(rig + COLUMNS.replace("UNIT", units[0]).replace("INPUT", units[1]))
    return load_dataset(folder / "rig.toml", files)


@pytest.mark.parametrize(
    ("rig", "inputs", "start", "spring"),
    [
        (MOTOR, [2.0], (0.0, 0.0), 0.0),
        (MOTOR, [2.0, 1.0], (0.0, 1.5), 0.0),
        (MOTOR, [2.0], (0.0, 0.6), 0.0),  # the recording begins when the run-up has begun
        (OSCILLATOR, [2.0], (0.0, 0.0), 20.0),
        (OSCILLATOR, [2.0, 0.0], (0.5, 0.0), 20.0),
    ],
)
def test_a_step_from_rest_or_inputs_of_several_sizes_tell_a_gain(tmp_path, rig, inputs, start, spring) -> None:
    read = under(tmp_path, rig, inputs, start, spring)
    assert f"input: {inputs[0]:g} throughout" in "\n".join(overview_lines(read, overview(read))).replace(" N ", " ")


@pytest.mark.parametrize(
    ("rig", "inputs", "start", "spring"),
    [
        (MOTOR, [2.0], (0.0, 2.0), 0.0),  # steady
        (MOTOR, [2.0], (0.0, 1.9), 0.0),  # nearly
        (MOTOR, [2.0], (0.0, 6.0), 0.0),  # a decay about a constant
        (OSCILLATOR, [2.0], (0.4, 0.0), 20.0),
        (OSCILLATOR, [2.0], (0.0, 3.0), 20.0),
        (OSCILLATOR, [0.0, 0.0], (0.4, 0.0), 20.0),
    ],
)
def test_a_constant_input_that_tells_no_gain_is_refused(tmp_path, rig, inputs, start, spring) -> None:
    with pytest.raises(InputError, match=r"throughout, so it drives nothing.*remove the input"):
        under(tmp_path, rig, inputs, start, spring)


@pytest.mark.parametrize(
    ("rig", "start", "zero"),
    [
        (DRIVE, (2.0, 0.0), 2.0),  # it begins at rest, but not at zero
        (OSCILLATOR, (0.4, 3.0), None),
        (MOTOR, (0.0, 6.0), None),  # a speed is counted from rest
    ],
)
def test_a_step_from_rest_elsewhere_asks_for_the_zero(tmp_path, rig, start, zero) -> None:
    with pytest.raises(InputError, match="throughout, so it drives nothing") as refused:
        under(tmp_path, rig, [2.0], start, 0.0 if rig != OSCILLATOR else 20.0)
    told = re.search(r"set zero = (\S+) for the output", str(refused.value))
    assert (told and float(told[1])) == (zero and pytest.approx(zero, abs=0.01))


def test_a_step_that_begins_too_fast_to_see_is_one_where_the_rig_file_says_so(tmp_path: Path) -> None:
    """Of marks that pass, the first few already do so at speed."""
    with pytest.raises(InputError, match="drives nothing"):
        under(tmp_path, DRIVE, [200.0], (0.0, 150.0), 0.0)
    rig = (tmp_path / "rig.toml").read_text() + '[records]\ntrain = [{ file = "0.csv", at_rest = true }]\n'
    (tmp_path / "rig.toml").write_text(rig)
    assert load_dataset(tmp_path / "rig.toml").train[0].recording.at_rest


@pytest.mark.parametrize(
    ("count", "gap", "said"),
    [
        (60, 0, r"held-out part has 20 .*, of 60 in all, .*Give a longer .*more often, or name another recording"),
        (120, 70, r"fitted part has 10 .*, of 120 in all, .*Give a recording without so long a gap, or name another"),
    ],
)
def test_a_part_that_is_too_small_is_told_with_its_own_remedy(tmp_path, count, gap, said) -> None:
    t = np.arange(count) * 0.05
    y = np.sin(4.0 * t)
    y[5 : 5 + gap] = np.nan
    np.savetxt(tmp_path / "a.csv", np.column_stack([t, y]), delimiter=",", header="t,y", comments="")
    columns = COLUMNS.replace('input = { name = "u", unit = "INPUT" }\n', "").replace("UNIT", "m")
    (tmp_path / "rig.toml").write_text(OSCILLATOR + columns)
    with pytest.raises(InputError, match=said) as refused:
        load_dataset(tmp_path / "rig.toml", tmp_path / "a.csv")
    assert ("gap" in str(refused.value)) == (gap > 0)


def stepped(folder: Path, at: int) -> Dataset:
    """Read the speed of a motor, in coarse steps, whose voltage jumps at a row of 300."""
    gone = np.maximum(np.arange(300) - at, 0)
    columns = np.column_stack([0.02 * np.arange(300), 9.0 * (gone > 0), np.round(8 * (1 - np.exp(-gone / 5.0)))])
    np.savetxt(folder / "step.csv", columns, delimiter=",", header="t,u,y", comments="")
    (folder / "rig.toml").write_text(MOTOR + COLUMNS.replace("UNIT", "rad/s").replace("INPUT", "1"))
    return load_dataset(folder / "rig.toml", folder / "step.csv")


@pytest.mark.parametrize("at", [100, 220])
def test_of_a_step_the_rise_is_fitted(tmp_path: Path, at: int) -> None:
    (step,) = stepped(tmp_path, at).train
    assert np.ptp(step.recording.output[step.fitted]) >= 6.0


def test_training_that_does_not_move_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"the first 195 of 300 readings are fitted, and they do not move.*samples ="):
        refuse_unusable([("train", replace(stepped(tmp_path, 200).train[0], fitted_samples=195))])


@pytest.mark.parametrize(("inputs", "spring"), [([2.0], 20.0), ([2.0, 2.0], 20.0)])
def test_one_level_of_an_input_beside_a_constant_force_is_refused(tmp_path, inputs, spring) -> None:
    rig = OSCILLATOR + 'model = { effects = ["viscous_damping", "linear_stiffness", "equilibrium_offset"] }\n'
    with pytest.raises(InputError, match=r"2 N throughout, and equilibrium_offset has a constant force.*other inputs"):
        under(tmp_path, rig, inputs, (0.0, 0.0), spring)
    # Several levels tell the gain.
    under(tmp_path, rig, [2.0, 1.0], (0.0, 0.0), spring)
