"""A sensor that is asked more often than it measures repeats itself: found, left out, and no slow motion is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from discovery.recordings.dataset import load_dataset
from discovery.recordings.renewals import renewals

POLLED, DECAY = 533.0, 4.0
RIG = """
name = "beam"
kind = "oscillator"
[columns]
time = {{ name = "t_us", unit = "us" }}
{more}output = {{ name = "acc", unit = "g_0", reads = "{reads}" }}
[model]
effects = ["viscous_damping", "linear_stiffness"]
"""


def polled(own: float, size: float = 14.0, rows: int = 600, seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return stamps of a poll, the moments at which a sensor had renewed itself, and what it read in steps of 1/256."""
    rng = np.random.default_rng(seed)
    time = np.arange(rows) / POLLED + rng.uniform(0.0, 4e-6, rows)
    ticks = np.floor(time * own + 0.4)
    renewed = (ticks - 0.4) / own
    noise = 0.01 * rng.standard_normal(rows)[ticks.astype(int)]
    swing = size * np.exp(-DECAY * renewed) * np.cos(2.0 * np.pi * 21.0 * renewed)
    return time, renewed, np.round(256.0 * (swing + noise)) / 256.0


@pytest.mark.parametrize("own", [394.0, 266.5, 180.0, 460.0, 355.3])
@pytest.mark.parametrize("seed", range(2))
def test_the_sensors_own_clock_is_found(own, seed):
    time, renewed, values = polled(own, seed=seed)
    found = renewals(time, values)
    assert found is not None
    assert found.rate == pytest.approx(own, rel=2e-3)
    assert found.share == pytest.approx(1.0 - own / POLLED, abs=0.06)
    off = found.time - renewed[found.fresh]
    # Each reading is known to be as old as it was; a constant age is that of any sensor.
    assert np.abs(off - np.median(off)).max() < 0.1 / own
    assert np.median(np.diff(found.time)) == pytest.approx(1.0 / own, rel=2e-3)


ORDINARY = {
    "decay": lambda k, turn: np.exp(-0.004 * k) * np.cos(turn * k),
    "slow decay": lambda k, turn: np.exp(-0.004 * k) * np.cos(0.1 * turn * k),
    "ramp": lambda k, turn: turn * k / 3.0,
    "jumps between levels": lambda k, turn: np.sign(np.cos(turn * k)),
    "walk": lambda k, turn: np.cumsum(np.random.default_rng(1).standard_normal(k.size)) / 10.0,
}


@pytest.mark.parametrize("motion", ORDINARY)
@pytest.mark.parametrize("size", [3.0, 20.0, 500.0, 3e4])
@pytest.mark.parametrize("noise", [0.0, 0.5, 3.0])
@pytest.mark.parametrize("samples", [6.3, 17.0, 90.0])
def test_coarse_steps_and_slow_motions_are_none(motion, size, noise, samples):
    k = np.arange(700.0)
    values = size * ORDINARY[motion](k, 2.0 * np.pi / samples)
    values = np.round(values + noise * np.random.default_rng(2).standard_normal(k.size))
    assert renewals(0.01 * k, values) is None


def test_a_sensor_that_sticks_now_and_then_is_none():
    time, _, values = polled(POLLED)
    for start in (40, 90, 130):
        values[start : start + 14] = values[start]
    assert renewals(time, values) is None


def test_frames_that_come_now_early_now_late_repeat_too():
    # A camera is asked 30 times a second, and has a new frame after two or three of them, now and then after eight.
    rng = np.random.default_rng(4)
    lengths = np.append(rng.choice([1, 2, 3, 4], 230, p=[0.12, 0.4, 0.38, 0.1]), [8, 8, 8])
    rng.shuffle(lengths)
    begins = np.repeat(np.cumsum(lengths) - lengths, lengths)
    time = np.arange(begins.size) / 30.0
    values = (15.0 * np.exp(-0.02 * time) * np.cos(7.3 * time) + 0.1 * rng.standard_normal(time.size))[begins]
    found = renewals(time, values)
    assert found is not None
    assert found.time is None  # no steady clock
    assert found.fresh[np.unique(begins)].all()
    # At a turn nobody knows whether it stood still.
    assert np.count_nonzero(found.fresh) <= lengths.size + 8
    # Where it has come to rest, an equal reading is one.
    still = np.append(values, np.full(40, values[-1]))
    found = renewals(np.arange(still.size) / 30.0, still)
    assert found is not None
    assert found.fresh[-40:].all()


