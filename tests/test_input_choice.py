"""How an input ran between its samples: an exact linear oscillator, solved by the matrix exponential, is told right."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import solve_ivp
from scipy.signal import cont2discrete
from test_at_rest import RIG as RIG_OF_DISCS

from discovery.estimation.declared import declared_model
from discovery.estimation.input_choice import choose_interpolation
from discovery.estimation.natural_units import natural_units
from discovery.estimation.step import choose_step
from discovery.foundation.errors import ComputationError, InputError
from discovery.recordings.dataset import load_dataset

RIG = """
name = "circuit"
kind = "oscillator"
[columns]
time = { name = "t_s", unit = "s" }
input = { name = "u_V", unit = "V", interpolation = "%s" }
output = { name = "y_mm", unit = "mm", noise = %g }
"""
STEP, ALPHA, XI, GAIN = 0.05, 36.0, 0.6, 2.0
#: scipy's names of an input that is held and one that is straight between samples.
METHODS = {"hold": "zoh", "linear": "foh"}


def recorded(folder, interpolation, *, asked="auto", noise=0.02):
    """Write a rig and a recording of a random input that really ran as told."""
    rng = np.random.default_rng(7)
    u = np.repeat(rng.normal(size=200), 3)
    system = (
        np.array([[0.0, 1.0], [-ALPHA, -XI]]),
        np.array([[0.0], [GAIN]]),
        np.array([[1e3, 0.0]]),
        np.zeros((1, 1)),
    )
    a, b, c, d, _ = cont2discrete(system, STEP, METHODS[interpolation])
    state, y = np.zeros((2, 1)), np.empty(u.size)
    for n, value in enumerate(u):
        y[n] = (c @ state + d * value).item()
        state = a @ state + b * value
    table = np.column_stack([STEP * np.arange(u.size), u, y + noise * rng.standard_normal(u.size)])
    np.savetxt(folder / "run.csv", table, delimiter=",", header="t_s,u_V,y_mm", comments="")
    (folder / "rig.toml").write_text(RIG % (asked, noise))
    return folder / "rig.toml", [folder / "run.csv"]


@pytest.mark.parametrize("interpolation", METHODS)
def test_the_recording_tells_how_its_input_ran(tmp_path, interpolation):
    dataset = choose_interpolation(load_dataset(*recorded(tmp_path, interpolation)))
    assert dataset.rig.columns.input.interpolation == interpolation
    for experiment in dataset.train:
        assert experiment.rig is dataset.rig
        assert experiment.fitted_samples == 400
        assert f'interpolation = "{interpolation}"' in experiment.recording.notes[-1]


def test_a_law_that_is_missing_does_not_decide(tmp_path):
    """Half a sample of an input that is held is a lag, and so is what dry friction does."""
    rng = np.random.default_rng(14)
    time = 0.004 * np.arange(2250)
    rate, phase, size = (rng.uniform(*ends, (10, 1)) for ends in ((0.4, 5.0), (0.0, 6.28), (0.9, 3.0)))

    def push(t):
        return (size * np.sin(2 * np.pi * rate * t + phase)).sum(0) * np.minimum(1, t / 0.3)

    def motion(t, y):
        force = push(np.array([t]))[0] - 420.0 * y[0] - 8.0 * y[1] - 1.5 * np.tanh(y[1] / 1e-3)
        return [y[1], force / 1.35]

    found = solve_ivp(motion, (0, time[-1]), [0, 0], "LSODA", time, rtol=1e-8, atol=1e-10, max_step=0.004)
    output = 1e3 * found.y[0] + 0.03 * rng.standard_normal(time.size)
    table = np.column_stack([time, push(time), output])
    np.savetxt(tmp_path / "run.csv", table, delimiter=",", header="t_s,u_V,y_mm", comments="")
    (tmp_path / "rig.toml").write_text(RIG % ("auto", 0.03))
    dataset = choose_interpolation(load_dataset(tmp_path / "rig.toml", [tmp_path / "run.csv"]))
    assert dataset.rig.columns.input.interpolation == "spline"
    (note,) = [flag for flag in dataset.train[0].recording.flags if flag.code == "input_chosen"]
    assert ("A smaller one does not count: half a sample of lag" in note.sentence) == note.numbers["kept"] is True


def test_where_noise_hides_it_the_usual_one_is_kept(tmp_path):
    dataset = choose_interpolation(load_dataset(*recorded(tmp_path, "linear", noise=300.0)))
    assert dataset.rig.columns.input.interpolation == "spline"


def test_what_the_rig_file_names_is_kept(tmp_path):
    dataset = load_dataset(*recorded(tmp_path, "hold", asked="linear"))
    assert choose_interpolation(dataset) is dataset


def test_an_input_that_is_differentiated_cannot_jump(tmp_path):
    rig, files = recorded(tmp_path, "hold", asked="hold")
    rig.write_text(rig.read_text().replace('"mm", noise =', '"m/s^2", reads = "acceleration", noise ='))
    with pytest.raises(InputError, match=r'line 6: the second derivative of this input is needed.*Set it to "spline"'):
        load_dataset(rig, files)


def test_uneven_steps_leave_the_other_kinds(tmp_path):
    """Stamps to the millisecond are no even steps: what needs them is passed over, not refused."""
    rig, files = recorded(tmp_path, "linear")
    table = np.loadtxt(files[0], delimiter=",", skiprows=1)
    table[:, 0] += 0.02 * STEP * np.random.default_rng(3).uniform(-1.0, 1.0, len(table))
    np.savetxt(files[0], table, delimiter=",", header="t_s,u_V,y_mm", comments="")
    dataset = choose_interpolation(load_dataset(rig, files))
    assert dataset.rig.columns.input.interpolation in ("spline", "linear")
    assert "band limited" not in dataset.train[0].recording.notes[-1]


def test_a_motion_that_runs_away_is_no_question_of_the_step(tmp_path: Path) -> None:
    """Two discs whose shaft pushes them apart: no step is tried that would take all memory."""
    text = RIG_OF_DISCS.format(rest="").replace('"linear"', '"auto"')
    text = text.replace("stiffness = { guess = 1.0", "stiffness = { guess = -20")
    time = np.arange(0.0, 6.0, 0.01)
    force = np.sign(np.sin(2 * time))
    pd.DataFrame({"t": time, "u": force, "y": np.sin(2 * time) + 0.1 * time}).to_csv(tmp_path / "a.csv", index=False)
    (tmp_path / "rig.toml").write_text(text, encoding="utf-8")
    train = load_dataset(tmp_path / "rig.toml", [tmp_path / "a.csv"])
    model = declared_model(train.train[0])
    units = natural_units(train.train)
    values = {n: p.default for n, p in model.parameters.items()}
    with pytest.raises(ComputationError, match="No step gives"):
        choose_step(model, train.train, units, values)
    chosen = choose_interpolation(train)
    (flag,) = (f for f in chosen.train[0].recording.flags if f.code == "input_assumed")
    assert "blows up from its guesses" in flag.sentence
    assert chosen.rig.columns.input.interpolation == "spline"
