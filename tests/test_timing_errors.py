"""Readings that were taken at other times than steady stamps say."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from test_time_jitter import NOISE, RATE, written

from discovery.recordings.flags import UNDERSTATED, doubted
from discovery.recordings.local_fits import excess_scatter, timing_error
from discovery.recordings.recording import read_recording
from discovery.rigs.rig_file import read_rig

STEP, COUNT = 1 / 21, 600
STEADY = STEP * np.arange(COUNT)
FRAMES = np.round(30 * STEADY) / 30  # of a film of 30 pictures a second
JITTER = float(np.std(FRAMES - STEADY))


def swing(time: np.ndarray) -> np.ndarray:
    return np.asarray(0.4 * np.exp(-0.02 * time) * np.cos(RATE * time))


def noise(size: float = NOISE, count: int = COUNT, seed: int = 0) -> np.ndarray:
    return size * np.random.default_rng(seed).standard_normal(count)


def clean(kind: str, step: float, count: int = 2000) -> np.ndarray:
    """A motion with noise at the times that its stamps say, in swings of a second."""
    time = step * np.arange(count)
    turn = 2 * np.pi * time
    motion = {
        "decay": np.exp(-time / 20) * np.cos(turn),
        "harmonics": np.cos(turn) + 0.2 * np.cos(3 * turn + 1.0),
        "growing pitch": np.sin(turn * (0.5 + time / time[-1])),
        "steps": np.sign(np.sin(turn / 8)) * (1 - np.exp(-10 * (time % 4.0))),
        "bounces": np.abs(np.sin(turn / 2)),
        "relaxing": np.tanh(4 * np.sin(turn)),
        "at rest": np.zeros(count),
        "slow": np.sin(turn / 100),
    }[kind]
    return np.asarray(motion + noise(3e-3, count))


@pytest.mark.parametrize("size", [1e-4, NOISE, 4e-3])
def test_frames_written_out_at_another_rate_are_told_from_their_scatter_at_speed(size: float) -> None:
    found = timing_error(STEADY, swing(FRAMES) + noise(size), 1e-9)
    assert found is not None
    assert found.sd == pytest.approx(JITTER, rel=0.15)
    assert 0.6 * size < found.noise < 6e-3
    # An estimate from 600 readings of noise that is a third of it at speed is known to a tenth.
    independent = np.random.default_rng(5).normal(0.0, JITTER, COUNT)
    found = timing_error(STEADY, swing(STEADY + independent) + noise(size), 1e-9)
    assert found is not None
    assert found.sd == pytest.approx(JITTER, rel=0.25)
    assert timing_error(STEADY, swing(STEADY) + noise(size), 1e-9) is None
    # The same without a fifth of the readings, and too few of them.
    kept = np.random.default_rng(6).random(COUNT) > 0.02
    found = timing_error(STEADY[kept], (swing(FRAMES) + noise(size))[kept], 1e-9)
    assert found is not None
    assert found.sd == pytest.approx(JITTER, rel=0.25)
    assert timing_error(STEADY[:150], swing(FRAMES)[:150], 1e-9) is None


@pytest.mark.parametrize("samples", [5, 8, 12, 20, 50, 200])
@pytest.mark.parametrize(
    "kind", ["decay", "harmonics", "growing pitch", "steps", "bounces", "relaxing", "at rest", "slow"]
)
def test_a_motion_read_at_its_stamps_shows_no_error_of_timing(kind: str, samples: int) -> None:
    values = clean(kind, 1 / samples)
    time = np.arange(values.size) / samples
    assert timing_error(time, values, 1e-9) is None
    # Neither does one that an encoder rounds, coarsely or finely.
    for quantum in (0.1, 0.01):
        rounded = quantum * np.round(values / quantum)
        assert timing_error(time, rounded, quantum / np.sqrt(12)) is None


def test_a_clock_that_was_late_a_few_times_says_nothing_of_all_readings() -> None:
    rng = np.random.default_rng(4)
    late = np.where(rng.random(COUNT) < 0.05, 0.03, 0.0)
    assert timing_error(STEADY, swing(STEADY + late) + noise(), 1e-9) is None


def test_estimated_noise_is_that_at_rest_where_timing_errs_and_the_remedy_is_told(tmp_path: Path) -> None:
    rig, data = written(tmp_path, STEADY, swing(FRAMES) + noise())
    rig.write_text(rig.read_text().replace(f", noise = {NOISE}", ""))
    recording = read_recording(data, read_rig(rig))
    assert recording.noise_estimated
    assert recording.noise[0] < 5e-3
    assert recording.jitter == pytest.approx(JITTER, rel=0.15)
    # What errors of timing add is noise of a perfect model, too.
    assert recording.noise_floor() == pytest.approx(np.std(swing(FRAMES) - swing(STEADY)), rel=0.25)
    (doubt,) = doubted({"film": recording.flags})
    assert "from its stamp, though the stamps are steady" in doubt
    assert "10 ms (sd) from" in doubt  # in the column's unit
    assert "time = { ..., jitter = 10 }" in doubt
    # Stated as none, it is none.
    rig.write_text(rig.read_text().replace('unit = "ms"', 'unit = "ms", jitter = 0.0'))
    assert read_recording(data, read_rig(rig)).jitter == 0.0


def test_scatter_that_stated_jitter_explains_is_no_noise_understated(tmp_path: Path) -> None:
    values = swing(FRAMES) + noise()
    assert excess_scatter(STEADY, values, NOISE, JITTER) < 1.5 < excess_scatter(STEADY, values, NOISE, 0.0)
    assert np.isnan(excess_scatter(STEADY[:50], values[:50], NOISE, JITTER))
    for jitter, told in ((1e3 * JITTER, False), (0.1e3 * JITTER, True), (0.0, True)):
        rig, data = written(tmp_path, STEADY, values, f", jitter = {jitter:.3f}")
        codes = [flag.code for flag in read_recording(data, read_rig(rig)).flags]
        assert (UNDERSTATED in codes) is told