def written(folder: Path, own: float, more: str = "") -> Path:
    time, _, values = polled(own)
    columns = [np.round(1e6 * time), values, np.sin(3.0 * time)]
    np.savetxt(folder / "a.csv", np.column_stack(columns), "%.6f", ",", header="t_us,acc,drive", comments="")
    (folder / "rig.toml").write_text(
        RIG.format(more=more, reads="position" if more else "acceleration").replace('"g_0"', '"V"' if more else '"g_0"')
    )
    return folder / "rig.toml"


def test_repeats_are_left_out_and_the_rest_is_at_the_sensors_times(tmp_path):
    (experiment,) = load_dataset(written(tmp_path, 394.0), [tmp_path / "a.csv"]).train
    recording = experiment.recording
    (told,) = [flag for flag in recording.flags if flag.code == "readings_repeated"]
    assert "repeats the reading before in 26% of the rows in which it moves: it was asked 533 times a second" in str(
        told
    )
    assert "a new reading 394 times" in str(told)
    assert "the sensor's own steady clock" in str(told)
    assert [flag.code for flag in recording.flags] == ["readings_repeated"]
    assert recording.jitter == 0.0
    assert recording.time.size == pytest.approx(600 * 394.0 / POLLED, abs=2)
    # The age of repeats was taken for noise, ten times as much.
    assert recording.noise[0] == pytest.approx(0.01 * 9.80665, rel=0.3)


def test_a_release_is_at_its_row_of_the_file(tmp_path):
    rng, rows, released, own = np.random.default_rng(3), 900, 300, 394.0
    time = np.arange(rows) / POLLED
    ticks = np.floor(time * own + 0.4)
    since = np.maximum((ticks - 0.4) / own - released / POLLED, 0.0)
    swing = 14.0 * np.exp(-DECAY * since) * np.cos(2.0 * np.pi * 21.0 * since)
    values = np.round(256.0 * (swing + 0.01 * rng.standard_normal(rows)[ticks.astype(int)])) / 256.0
    np.savetxt(tmp_path / "a.csv", np.column_stack([1e6 * time, values]), "%.6f", ",", header="t_us,acc", comments="")
    rig = tmp_path / "rig.toml"
    rig.write_text(RIG.format(more="", reads="position").replace('"g_0"', '"mm"'))
    (experiment,) = load_dataset(rig, [tmp_path / "a.csv"]).train
    (held,) = [flag for flag in experiment.recording.flags if flag.code == "held"]
    assert held.numbers["part"][0] == pytest.approx(released, abs=4)
    assert held.numbers["part"][1] == rows
    assert experiment.recording.time.size == pytest.approx((rows - released) * own / POLLED, abs=4)


def test_beside_an_input_repeats_are_gaps(tmp_path):
    rig = written(tmp_path, 394.0, 'input = { name = "drive", unit = "V" }\n')
    (experiment,) = load_dataset(rig, [tmp_path / "a.csv"]).train
    recording = experiment.recording
    assert recording.time.size == 600
    assert np.isfinite(recording.output).sum() == pytest.approx(600 * 394.0 / POLLED, abs=6)
    codes = [flag.code for flag in recording.flags]
    assert "readings_repeated" in codes
    assert not {"stamps_err", "times_err"}.intersection(codes)
    assert any("older than their stamps by up to 0.0019 s" in note for note in recording.notes)
