"""Recordings read far faster than they move: averages lose nothing, and what needs every reading is left alone."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from discovery.estimation.declared import declared_model
from discovery.estimation.fit import fit
from discovery.recordings.averaging import averaged, averaged_down
from discovery.recordings.dataset import load_dataset
from discovery.recordings.recording import Recording
from discovery.rigs.rig import Rig
from discovery.rigs.rig_file import read_rig

STEP, NOISE = 1e-3, 1e-3
RIG = """
name = "bench"
kind = "oscillator"
[columns]
time = { name = "t", unit = "s" }
{input}
output = { name = "y", unit = "m", noise = 0.001 }
[model]
effects = ["viscous_damping", "linear_stiffness"]
"""


@pytest.fixture
def rigs(tmp_path: Path) -> dict[str, Rig]:
    inputs = {"free": "", "spline": "spline", "hold": "hold"}
    for name, way in inputs.items():
        column = f'input = {{ name = "u", unit = "N", interpolation = "{way}" }}' if way else ""
        (tmp_path / f"{name}.toml").write_text(RIG.replace("{input}", column))
    return {name: read_rig(tmp_path / f"{name}.toml") for name in inputs}


def decay(t: np.ndarray) -> np.ndarray:
    return np.exp(-0.1 * t) * np.cos(5.0 * t)


def read(output: np.ndarray, noise: float = NOISE) -> Recording:
    time = STEP * np.arange(output.size)
    return Recording("bench", time, None, output[:, None], ("output",), ("m",), np.array([noise]), "0", "bench.csv")


def noisy(n: int = 20_000, seed: int = 0) -> Recording:
    t = STEP * np.arange(n)
    return read(decay(t) + NOISE * np.random.default_rng(seed).standard_normal(n))


def test_averages_are_the_motion_at_the_middle_of_their_times(rigs: dict[str, Rig]) -> None:
    found = averaged_down(noisy(), rigs["free"])
    length = 20_000 // found.time.size
    assert length > 3
    error = (found.output[1:, 0] - decay(found.time[1:])) / found.noise[0]
    assert found.noise[0] == pytest.approx(NOISE / np.sqrt(length), rel=1e-3)
    # What is taken off for the curvature adds a tenth to the noise.
    assert 0.97 < np.std(error) < 1.15
    assert abs(np.mean(error)) < 4 / np.sqrt(error.size)
    assert "averaged" in found.notes[-1]
    assert "20000" in found.notes[-1]


@settings(max_examples=25, deadline=None)
@given(st.integers(2, 60), st.floats(0.5, 20.0), st.floats(0.0, 6.0))
def test_what_averages_miss_of_a_swing_is_of_fourth_order(length: int, frequency: float, phase: float) -> None:
    t = STEP * np.arange(6000)
    found = averaged(read(np.cos(frequency * t + phase)), length)
    inside = slice(2, -1)
    missed = found.output[inside, 0] - np.cos(frequency * found.time[inside] + phase)
    assert np.abs(missed).max() < (frequency * length * STEP) ** 4 / 200 + 1e-12


def test_a_fit_to_averages_tells_as_much(rigs: dict[str, Rig]) -> None:
    from discovery.recordings.experiment import make_experiment

    whole = noisy()
    fits = []
    for recording in (whole, averaged_down(whole, rigs["free"])):
        experiment = make_experiment(recording, rigs["free"])
        fits.append(fit(declared_model(experiment), [experiment]))
    full, few = fits
    for name in ("xi", "alpha"):
        assert few.sd[name] == pytest.approx(full.sd[name], rel=0.1)
        assert abs(few.values[name] - full.values[name]) < 0.35 * full.sd[name]


def test_what_moves_fast_keeps_its_readings(rigs: dict[str, Rig]) -> None:
    t = STEP * np.arange(20_000)
    ringing = read(decay(t) + 0.01 * np.cos(2000 * t) + noisy().output[:, 0] - decay(t))
    assert averaged_down(ringing, rigs["free"]) is ringing


def test_a_short_recording_keeps_its_readings(rigs: dict[str, Rig]) -> None:
    recording = noisy(3999)
    assert averaged_down(recording, rigs["free"]) is recording


def test_an_input_that_jumps_or_is_held_keeps_its_readings(rigs: dict[str, Rig]) -> None:
    n = 20_000
    t = STEP * np.arange(n)
    smooth, jumps = np.sin(3 * t), np.sign(np.sin(3 * t))
    for inputs, rig, same in ((smooth, "spline", False), (jumps, "spline", True), (smooth, "hold", True)):
        recording = replace(noisy(), input=inputs)
        assert (averaged_down(recording, rigs[rig]) is recording) is same


def test_the_input_is_averaged_like_the_output(rigs: dict[str, Rig]) -> None:
    t = STEP * np.arange(20_000)
    found = averaged_down(replace(noisy(), input=np.sin(3 * t)), rigs["spline"])
    assert found.input is not None
    np.testing.assert_allclose(found.input[2:-1], np.sin(3 * found.time[2:-1]), atol=1e-6)


@pytest.mark.parametrize("length", [2, 3, 10])
def test_averages_begin_when_the_recording_does_with_nothing_read_there(length: int) -> None:
    t = STEP * np.arange(1000)
    found = averaged(replace(noisy(1000), time=5.0 + t, input=np.where(t > 0, np.sin(3 * t), 0.5)), length)
    assert found.input is not None
    assert (found.time[0], found.input[0]) == (5.0, 0.5)
    assert np.isnan(found.output[0]).all()
    assert np.isfinite(found.output[1:]).all()
    np.testing.assert_allclose(np.diff(found.time)[1:], length * STEP)
    assert length * STEP - found.time[1] + found.time[0] == pytest.approx(0.0 if length % 2 else STEP / 2)
    assert 1000 - length < (found.time.size - 1) * length + length / 2 <= 1000 + 1


def test_uneven_times_keep_their_readings(rigs: dict[str, Rig]) -> None:
    recording = noisy()
    time = recording.time + np.where(np.arange(recording.time.size) > 9000, 0.5, 0.0)
    broken = replace(recording, time=time)
    assert averaged_down(broken, rigs["free"]) is broken


def test_the_rounding_of_a_slow_motion_is_not_averaged_away() -> None:
    t = STEP * np.arange(20_000)
    step = 0.01
    found = averaged(read(step * np.round(decay(t) / step), step / np.sqrt(12)), 5)
    missed = np.std(found.output[1:, 0] - decay(t[3:-2]).reshape(-1, 5).mean(axis=1))
    assert missed < 1.05 * found.noise[0] < 1.4 * missed
    assert found.noise[0] > 1.3 * step / np.sqrt(12 * 5)
    # Noise of several steps makes the rounding as random.
    loud = step * np.round((decay(t) + 5 * step * np.random.default_rng(1).standard_normal(t.size)) / step)
    assert averaged(read(loud, 5 * step), 5).noise[0] == pytest.approx(5 * step / np.sqrt(5), rel=1e-6)


def test_a_gap_costs_the_stretch_it_is_in(rigs: dict[str, Rig]) -> None:
    recording = noisy()
    output = recording.output.copy()
    output[5003:5006] = np.nan
    found = averaged_down(replace(recording, output=output), rigs["free"])
    lost = 1 + np.flatnonzero(np.isnan(found.output[1:, 0]))
    assert 1 <= lost.size <= 2
    assert np.abs(found.time[lost] - 5.0045).max() < 0.02
    # Gaps all over leave too few whole stretches.
    output[::50] = np.nan
    torn = replace(recording, output=output)
    assert averaged_down(torn, rigs["free"]) is torn


def test_a_dataset_says_what_was_averaged(tmp_path: Path) -> None:
    (tmp_path / "rig.toml").write_text(RIG.replace("{input}", ""))
    recording = noisy()
    pd.DataFrame({"t": recording.time, "y": recording.output[:, 0]}).to_csv(tmp_path / "one.csv", index=False)
    (experiment,) = load_dataset(tmp_path / "rig.toml", [tmp_path / "one.csv"]).train
    kept = experiment.recording
    assert kept.time.size < 20_000
    assert any("averaged" in note for note in kept.notes)
    assert experiment.fitted_samples is not None
    assert experiment.fitted_samples <= 2 * kept.time.size // 3
